//! Patch split: where a patch has too few points along a line across it, it becomes two (section II-C, figure 5).

mod bins;
mod fold;
mod gap;

pub(super) use self::bins::{Bins, Cut, DIRECTIONS, flat};
use self::fold::at_fold;
use self::gap::at_gap;
use super::merge::Rule;
use crate::planes::constants::SPLIT_DEPTH;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// When a patch becomes two.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitRule {
    /// Share of the mean of the inner bins below which a bin is a gap.
    pub threshold: f64,
    /// Points that each part needs.
    pub min_points: usize,
    /// Standard deviation of the noise, as far as it is known beforehand, metres.
    pub noise: f64,
    /// When the parts beside a fold would become one again.
    pub merge: Rule,
}

/// Splits a patch recursively until all parts are evenly supported and none is folded.
pub(super) fn split(points: &Points, patch: Patch, rule: &SplitRule) -> Vec<Patch> {
    let mut parts = Vec::new();
    let mut stack = vec![(patch, SPLIT_DEPTH)];
    while let Some((patch, depth)) = stack.pop() {
        let halves = (depth > 0)
            .then(|| at_gap(points, &patch, rule).or_else(|| at_fold(points, &patch, rule)))
            .flatten();
        match halves {
            // The first half is split first, so that parts stay in a fixed order.
            Some([first, second]) => {
                stack.extend([second, first].map(|half| (half, depth - 1)));
            }
            None => parts.push(patch),
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::PointCloud;

    use super::*;
    use crate::planes::fit::incidence::Incidence;
    use crate::planes::fit::m_step::plane;
    use crate::planes::fit::trim::trim;

    const RULE: SplitRule = SplitRule {
        threshold: 2.0 / 3.0,
        min_points: 30,
        noise: 0.01,
        merge: Rule { distance: 0.1, deviation: 0.03, incidence: Incidence::EVEN, tolerance: 1.25 },
    };

    /// Points over 2 m x 1 m at heights that depend on their place, where `keep` says so, as one patch.
    fn patch(keep: impl Fn(f64, f64) -> bool, height: impl Fn(f64) -> f64) -> (Points, Patch) {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut positions = Vec::new();
        while positions.len() < 8000 {
            let [x, y]: [f64; 2] = [rng.random_range(0.0..2.0), rng.random_range(0.0..1.0)];
            if keep(x, y) {
                positions.push([x as f32, y as f32, height(x) as f32]);
            }
        }
        let points = Points::new(&PointCloud::from_positions(positions).0, None).unwrap();
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let frame = plane(&points.moments(0..points.len())).unwrap();
        let patch = trim(&points, frame, &all, RULE.merge.distance).unwrap();
        (points, patch)
    }

    fn parts(keep: impl Fn(f64, f64) -> bool, height: impl Fn(f64) -> f64) -> Vec<usize> {
        let (points, patch) = patch(keep, height);
        let parts = split(&points, patch, &RULE);
        let mut sizes: Vec<usize> = parts.iter().map(|p| p.whole.len()).collect();
        sizes.sort_unstable();
        sizes
    }

    #[test]
    fn even_support_is_not_split() {
        assert_eq!(parts(|_, _| true, |_| 0.0), [8000]);
    }

    #[test]
    fn a_gap_splits() {
        let sizes = parts(|x, _| !(0.9..1.1).contains(&x), |_| 0.0);
        assert_eq!(sizes.len(), 2);
        assert!(sizes[0] > 3500);
    }

    /// Of both bins that it touches seven tenths are left.
    #[test]
    fn a_gap_between_two_bins_splits() {
        let sizes = parts(|x, _| !(0.97..1.03).contains(&x), |_| 0.0);
        assert_eq!(sizes.len(), 2);
        assert!(sizes[0] > 3700);
    }

    #[test]
    fn a_gap_on_the_diagonal_splits() {
        let sizes = parts(|x, y| !(1.4..1.7).contains(&(x + y)), |_| 0.0);
        assert_eq!(sizes.len(), 2);
        assert!(sizes[0] > 3000);
    }

    #[test]
    fn a_fold_splits_where_it_is() {
        let sizes = parts(|_, _| true, |x| 0.15 * (x - 1.2_f64).abs());
        assert_eq!(sizes.len(), 2);
        // Four tenths of the points are beyond the fold, to a bin of 0.1 m.
        assert!((2700..3700).contains(&sizes[0]), "{sizes:?}");
    }
}
