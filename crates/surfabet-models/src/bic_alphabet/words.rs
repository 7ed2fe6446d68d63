//! Words: all points within delta of a feature (eq. 1), in the feature's own frame, with its descriptor.

use surfabet_geom::KdTree;

use super::pose::Frame;
use crate::scans::Scene;

/// Position steps of a word's points per radius.
pub(super) const POINT_STEPS: f64 = 64.0;

/// Most points of a word.
pub const MAX_WORD_POINTS: usize = 1 << 16;

/// Metres per step of a word's points.
pub(super) fn point_step(radius: f64) -> f64 {
    radius / POINT_STEPS
}

/// A word of an alphabet, in the integers that a file stores.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BicWord {
    /// Right, up and along the normal, in steps of a 64th of the radius; ascending.
    pub points: Vec<[i8; 3]>,
    /// Height of the surface per pixel of the descriptor in steps of a 64th of the radius, row after row of the pixels
    /// within the circle; -128 where there is none.
    pub descriptor: Vec<i8>,
}

impl BicWord {
    /// Eq. 1: `s = { d in D : |d - p| < delta }`, the points of the scene within `radius` of a feature.
    pub(super) fn take(
        scene: &Scene,
        tree: &KdTree,
        frame: &Frame,
        descriptor: &[i8],
        radius: f64,
    ) -> Self {
        let mut near = Vec::new();
        tree.within(frame.origin, radius as f32, &mut near);
        let scale = (1.0 / point_step(radius)) as f32;
        // Rounding takes a coordinate to 64 steps at most, plus the rounding of the frame itself.
        let steps = |p: [f32; 3]| p.map(|c| (c * scale).round().clamp(-127.0, 127.0) as i8);
        let mut points: Vec<[i8; 3]> = near
            .iter()
            .filter(|n| f64::from(n.squared_distance()) < radius * radius)
            .map(|n| steps(frame.local(scene.positions[n.index()])))
            .collect();
        points.sort_unstable();
        Self { points, descriptor: descriptor.to_vec() }
    }

    /// Squared distance of a point from the word's middle, in squared steps.
    pub(super) fn squared_steps(&self, k: u16) -> u16 {
        // At most 3 * 128^2 = 49 152.
        self.points[usize::from(k)].iter().map(|&c| u16::from(c.unsigned_abs()).pow(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::bic_alphabet::pose::BicPose;
    use crate::scans::{Deviation, Upright};

    proptest! {
        #[test]
        fn a_word_is_all_points_within_the_radius(
            positions in prop::collection::vec(prop::array::uniform3(-0.2_f32..0.2), 1..200),
            normal in prop::array::uniform3(-1.0_f32..1.0),
        ) {
            let (cloud, _) = PointCloud::from_positions(positions);
            let scene = Scene::new(&cloud, Deviation::default(), 0.0, &Silent).unwrap();
            let tree = KdTree::new(&scene.positions).unwrap();
            let at = scene.positions[0];
            let pose = BicPose::quantize(at, normal, [0.0; 3], Upright::WorldX, 0.1).unwrap();
            let frame = pose.frame(Upright::WorldX, 0.1);
            let word = BicWord::take(&scene, &tree, &frame, &[], 0.1);
            let distance = |a: [f32; 3], b: [f32; 3]| {
                (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
            };
            let expected =
                scene.positions.iter().filter(|p| distance(**p, frame.origin) < 0.1).count();
            prop_assert_eq!(word.points.len(), expected);
            // Placed back, every point is where it was but for rounding.
            let step = point_step(0.1);
            for q in &word.points {
                let placed = frame.place(q.map(|c| (f64::from(c) * step) as f32));
                let nearest =
                    scene.positions.iter().map(|p| distance(*p, placed)).fold(f64::MAX, f64::min);
                prop_assert!(nearest <= 0.5 * step * 3.0_f64.sqrt() + 1e-6);
            }
        }
    }
}
