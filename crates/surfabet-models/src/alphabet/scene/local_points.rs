//! The points about a place where words may stand, in its own coordinates.

use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::Stand;
use crate::alphabet::scene::Data;
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, PIXELS};

/// A pixel of a look is set when a point lies within this share of sigma of its middle.
const LOOK_REACH: f32 = 0.7;

/// A point of the scene about a place, units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct NearPoint {
    pub right: f32,
    pub up: f32,
    pub height: f32,
    pub sigma: f32,
    pub index: u32,
}

/// How far a point may lie from a pixel's middle, per axis, for the pixel to be set.
pub(in crate::alphabet) fn look_reach(stand: &Stand) -> f32 {
    let pixel = 2.0 * stand.radius as f32 / PIXELS as f32;
    (0.5 * pixel).max(LOOK_REACH * sigma(stand.level) as f32)
}

/// Puts those of the points `around` into `found` that any word at `stand` can have to do with.
pub(in crate::alphabet) fn near(
    data: &Data,
    stand: &Stand,
    around: &[u32],
    found: &mut Vec<NearPoint>,
) {
    found.clear();
    let radius = stand.radius as f32;
    let highest = f32::from(MAX_HEIGHT) / HEIGHT_STEPS as f32 * radius;
    let center = stand.center.map(|c| c as f32);
    let [right, up, normal] = stand.rows.map(|r| r.map(|c| c as f32));
    let beside = look_reach(stand);
    for &index in around {
        let p = data.points[index as usize];
        let sigma = data.sigma[index as usize];
        let d = [p[0] - center[0], p[1] - center[1], p[2] - center[2]];
        let along = |row: [f32; 3]| row[0] * d[0] + row[1] * d[1] + row[2] * d[2];
        let height = along(normal);
        if height.abs() > highest + sigma {
            continue;
        }
        let [right, up] = [along(right), along(up)];
        if right.abs().max(up.abs()) <= radius + sigma.max(beside) {
            found.push(NearPoint { right, up, height, sigma, index });
        }
    }
}
