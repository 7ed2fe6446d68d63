//! The points about a pose, in the frame of the word.

use std::ops::Range;

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
    /// How many points of the scan it counts for.
    pub weight: u16,
}

/// How far a point may lie from the middle of a pixel of a descriptor, per axis, for the pixel to be set.
pub(in crate::alphabet) fn descriptor_reach(pose: &WordPose) -> f32 {
    let pixel = 2.0 * pose.radius as f32 / PIXELS as f32;
    (0.5 * pixel).max(DESCRIPTOR_REACH * sigma(pose.level) as f32)
}

/// The whole numbers from `first` to `last`, both included, that are below `n`. Without SSE 4.1, as on any x86-64, `ceil` and
/// `floor` are calls, which took a twentieth of learning.
pub(in crate::alphabet) fn whole_numbers(first: f32, last: f32, n: usize) -> Range<usize> {
    // Casts round towards zero, and what is below zero to zero.
    let below = first as usize;
    let start = if (below as f32) < first { below + 1 } else { below };
    start..if last < 0.0 { 0 } else { (last as usize).saturating_add(1).min(n) }
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
            let weight = scene.weights[index as usize];
            found.push(LocalPoint { right, up, height, sigma, index, weight });
        }
    }
}
