//! A motion brought to where surface lies on surface: point to plane, with an angle about the axis of turns.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix4, Vector4};

use super::keypoints::Keypoint;
use super::surface::SurfacePixels;
use super::votes::MotionCandidate;
use crate::patches::constants::{
    ALIGNED_KEYPOINTS, ALIGNED_PIXELS, ALIGNED_REACH, LEAST_ALIGNED, PAIRED, PULL,
};
use crate::patches::instances::{Motion, Place};

/// The place of a candidate where surface lies on surface; `None` where it does not.
pub(super) fn refined(
    surface: &SurfacePixels<'_>,
    keypoints: &[Keypoint],
    candidate: &MotionCandidate,
    axis: usize,
) -> Option<Place> {
    let points = points_about(surface, keypoints, &candidate.sources);
    let mirrored = candidate.turn & 4 != 0;
    let mut angle = (candidate.turn & 3) as f64 * FRAC_PI_2;
    let mut shift = candidate.shift.map(f64::from);
    let mut share = 0.0;
    for reach in PAIRED {
        let motion = Motion::new(Place::nearest(mirrored, angle, shift), axis as u8);
        let moved: Vec<[f32; 3]> = points.iter().map(|&p| motion.of_position(p)).collect();
        let (step, middle, paired) = step(surface, &moved, reach, axis)?;
        share = paired as f64 / moved.len() as f64;
        angle += step[3];
        shift = turned_about(shift, middle, step[3], axis);
        (0..3).for_each(|a| shift[a] += step[a]);
    }
    (share >= LEAST_ALIGNED).then(|| Place::nearest(mirrored, angle, shift))
}

/// Some pixels about keypoints, evenly over all of them.
fn points_about(surface: &SurfacePixels<'_>, keypoints: &[Keypoint], of: &[u32]) -> Vec<[f32; 3]> {
    let mut found = Vec::new();
    for &i in of.iter().step_by(of.len().div_ceil(ALIGNED_KEYPOINTS).max(1)) {
        found.extend(surface.pixels_about(keypoints[i as usize].position, ALIGNED_REACH));
    }
    found.sort_unstable();
    found.dedup();
    let step = found.len().div_ceil(ALIGNED_PIXELS).max(1);
    found.into_iter().step_by(step).map(|pixel| surface.middles[pixel as usize]).collect()
}

/// The step of least squared distances along normals: shift and angle, the middle that it turns about, and how many points
/// were paired. `None` where too few are.
fn step(
    surface: &SurfacePixels<'_>,
    moved: &[[f32; 3]],
    reach: f32,
    axis: usize,
) -> Option<(Vector4<f64>, [f64; 3], usize)> {
    let n = moved.len().max(1) as f64;
    let middle: [f64; 3] =
        std::array::from_fn(|a| moved.iter().map(|p| f64::from(p[a])).sum::<f64>() / n);
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let (mut left, mut right) = (Matrix4::zeros(), Vector4::zeros());
    let mut paired = 0;
    let mut spread = 0.0;
    for &p in moved {
        let Some((off, normal)) = surface.off_plane(p, reach) else { continue };
        paired += 1;
        let arm = [u, v].map(|a| f64::from(p[a]) - middle[a]);
        let n = normal.map(f64::from);
        let row = Vector4::new(n[0], n[1], n[2], n[v] * arm[0] - n[u] * arm[1]);
        spread += arm[0] * arm[0] + arm[1] * arm[1];
        left += row * row.transpose();
        right -= row * f64::from(off);
    }
    if paired < 20 {
        return None;
    }
    for a in 0..3 {
        left[(a, a)] += PULL;
    }
    left[(3, 3)] += PULL * spread / f64::from(paired) + 1e-6;
    Some((left.cholesky()?.solve(&right), middle, paired as usize))
}

/// A shift after a turn about a middle.
fn turned_about(shift: [f64; 3], middle: [f64; 3], angle: f64, axis: usize) -> [f64; 3] {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let (sin, cos) = angle.sin_cos();
    let from = [shift[u] - middle[u], shift[v] - middle[v]];
    let mut turned = shift;
    turned[u] = middle[u] + cos * from[0] - sin * from[1];
    turned[v] = middle[v] + sin * from[0] + cos * from[1];
    turned
}
