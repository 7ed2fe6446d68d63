//! The points about a pose, in the frame of the word.

use super::LatticeScene;
use crate::alphabet::constants::DESCRIPTOR_REACH;
use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::WordPose;
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, PIXELS};

/// A point of the scene in the frame of a word, units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct LocalPoint {
    pub right: f32,
    pub up: f32,
    pub height: f32,
    /// Deviation allowed at the point.
    pub sigma: f32,
    /// Number of the point in the scene.
    pub index: u32,
}

/// How far a point may lie from the middle of a pixel of a descriptor, per axis, for the pixel to be set.
pub(in crate::alphabet) fn descriptor_reach(pose: &WordPose) -> f32 {
    let pixel = 2.0 * pose.radius as f32 / PIXELS as f32;
    (0.5 * pixel).max(DESCRIPTOR_REACH * sigma(pose.level) as f32)
}

/// Puts those of the points `around` into `found` that some word with this pose may explain, or that its descriptor
/// counts.
pub(in crate::alphabet) fn local_points(
    scene: &LatticeScene,
    pose: &WordPose,
    around: &[u32],
    found: &mut Vec<LocalPoint>,
) {
    found.clear();
    let radius = pose.radius as f32;
    let highest = f32::from(MAX_HEIGHT) / HEIGHT_STEPS as f32 * radius;
    let center = pose.center.map(|c| c as f32);
    let [right, up, normal] = pose.rows.map(|r| r.map(|c| c as f32));
    let beside = descriptor_reach(pose);
    for &index in around {
        let p = scene.points[index as usize];
        let sigma = scene.sigma[index as usize];
        let d = [p[0] - center[0], p[1] - center[1], p[2] - center[2]];
        let along = |row: [f32; 3]| row[0] * d[0] + row[1] * d[1] + row[2] * d[2];
        let height = along(normal);
        if height.abs() > highest + sigma {
            continue;
        }
        let [right, up] = [along(right), along(up)];
        if right.abs().max(up.abs()) <= radius + sigma.max(beside) {
            found.push(LocalPoint { right, up, height, sigma, index });
        }
    }
}
