//! The grid size G, which steers tiles, reach, splits and merges (section II-E).

use super::m_step::Regression;
use super::trim::mean_square;

/// Grid size per standard deviation of the distances.
pub(super) const PER_DEVIATION: f64 = 3.0;

/// std(d), where d are the distances of points from their planes, metres: a third of G.
///
/// Distances have a sign, by the side of the plane, their mean is zero, and a point counts for every plane with its
/// probability. Without a sign, as one may also read the paper, the standard deviation of what lies within reach G is
/// below G/3 whatever the points do, so that G would shrink to nothing.
pub(super) fn deviation(planes: &[Option<Regression>]) -> f64 {
    let (mut squares, mut weight) = (0.0, 0.0);
    for plane in planes.iter().flatten() {
        let w = plane.moments.weight();
        squares += w * mean_square(&plane.moments, &plane.frame);
        weight += w;
    }
    if weight > 0.0 { (squares / weight).sqrt() } else { 0.0 }
}
