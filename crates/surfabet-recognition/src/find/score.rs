//! The score of a place: how much of the example is found there, and how much of the place the example explains.

use surfabet_base::parallel;
use surfabet_geom::vector::minus;
use surfabet_geom::{Neighbor, Progress};
use surfabet_models::Result;

use super::border::Border;
use super::motion::Motion;
use super::scene::SearchScene;
use super::template::Template;
use crate::constants::{COVERED, LEAST_OWN_WEIGHT, RAREST, SCORED_SAMPLES};

impl Template {
    /// Scores of all motions: `sqrt(found * explained * kept)`, with `found` the share of the example that is matched, by rarity
    /// of its samples, `explained` that of the place, and `kept` the share of its border at which the place ends too, for an example
    /// that is a whole model, where colours count: by shape alone the sizes of pieces have that.
    pub fn score_all(
        &self,
        scene: &SearchScene,
        motions: &[Motion],
        progress: &dyn Progress,
    ) -> Result<Vec<(f64, Motion)>> {
        let matches: Vec<Vec<f32>> = parallel::try_map(motions, |motion| -> Result<_> {
            progress.check()?;
            Ok(self.matches(scene, motion, self.tolerance, SCORED_SAMPLES))
        })?;
        let rarity = self.rarity(&matches);
        let has_border = !self.depths.is_empty() && scene.color_tolerance.is_some();
        let border = has_border.then(|| Border::of(self));
        parallel::try_map_range(motions.len(), |k| {
            progress.check()?;
            let found = matched_share(&matches[k], &rarity);
            let explained = self.explained(scene, &motions[k], self.tolerance);
            let kept = border
                .as_ref()
                .map_or(1.0, |border| border.kept(self, scene, &motions[k], &matches[k]));
            Ok(((found * explained * kept).sqrt(), motions[k]))
        })
    }

    /// The same of motions that are too few to tell what is rare: `sqrt(found * explained)`, every sample by its weight.
    pub fn score_plainly(
        &self,
        scene: &SearchScene,
        motions: &[Motion],
        progress: &dyn Progress,
    ) -> Result<Vec<(f64, Motion)>> {
        parallel::try_map(motions, |motion| {
            progress.check()?;
            let matches = self.matches(scene, motion, self.tolerance, SCORED_SAMPLES);
            let found = matched_share(&matches, &self.weights);
            let explained = self.explained(scene, motion, self.tolerance);
            Ok(((found * explained).sqrt(), *motion))
        })
    }

    /// Weight of each sample, times how rare it is: `-ln` of the share of motions that match it, most of which are wrong.
    /// The share is at least [`RAREST`], and short of 1 by half a motion, so that what always matches counts a little.
    fn rarity(&self, matches: &[Vec<f32>]) -> Vec<f64> {
        let n = matches.len() as f64 + 1.0;
        let matched = |i: usize| matches.iter().map(|m| f64::from(m[i])).sum::<f64>();
        let rarity = |i| -((matched(i) + 0.5) / n).clamp(RAREST, 1.0 - 0.5 / n).ln();
        let n_samples = self.points.len().min(SCORED_SAMPLES);
        (0..n_samples).map(|i| self.weights[i] * rarity(i)).collect()
    }

    /// The share of the scene's samples in the moved region, by weight, that the example explains.
    fn explained(&self, scene: &SearchScene, motion: &Motion, tolerance: f64) -> f64 {
        let center = self.moved_pivot(motion);
        // A sample of the scene in the frame of the template.
        let local = |i: u32| motion.arm_back(minus(scene.surface.points[i as usize], center));
        let mut inside = self.inside(scene, motion);
        inside.retain(|&i| self.surroundings.is_none_or(|limit| self.is_beside(local(i), limit)));
        let weights = scene.weights(&inside);
        let (mut sum, mut all) = (0.0, 0.0);
        for (&i, weight) in inside.iter().zip(weights) {
            all += weight;
            let p = local(i).map(|c| c as f32);
            let Some(near) = self.tree.nearest(p) else { continue };
            let q = self.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let normal = scene.surface.normals[i as usize];
            let turned = motion.turned_back(normal).map(|c| c as f32);
            let similarity = self.similarity(scene, near.index(), i as usize);
            sum += weight
                * similarity
                * self.nearness(d, self.normals[near.index()], turned, tolerance);
        }
        sum / all.max(f64::MIN_POSITIVE)
    }

    /// Samples of the scene in the region after a motion, up to the farthest sample of the example.
    fn inside(&self, scene: &SearchScene, motion: &Motion) -> Vec<u32> {
        let center = self.moved_pivot(motion);
        let mut near: Vec<Neighbor> = Vec::new();
        let reach = self.reach * motion.size[0].max(motion.size[1]);
        scene.tree.within(center, reach as f32, &mut near);
        let is_inside = |&i: &u32| {
            let arm = motion.arm_back(minus(scene.surface.points[i as usize], center));
            self.region.contains(std::array::from_fn(|a| arm[a] + self.pivot[a]))
        };
        near.iter().map(|n| n.index() as u32).filter(is_inside).collect()
    }

    /// Where a motion takes the pivot.
    fn moved_pivot(&self, motion: &Motion) -> [f32; 3] {
        std::array::from_fn(|a| (self.pivot[a] + motion.shift[a]) as f32)
    }

    /// Samples of the scene that the example covers after a motion: those near its own samples, without what goes on beyond
    /// its region.
    pub fn covered(&self, scene: &SearchScene, motion: &Motion) -> Vec<u32> {
        let center = self.moved_pivot(motion);
        let mut near: Vec<Neighbor> = Vec::new();
        let reach = self.reach * motion.size[0].max(motion.size[1]) + self.spacing;
        scene.tree.within(center, reach as f32, &mut near);
        let limit = (COVERED * self.tolerance + self.spacing) as f32;
        let is_covered = |i: u32| {
            let arm = motion.arm_back(minus(scene.surface.points[i as usize], center));
            let Some(n) = self.tree.nearest(arm.map(|c| c as f32)) else { return false };
            n.squared_distance() < limit * limit && self.weights[n.index()] > LEAST_OWN_WEIGHT
        };
        let mut covered: Vec<u32> =
            near.iter().map(|n| n.index() as u32).filter(|&i| is_covered(i)).collect();
        covered.sort_unstable();
        covered
    }

    /// Whether a position about the pivot is within `limit` metres of a sample.
    fn is_beside(&self, p: [f64; 3], limit: f64) -> bool {
        let nearest = self.tree.nearest(p.map(|c| c as f32));
        nearest.is_some_and(|n| f64::from(n.squared_distance()) <= limit * limit)
    }
}

/// The share of `weights` that matches.
pub(super) fn matched_share(matches: &[f32], weights: &[f64]) -> f64 {
    let (mut sum, mut all) = (0.0, f64::MIN_POSITIVE);
    for (&m, &w) in matches.iter().zip(weights) {
        sum += w * f64::from(m);
        all += w;
    }
    sum / all
}
