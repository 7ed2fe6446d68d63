//! How like the example a place is: the share of either that the other explains.

use surfabet_geom::Neighbor;

use super::scene::{Motion, Place};
use super::template::Template;

/// Samples of the example that places are scored with.
pub(super) const MATCHED: usize = 4096;

/// What the rarest sample is taken to be met by chance with.
const RAREST: f64 = 0.05;

impl Template {
    /// How much each sample tells: the logarithm of how seldom it is met, among motions that are mostly wrong.
    pub fn rarity(&self, motions: &[(Motion, Vec<f32>)]) -> Vec<f64> {
        let n = motions.len() as f64 + 1.0;
        let met = |i: usize| motions.iter().map(|(_, m)| f64::from(m[i])).sum::<f64>();
        // Half a motion that meets nothing: what is always met still counts a little.
        let tells = |i| -((met(i) + 0.5) / n).clamp(RAREST, 1.0 - 0.5 / n).ln();
        let n_samples = self.points.len().min(MATCHED);
        (0..n_samples).map(|i| self.weights[i] * tells(i)).collect()
    }

    /// The share of what the scene has in the region there, by weight, that the example explains.
    fn explained(&self, scene: &Place, motion: &Motion, tolerance: f64) -> f64 {
        let center: [f32; 3] = std::array::from_fn(|a| (self.pivot[a] + motion.shift[a]) as f32);
        let mut near: Vec<Neighbor> = Vec::new();
        scene.tree.within(center, self.reach as f32, &mut near);
        let back = Motion { yaw: -motion.yaw, shift: [0.0; 3] };
        let place = |i: u32| {
            let p = scene.surface.points[i as usize];
            let d = std::array::from_fn(|a| p[a] - center[a]);
            back.turned(d)
        };
        let mut there: Vec<u32> = near.iter().map(|n| n.index() as u32).collect();
        there.retain(|&i| {
            let p = place(i);
            self.region.contains(std::array::from_fn(|a| p[a] + self.pivot[a]))
        });
        let weights = scene.shares(&there);
        let (mut sum, mut all) = (0.0, 0.0);
        for (&i, weight) in there.iter().zip(weights) {
            all += weight;
            let p = place(i).map(|c| c as f32);
            let Some(near) = self.tree.nearest(p) else { continue };
            let q = self.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let turned = back.turned(scene.surface.normals[i as usize]).map(|c| c as f32);
            let like = self.alike(scene, near.index(), i as usize);
            sum += weight * like * self.nearness(d, self.normals[near.index()], turned, tolerance);
        }
        sum / all.max(f64::MIN_POSITIVE)
    }

    pub fn score(&self, scene: &Place, motion: &Motion, matches: &[f32], rarity: &[f64]) -> f64 {
        let found = share(matches, rarity);
        let explained = self.explained(scene, motion, self.tolerance);
        (found * explained).sqrt()
    }
}

/// The share of `weights` that matches.
pub(super) fn share(matches: &[f32], weights: &[f64]) -> f64 {
    let (mut sum, mut all) = (0.0, f64::MIN_POSITIVE);
    for (&m, &w) in matches.iter().zip(weights) {
        sum += w * f64::from(m);
        all += w;
    }
    sum / all
}
