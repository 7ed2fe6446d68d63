//! A thing grown from a piece of it: what stands beside the piece in the same way wherever the piece occurs.

use surfabet_geom::vector::{dot, minus};
use surfabet_geom::{Neighbor, Progress};
use surfabet_models::Result;

use crate::constants::{COVERED, GROWTH_REACH, GROWTH_SAMPLES, NORMAL_COSINE, SUPPORT};
use crate::find::{Motion, Region, SearchScene, Template};

/// What pieces are grown in.
pub(super) struct Growth<'a> {
    pub scene: &'a SearchScene,
    /// Which samples may belong to a thing.
    pub parts: &'a [bool],
    /// Largest diagonal of a thing, metres.
    pub max_size: f64,
}

impl Growth<'_> {
    /// The samples of the thing that `template` is a piece of, and those of `motions`, which take the piece to its places, that take the thing to
    /// others of its kind: at least `least`. Nothing where fewer have anything in common.
    ///
    /// Samples belong to the thing that hang together with the piece, are found again after most of those motions, and are the thing's
    /// [own](Self::is_own).
    pub fn of(
        &self,
        template: &Template,
        motions: &[Motion],
        least: usize,
        progress: &dyn Progress,
    ) -> Result<(Vec<u32>, Vec<Motion>)> {
        progress.check()?;
        if motions.len() < least {
            return Ok((Vec::new(), Vec::new()));
        }
        let around = self.around(template);
        let chosen = self.alike(template, motions, &around, least);
        let belongs = |&i: &u32| {
            let count = chosen.iter().filter(|m| self.is_found(template, m, i)).count();
            is_supported(count, chosen.len()) && self.is_own(template, &chosen, i)
        };
        let own: Vec<u32> = around.into_iter().filter(belongs).collect();
        Ok((self.beside(template, &own), chosen))
    }

    /// The box around samples, a spacing wider; `None` without samples.
    pub fn region(&self, samples: &[u32]) -> Option<Region> {
        let points = &self.scene.surface.points;
        let margin = self.scene.surface.spacing;
        let first = points[*samples.first()? as usize];
        let corner = |pick: fn(f32, f32) -> f32, by: f64| -> [f64; 3] {
            let of = |a: usize| samples.iter().map(|&i| points[i as usize][a]).fold(first[a], pick);
            std::array::from_fn(|a| f64::from(of(a)) + by)
        };
        Some(Region::Box { low: corner(f32::min, -margin), high: corner(f32::max, margin) })
    }

    /// Samples that may belong to the thing, ascending.
    fn around(&self, template: &Template) -> Vec<u32> {
        let mut near: Vec<Neighbor> = Vec::new();
        self.scene.tree.within(
            pivot_after(template, &Motion::NONE),
            self.max_size as f32,
            &mut near,
        );
        let mut all: Vec<u32> =
            near.iter().map(|n| n.index() as u32).filter(|&i| self.parts[i as usize]).collect();
        all.sort_unstable();
        all
    }

    /// The motions, at least `least`, after which the scene is the most alike: with those that find most samples again taken first, as many as give the
    /// largest sum, over the samples of the thing, of how many motions find one again less how many do not. A few samples stand
    /// for all.
    fn alike(
        &self,
        template: &Template,
        motions: &[Motion],
        around: &[u32],
        least: usize,
    ) -> Vec<Motion> {
        let step = around.len().div_ceil(GROWTH_SAMPLES).max(1);
        let few: Vec<u32> = around.iter().copied().step_by(step).collect();
        let found = |motion: &Motion| -> Vec<bool> {
            few.iter().map(|&i| self.is_found(template, motion, i)).collect()
        };
        let mut sorted: Vec<(Vec<bool>, Motion)> =
            motions.iter().map(|motion| (found(motion), *motion)).collect();
        sorted.sort_by_key(|(found, _)| std::cmp::Reverse(found.iter().filter(|f| **f).count()));
        let mut counts = vec![0; few.len()];
        let (mut taken, mut best) = (Vec::new(), (0, Vec::new()));
        for (found, motion) in sorted {
            taken.push(motion);
            counts.iter_mut().zip(found).for_each(|(count, found)| *count += usize::from(found));
            let n = taken.len();
            if n < least {
                continue;
            }
            let samples = few.iter().zip(&counts);
            let own = samples
                .filter(|&(&i, &count)| is_supported(count, n) && self.is_own(template, &taken, i));
            let gain: usize = own.map(|(_, &count)| (2 * count).saturating_sub(n + 1)).sum();
            if gain > best.0 {
                best = (gain, taken.clone());
            }
        }
        best.1
    }

    /// Whether a motion takes a sample to a surface like its own.
    fn is_found(&self, template: &Template, motion: &Motion, i: u32) -> bool {
        let surface = &self.scene.surface;
        let Some(near) = self.scene.tree.nearest(self.moved(template, motion, i)) else {
            return false;
        };
        let limit = (COVERED * template.tolerance + template.spacing) as f32;
        let normal = motion.turned(surface.normals[i as usize]).map(|c| c as f32);
        near.squared_distance() < limit * limit
            && self.parts[near.index()]
            && dot(normal, surface.normals[near.index()]).abs() > NORMAL_COSINE
    }

    /// Whether no motion takes a sample nearer to the pivot of another place than to that of its own: of a row of equal things one
    /// is grown.
    fn is_own(&self, template: &Template, motions: &[Motion], i: u32) -> bool {
        let squared = |a: [f32; 3], b: [f32; 3]| dot(minus(a, b), minus(a, b));
        motions.iter().enumerate().all(|(k, motion)| {
            let p = self.moved(template, motion, i);
            let limit = squared(p, pivot_after(template, motion));
            let mut others = motions.iter().enumerate().filter(|&(other, _)| other != k);
            others.all(|(_, other)| squared(p, pivot_after(template, other)) >= limit)
        })
    }

    fn moved(&self, template: &Template, motion: &Motion, i: u32) -> [f32; 3] {
        let pivot = pivot_after(template, &Motion::NONE);
        let arm = motion.arm(minus(self.scene.surface.points[i as usize], pivot));
        std::array::from_fn(|a| (arm[a] + template.pivot[a] + motion.shift[a]) as f32)
    }

    /// Of some samples those that hang together with some in the template's region.
    fn beside(&self, template: &Template, own: &[u32]) -> Vec<u32> {
        let points = &self.scene.surface.points;
        let reach = (GROWTH_REACH * self.scene.surface.spacing) as f32;
        let is_first = |i: &u32| template.region.contains(points[*i as usize].map(f64::from));
        let mut all: Vec<u32> = own.iter().copied().filter(is_first).collect();
        let mut left = vec![false; points.len()];
        own.iter().filter(|i| !is_first(i)).for_each(|&i| left[i as usize] = true);
        let (mut near, mut next) = (Vec::new(), 0);
        while next < all.len() {
            self.scene.tree.within(points[all[next] as usize], reach, &mut near);
            for n in &near {
                if std::mem::take(&mut left[n.index()]) {
                    all.push(n.index() as u32);
                }
            }
            next += 1;
        }
        all
    }
}

/// Where a motion takes the pivot.
fn pivot_after(template: &Template, motion: &Motion) -> [f32; 3] {
    std::array::from_fn(|a| (template.pivot[a] + motion.shift[a]) as f32)
}

/// Whether a sample that is found again after `count` of `n` motions belongs to the thing.
fn is_supported(count: usize, n: usize) -> bool {
    count as f64 >= SUPPORT * n as f64
}
