//! Motions improved by least squares on the samples of both surfaces.

use nalgebra::{Matrix6, Vector6};
use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_models::Result;

use super::motion::Motion;
use super::scene::SearchScene;
use super::score::matched_share;
use super::template::Template;
use crate::constants::{
    FINE_REACH, FINE_SAMPLES, FINE_STEPS, HOLD, NORMAL_COSINE, ROUGH_REACH, ROUGH_SAMPLES,
    ROUGH_STEPS, ROUGH_TOLERANCE, SIZE_HOLD, SLIDES, TANGENT_WEIGHT,
};

impl Template {
    /// All motions after a rough refinement, with the share of the example that matches.
    pub fn refine_roughly(
        &self,
        scene: &SearchScene,
        motions: &[Motion],
        progress: &dyn Progress,
    ) -> Result<Vec<(f64, Motion)>> {
        let (of_diagonal, of_tolerance) = ROUGH_REACH;
        let reach = [of_diagonal * self.diagonal, of_tolerance * self.tolerance];
        parallel::try_map(motions, |&motion| {
            progress.check()?;
            let motion = self.refined(scene, motion, ROUGH_SAMPLES, reach, ROUGH_STEPS);
            let tolerance = ROUGH_TOLERANCE * self.tolerance;
            let matches = self.matches(scene, &motion, tolerance, ROUGH_SAMPLES);
            Ok((matched_share(&matches, &self.weights), motion))
        })
    }

    /// All motions after a fine refinement.
    pub fn refine_finely(
        &self,
        scene: &SearchScene,
        motions: &[(f64, Motion)],
        progress: &dyn Progress,
    ) -> Result<Vec<Motion>> {
        let reach = FINE_REACH.map(|reach| reach * self.tolerance);
        parallel::try_map(motions, |&(_, motion)| {
            progress.check()?;
            let motion = self.refined(scene, motion, FINE_SAMPLES, reach, FINE_STEPS);
            Ok(match scene.color_tolerance {
                Some(_) => self.slid(scene, motion),
                None => motion,
            })
        })
    }

    /// A motion improved on the first `n` samples by Gauss-Newton steps. Samples farther from the scene than a reach are
    /// left out; it falls geometrically from the first to the second of `reach`.
    fn refined(
        &self,
        scene: &SearchScene,
        start: Motion,
        n: usize,
        reach: [f64; 2],
        steps: usize,
    ) -> Motion {
        let mut motion = start;
        for step in 0..steps {
            let at = step as f64 / (steps - 1).max(1) as f64;
            let limit = reach[0] * (reach[1] / reach[0]).powf(at);
            let Some(change) = self.gauss_newton_step(scene, &motion, n, limit) else { break };
            (0..3).for_each(|a| motion.shift[a] += change[a]);
            motion.yaw += change[3];
            let limit = self.size_tolerance;
            for k in 0..2 {
                motion.size[k] = (motion.size[k] + change[4 + k]).clamp(1.0 - limit, 1.0 + limit);
            }
        }
        motion
    }

    /// The change of shift, yaw and sizes that minimises, to first order, the sum over the first `n` samples p with nearest
    /// sample q and normal m of the scene
    ///
    /// ```text
    /// w ((m . (p - q))^2 + TANGENT_WEIGHT |the rest of p - q|^2),  w = weight / (1 + |p - q|^2 / limit^2)
    /// ```
    ///
    /// and for sizes `SIZE_HOLD (tolerance (size - 1) / size_tolerance)^2` times the sum of all w. `None` where the equations have no
    /// solution.
    fn gauss_newton_step(
        &self,
        scene: &SearchScene,
        motion: &Motion,
        n: usize,
        limit: f64,
    ) -> Option<Vector6<f64>> {
        let (mut matrix, mut vector) = (Matrix6::zeros(), Vector6::zeros());
        let mut all = 0.0;
        for i in 0..self.points.len().min(n) {
            let p = self.moved(motion, i);
            let Some(near) = scene.tree.nearest(p) else { continue };
            let normal = scene.surface.normals[near.index()].map(f64::from);
            let q = scene.surface.points[near.index()];
            let d: [f64; 3] = std::array::from_fn(|a| f64::from(p[a] - q[a]));
            let squared: f64 = d.iter().map(|c| c * c).sum();
            if squared > (limit + self.spacing).powi(2) {
                continue;
            }
            let turned = motion.turned(self.normals[i]);
            let cosine: f64 = (0..3).map(|a| turned[a] * normal[a]).sum();
            if cosine.abs() < f64::from(NORMAL_COSINE) {
                continue;
            }
            let along: f64 = (0..3).map(|a| d[a] * normal[a]).sum();
            let weight = self.weights[i] / (1.0 + squared / (limit * limit));
            // A turn moves a sample at right angles to its arm, a size along it.
            let arm = motion.arm(self.points[i]);
            let turn = [-arm[1], arm[0], 0.0];
            let mut add = |d: [f64; 3], residual: f64, weight: f64| {
                let across = d[0] * turn[0] + d[1] * turn[1];
                let level = (d[0] * arm[0] + d[1] * arm[1]) / motion.size[0];
                let upright = d[2] * arm[2] / motion.size[1];
                let row = Vector6::new(d[0], d[1], d[2], across, level, upright);
                matrix += weight * row * row.transpose();
                vector -= weight * residual * row;
            };
            add(normal, along, weight);
            for a in 0..3 {
                let mut axis = [0.0; 3];
                axis[a] = 1.0;
                add(axis, d[a] - along * normal[a], TANGENT_WEIGHT * weight);
            }
            all += weight;
        }
        let hold = HOLD * all + 1e-12;
        for k in 0..4 {
            matrix[(k, k)] += if k == 3 { hold * self.reach * self.reach } else { hold };
        }
        // Without a tolerance sizes stay.
        let by_size = self.tolerance / self.size_tolerance.max(1e-6);
        let size_hold = SIZE_HOLD * all * by_size * by_size + 1e-12;
        for k in 0..2 {
            matrix[(4 + k, 4 + k)] += size_hold;
            vector[4 + k] -= size_hold * (motion.size[k] - 1.0);
        }
        Some(matrix.cholesky()?.solve(&vector))
    }

    /// A motion shifted to where more of the example matches: surfaces do not fix a motion along themselves, nor how far they go, colours do.
    /// Sizes are those of the example where more of it matches so.
    fn slid(&self, scene: &SearchScene, start: Motion) -> Motion {
        let matched = |motion: &Motion| {
            let matches = self.matches(scene, motion, self.tolerance, FINE_SAMPLES);
            matched_share(&matches, &self.weights)
        };
        let as_large = Motion { size: [1.0; 2], ..start };
        let mut best = (matched(&start), start);
        let of_large = matched(&as_large);
        if of_large > best.0 {
            best = (of_large, as_large);
        }
        for step in SLIDES.map(|share| share * self.diagonal) {
            for axis in 0..3 {
                for by in [-step, step] {
                    let mut motion = best.1;
                    motion.shift[axis] += by;
                    let value = matched(&motion);
                    if value > best.0 {
                        best = (value, motion);
                    }
                }
            }
        }
        best.1
    }
}
