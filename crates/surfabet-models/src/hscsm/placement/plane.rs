//! The plane of a patch: of several neighbourhoods of its seed, the one that explains most points.

use surfabet_geom::Moments;

use super::field::{Field, Scratch};
use crate::hscsm::constants::{
    CANDIDATE_RADIUS, FIT_POINTS, FIT_RADII, LINE, PLANE_GATE, REFITS, SAME_ANGLE, SAME_NORMAL,
};
use crate::hscsm::samples::Sample;
use crate::vector::{dot, minus};

/// A plane near a seed.
pub(super) struct SeedPlane {
    pub normal: [f32; 3],
    /// Distance of the seed from the plane along the normal.
    pub seed_offset: f32,
}

/// A point about a seed.
pub(super) struct SeedNeighbour {
    /// From the seed, metres.
    offset: [f32; 3],
    /// Its squared length.
    squared: f32,
    weight: f32,
}

impl Field<'_> {
    /// Normal of point `k` as a candidate, from one neighbourhood.
    pub fn candidate_normal(&self, k: usize, scratch: &mut Scratch) -> [f32; 3] {
        let radius = CANDIDATE_RADIUS * self.grid.size();
        let at = &self.points.all[k];
        let view = self.view_of(at);
        let offsets = &mut scratch.offsets;
        offsets.clear();
        self.near(at.position, radius, |i, p| {
            let d = minus(p, at.position);
            if dot(d, d) < radius * radius {
                let s = &self.points.all[i];
                if view.is_none_or(|v| self.faces(s, v)) {
                    offsets.push((d, s.weight));
                }
            }
        });
        plane(offsets.iter().copied(), view)
            .map_or_else(|| view.unwrap_or([0.0, 0.0, 1.0]), |plane| plane.normal)
    }

    /// The plane about `seed` that most points lie on, or the one with the normal `known` if as good. Owned points
    /// count as well: what is left between patches continues their surface, where alone it would be a mere strip.
    pub(super) fn fit(
        &self,
        seed: &Sample,
        known: Option<[f32; 3]>,
        near: &mut Vec<SeedNeighbour>,
    ) -> SeedPlane {
        let view = self.view_of(seed);
        let size = self.grid.size();
        let gate = PLANE_GATE * self.grid.pixel;
        let radius = FIT_RADII[0] * size;
        self.gather(seed, view, radius, near);
        let every = near.len().div_ceil(FIT_POINTS).max(1);
        let local = || near.iter().step_by(every);
        let explained =
            |normal: [f32; 3]| local().filter(|l| dot(l.offset, normal).abs() < gate).count();
        let mut best: Option<(usize, SeedPlane)> = None;
        for radius in FIT_RADII {
            let limit = radius * radius * size * size;
            let within = local().filter(|l| l.squared < limit).map(|l| (l.offset, l.weight));
            let Some(plane) = plane(within, view) else { continue };
            let explained = explained(plane.normal);
            if best.as_ref().is_none_or(|(most, _)| explained > *most) {
                best = Some((explained, plane));
            }
        }
        let Some((most, first)) = best else {
            // One or two points, or a line of them: their patch faces the sensor, or up.
            let normal = view.unwrap_or([0.0, 0.0, 1.0]);
            return SeedPlane { normal, seed_offset: 0.0 };
        };
        let on = |normal: [f32; 3]| {
            local()
                .filter(move |l| dot(l.offset, normal).abs() < gate)
                .map(|l| (l.offset, l.weight))
        };
        if let Some(normal) = known
            && explained(normal) as f32 >= SAME_NORMAL * most as f32
        {
            let moments = Moments::of_offsets(on(normal));
            let seed_offset = -dot(moments.mean().map(|c| c as f32), normal);
            return SeedPlane { normal, seed_offset };
        }
        // The first plane may lie between two sheets; parallels to it through the seed lead to the seed's own.
        let mut found = SeedPlane { seed_offset: 0.0, ..first };
        for _ in 0..REFITS {
            match plane(on(found.normal), view) {
                Some(plane) if plane.seed_offset.abs() <= 2.0 * gate => {
                    let turn = minus(plane.normal, found.normal);
                    found = plane;
                    if dot(turn, turn) < SAME_ANGLE * SAME_ANGLE {
                        break;
                    }
                }
                _ => break,
            }
        }
        found
    }

    /// Points within `radius` of a seed. Only what was seen from the seed's side may shape its plane.
    fn gather(
        &self,
        seed: &Sample,
        view: Option<[f32; 3]>,
        radius: f32,
        near: &mut Vec<SeedNeighbour>,
    ) {
        near.clear();
        self.near(seed.position, radius, |k, p| {
            let offset = minus(p, seed.position);
            let squared = dot(offset, offset);
            if squared < radius * radius {
                let s = &self.points.all[k];
                if view.is_none_or(|v| self.faces(s, v)) {
                    near.push(SeedNeighbour { offset, squared, weight: s.weight });
                }
            }
        });
    }

    /// Direction to the sensors of a sample, where known.
    fn view_of(&self, s: &Sample) -> Option<[f32; 3]> {
        (self.samples.has_views && s.view != [0.0; 3]).then_some(s.view)
    }
}

/// The least-squares plane of weighted points, turned to where `view` points, or up without one.
fn plane(
    points: impl Iterator<Item = ([f32; 3], f32)>,
    view: Option<[f32; 3]>,
) -> Option<SeedPlane> {
    let moments = Moments::of_offsets(points);
    let axes = moments.principal_axes()?;
    // Points on a line, or one point, have no plane.
    if axes.variances[1] <= LINE * axes.variances[2] {
        return None;
    }
    let mut normal = axes.normal().map(|c| c as f32);
    let flip = match view {
        Some(v) => dot(v, normal) < 0.0,
        // Without a viewpoint both signs are as good: the last non-zero coordinate is made positive.
        None => normal.iter().rev().find(|c| c.abs() > 1e-6).is_some_and(|c| *c < 0.0),
    };
    if flip {
        normal = normal.map(|c| -c);
    }
    let mean = moments.mean().map(|c| c as f32);
    Some(SeedPlane { normal, seed_offset: -dot(mean, normal) })
}
