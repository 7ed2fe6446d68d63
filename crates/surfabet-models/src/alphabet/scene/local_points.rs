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
/// `floor` are calls, which took a twentieth of learning; casts to unsigned numbers of 64 bits take branches.
pub(in crate::alphabet) fn whole_numbers(first: f32, last: f32, n: usize) -> Range<usize> {
    // Casts round towards zero.
    let [from, to] = [first, last].map(|c| c.clamp(0.0, n as f32));
    let below = from as i32;
    let start = below + i32::from((below as f32) < from);
    let end = if last < 0.0 { 0 } else { (to as i32 + 1).min(n as i32) };
    start as usize..end as usize
}

/// Points that are turned into the frame of a word at a time.
const LANES: usize = 8;

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
    for indices in around.chunks(LANES) {
        // Column by column, so that the points of a chunk are computed with at a time.
        let mut d = [[0.0_f32; LANES]; 3];
        let mut sigmas = [0.0_f32; LANES];
        for (lane, &index) in indices.iter().enumerate() {
            let p = scene.points[index as usize];
            (0..3).for_each(|a| d[a][lane] = p[a] - center[a]);
            sigmas[lane] = scene.sigma[index as usize];
        }
        let [rights, ups, heights] = [right, up, normal].map(|row| -> [f32; LANES] {
            std::array::from_fn(|k| row[0] * d[0][k] + row[1] * d[1][k] + row[2] * d[2][k])
        });
        let is_near: [bool; LANES] = std::array::from_fn(|k| {
            let beside = radius + sigmas[k].max(beside);
            (heights[k].abs() <= highest + sigmas[k])
                & (rights[k].abs() <= beside)
                & (ups[k].abs() <= beside)
        });
        for (k, &index) in indices.iter().enumerate().filter(|(k, _)| is_near[*k]) {
            let weight = scene.weights[index as usize];
            let [right, up, height, sigma] = [rights[k], ups[k], heights[k], sigmas[k]];
            found.push(LocalPoint { right, up, height, sigma, index, weight });
        }
    }
}
