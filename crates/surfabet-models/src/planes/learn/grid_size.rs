//! The grid size, which steers tiles, reach, splits and merges: `G = 3 std(d)` (section II-E).

use super::m_step::Regression;
use super::trim::mean_square;

/// std(d), metres: `sqrt(sum_ij p_ij d_ij^2 / sum_ij p_ij)` over the distances `d_ij` of points from planes, a third of G.
///
/// Distances have a sign, by the side of the plane, so that their mean is zero. Without a sign, as one may also read the
/// paper, the standard deviation of what lies within reach G is below G/3 whatever the points do, and G would shrink to
/// nothing.
pub(super) fn deviation(planes: &[Option<Regression>]) -> f64 {
    let (mut squares, mut weight) = (0.0, 0.0);
    for plane in planes.iter().flatten() {
        let w = plane.moments.weight();
        squares += w * mean_square(&plane.moments, &plane.frame);
        weight += w;
    }
    if weight > 0.0 { (squares / weight).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::Moments;

    use super::super::m_step::plane;
    use super::*;

    /// Two planes of four points each, of weights one and two, all 0.1 and 0.3 from theirs.
    #[test]
    fn is_the_root_of_the_weighted_mean_square() {
        let regression = |height: f64, weight: f64| {
            let mut moments = Moments::new();
            for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let z = if x == y { height } else { -height };
                moments.add([3.0 * x, 3.0 * y, z], weight);
            }
            Some(Regression { frame: plane(&moments).unwrap(), moments })
        };
        let wanted = f64::sqrt((4.0 * 0.01 + 8.0 * 0.09) / 12.0);
        let found = deviation(&[regression(0.1, 1.0), None, regression(0.3, 2.0)]);
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        assert_eq!(deviation(&[None]), 0.0);
    }
}
