//! What speaks for a pose and what against it: surfaces explained, and rays through mapped ones.

use surfabet_geom::vector::{dot, length, minus};

use crate::locate::constants::{CROSSING_MARGIN, EXPLAINED, HIDDEN, LEAST_INCIDENCE, SAME_NORMAL};
use crate::locate::map::Localizer;
use crate::locate::placement::Placement;
use crate::locate::refine::{RotationRows, matched};
use crate::locate::samples::Sample;

/// Shares of a scan's samples.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::locate) struct Evidence {
    /// On a mapped surface that faces the same axis.
    pub explained: f64,
    /// Seen through a mapped surface.
    pub contradicted: f64,
    /// Not explained, and in front of a mapped surface that should have been seen instead.
    pub in_front: f64,
    /// Mean of `exp(-d^2 / (2 s^2))` over all, of distances d from the surface with s a third of what counts as explained.
    pub closeness: f64,
}

/// The evidence for a pose.
pub(in crate::locate) fn evidence(
    map: &Localizer,
    samples: &[Sample],
    placement: &Placement,
) -> Evidence {
    let rows = RotationRows::of(&placement.rotation);
    let at: [f32; 3] = std::array::from_fn(|a| placement.translation[a] as f32);
    let tolerance = (EXPLAINED * map.cell) as f32;
    let s = tolerance / 3.0;
    let mut counts = Evidence::default();
    for sample in samples {
        let arm = rows.turn(minus(sample.point, sample.viewpoint));
        let range = length(arm);
        let ray = Ray { from: at, direction: arm.map(|c| c / range) };
        let met = matched(map, &rows, at, sample).filter(|m| {
            let near = m.distance.abs() <= tolerance && m.aside <= 2.0 * tolerance;
            near && (!sample.is_flat() || m.cosine.abs() >= SAME_NORMAL)
        });
        if let Some(m) = &met {
            counts.explained += 1.0;
            counts.closeness += f64::from((-0.5 * (m.distance / s).powi(2)).exp());
        }
        let margin = (CROSSING_MARGIN * map.cell) as f32;
        if ray.meets(map, 0.0, range - margin) {
            counts.contradicted += 1.0;
        } else if met.is_none() && ray.meets(map, range, range + (HIDDEN * map.cell) as f32) {
            counts.in_front += 1.0;
        }
    }
    let n = samples.len().max(1) as f64;
    Evidence {
        explained: counts.explained / n,
        contradicted: counts.contradicted / n,
        in_front: counts.in_front / n,
        closeness: counts.closeness / n,
    }
}

/// A ray of the scan in the map.
struct Ray {
    from: [f32; 3],
    direction: [f32; 3],
}

impl Ray {
    /// Whether the ray meets a mapped surface, not at a grazing angle, between two distances from its start.
    fn meets(&self, map: &Localizer, from: f32, to: f32) -> bool {
        let step = map.cell as f32;
        let aside = 0.8 * step;
        let mut along = from;
        while along < to {
            let p = std::array::from_fn(|a| self.from[a] + along * self.direction[a]);
            let Some(i) = map.nearest.at(p) else {
                // Nothing within reach of the cell.
                along += 3.0 * step;
                continue;
            };
            let away = minus(map.points[i], p);
            let distance = length(away);
            if distance > 2.0 * step {
                along += distance - step;
                continue;
            }
            let incidence = dot(self.direction, map.normals[i]);
            if incidence.abs() >= LEAST_INCIDENCE {
                let meets = along + dot(away, map.normals[i]) / incidence;
                let q: [f32; 3] = std::array::from_fn(|a| self.from[a] + meets * self.direction[a]);
                let off = minus(q, map.points[i]);
                if meets > from && meets < to && dot(off, off) < aside * aside {
                    return true;
                }
            }
            along += 0.75 * step;
        }
        false
    }
}
