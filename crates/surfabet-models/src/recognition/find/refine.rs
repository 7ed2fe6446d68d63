//! Motions improved on the samples of both surfaces.

use nalgebra::{Matrix4, Vector4};

use super::scene::{Motion, Place};
use super::score::share;
use super::template::{ALIKE, Template};

/// Samples of the example that motions are refined with, at first and to the end.
pub(super) const REFINED: [usize; 2] = [128, 512];

/// Shifts that are tried one after the other, as shares of the example's diagonal.
const SLIDES: [f64; 6] = [0.04, 0.04, 0.02, 0.02, 0.01, 0.005];

impl Template {
    /// Improves a motion on the first `n` samples: Gauss-Newton steps on the distances to the nearest samples of the
    /// scene, those farther than a reach that falls from the first to the second of `reach` left out.
    pub fn refined(
        &self,
        scene: &Place,
        start: Motion,
        n: usize,
        reach: [f64; 2],
        steps: usize,
    ) -> Motion {
        let n = self.points.len().min(n);
        let mut motion = start;
        for step in 0..steps {
            let at = step as f64 / (steps - 1).max(1) as f64;
            let limit = reach[0] * (reach[1] / reach[0]).powf(at);
            let (mut matrix, mut vector) = (Matrix4::zeros(), Vector4::zeros());
            let mut all = 0.0;
            for i in 0..n {
                let p = self.moved(&motion, i);
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
                if cosine.abs() < f64::from(ALIKE) {
                    continue;
                }
                let along: f64 = (0..3).map(|a| d[a] * normal[a]).sum();
                let weight = self.weights[i] / (1.0 + squared / (limit * limit));
                // The turn moves a point at right angles to its arm.
                let arm = motion.turned(self.points[i]);
                let turn = [-arm[1], arm[0], 0.0];
                let mut add = |direction: [f64; 3], residual: f64, weight: f64| {
                    let across = (0..3).map(|a| direction[a] * turn[a]).sum::<f64>();
                    let row = Vector4::new(direction[0], direction[1], direction[2], across);
                    matrix += weight * row * row.transpose();
                    vector -= weight * residual * row;
                };
                add(normal, along, weight);
                // Along the surface the nearest sample says little: a tenth.
                for a in 0..3 {
                    let mut axis = [0.0; 3];
                    axis[a] = 1.0;
                    add(axis, d[a] - along * normal[a], 0.1 * weight);
                }
                all += weight;
            }
            // Holds what no surface tells.
            let hold = 1e-3 * all + 1e-12;
            for k in 0..4 {
                matrix[(k, k)] += if k == 3 { hold * self.reach * self.reach } else { hold };
            }
            let Some(solver) = matrix.cholesky() else { break };
            let by = solver.solve(&vector);
            (0..3).for_each(|a| motion.shift[a] += by[a]);
            motion.yaw += by[3];
        }
        motion
    }

    /// A motion shifted to where more matches: surfaces hold nothing along themselves, colours do.
    pub fn slid(&self, scene: &Place, start: Motion) -> Motion {
        let worth = |motion: &Motion| {
            share(&self.matches(scene, motion, self.tolerance, REFINED[1]), &self.weights)
        };
        let mut best = (worth(&start), start);
        for step in SLIDES.map(|share| share * self.diagonal) {
            for axis in 0..3 {
                for by in [-step, step] {
                    let mut motion = best.1;
                    motion.shift[axis] += by;
                    let value = worth(&motion);
                    if value > best.0 {
                        best = (value, motion);
                    }
                }
            }
        }
        best.1
    }
}
