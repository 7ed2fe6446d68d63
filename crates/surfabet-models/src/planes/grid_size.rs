//! The grid size G, which steers tiles, reach, splits and merges (section II-E).

use super::patch::Frame;
use super::points::Points;

/// Grid size per standard deviation of the distances.
const PER_DEVIATION: f64 = 3.0;

/// G = 3 std(d), where d are the distances of points from the planes that they support; not below `smallest`.
///
/// Distances have a sign, by the side of the plane, and their mean is zero. Without a sign, as one may also read the
/// paper, the standard deviation of what lies within reach G is below G/3 whatever the points do, so that G would
/// shrink to nothing.
pub(super) fn grid_size(
    points: &Points,
    planes: &[Option<Frame>],
    sets: &[Vec<u32>],
    smallest: f64,
) -> f64 {
    let mut squares = 0.0;
    let mut weight = 0.0;
    for (frame, set) in planes.iter().zip(sets) {
        let Some(frame) = frame else { continue };
        for &i in set {
            let w = f64::from(points.weights[i as usize]);
            let [_, _, z] = frame.local(points.positions[i as usize]);
            squares += w * z * z;
            weight += w;
        }
    }
    if weight > 0.0 { (PER_DEVIATION * (squares / weight).sqrt()).max(smallest) } else { smallest }
}
