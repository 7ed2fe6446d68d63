//! Patch split: where a patch has too few points along a line across it, it becomes two (section II-C, figure 5).

use surfabet_geom::Moments;

use super::m_step::plane;
use super::merge::{Part, Rule};
use super::trim::{mean_square, trim};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Bins whose strip of the rectangle is shorter than this share of the longest are partial and do not count.
const FULL: f64 = 0.5;

/// Standard deviations by which a bin has to fall below the mean, so that chance does not split.
const SIGNIFICANCE: f64 = 3.0;

/// A patch this close to its plane, in standard deviations of the noise, is not looked at for folds.
const FLAT: f64 = 1.1;

/// Share of the squared distances that two planes leave across a clear fold, at most.
const CLEAR_FOLD: f64 = 0.5;

/// Deepest recursion: a patch becomes at most two to this power.
const DEPTH: u32 = 12;

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

/// Splits a patch, and what comes of it again, until all parts are evenly supported.
///
/// The paper compares the emptiest bin with two thirds of all points of the patch, which every bin falls below; here
/// it is two thirds of the mean of the inner bins, per length of the strip that the rectangle has there.
pub(super) fn split(points: &Points, patch: Patch, rule: &SplitRule) -> Vec<Patch> {
    let mut parts = Vec::new();
    let mut stack = vec![(patch, DEPTH)];
    while let Some((patch, depth)) = stack.pop() {
        let halves = (depth > 0)
            .then(|| halve(points, &patch, rule).or_else(|| fold(points, &patch, rule)))
            .flatten();
        match halves {
            // The first half is looked at first, so that parts stay in a fixed order.
            Some([first, second]) => {
                stack.extend([second, first].map(|half| (half, depth - 1)));
            }
            None => parts.push(patch),
        }
    }
    parts
}

const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Rotations by 0, 45, 90 and 135 degrees.
const DIRECTIONS: [[f64; 2]; 4] =
    [[1.0, 0.0], [DIAGONAL, DIAGONAL], [0.0, 1.0], [-DIAGONAL, DIAGONAL]];

/// Strips across the rectangle of a patch, as wide as a tile.
struct Bins {
    direction: [f64; 2],
    low: f64,
    width: f64,
    n: usize,
    /// Half the length along the direction, and of the part over which strips have their full length.
    reach: f64,
    flat: f64,
}

impl Bins {
    /// `None` for fewer than three.
    fn new(patch: &Patch, direction: [f64; 2]) -> Option<Self> {
        let tiles = &patch.tiles;
        let [low, size] = [tiles.low(), tiles.size()];
        let half = [0.5 * size[0] * direction[0].abs(), 0.5 * size[1] * direction[1].abs()];
        let middle = along(direction, std::array::from_fn(|a| low[a] + 0.5 * size[a]));
        let reach = half[0] + half[1];
        let width = tiles.edge();
        let n = (2.0 * reach / width).ceil().max(1.0) as usize;
        let flat = (half[0] - half[1]).abs();
        (n >= 3).then_some(Self { direction, low: middle - reach, width, n, reach, flat })
    }

    fn of(&self, p: [f64; 2]) -> usize {
        let bin = ((along(self.direction, p) - self.low) / self.width).max(0.0) as usize;
        bin.min(self.n - 1)
    }

    /// Where a bin starts.
    fn edge(&self, bin: usize) -> f64 {
        self.low + self.width * bin as f64
    }

    /// Length of the line across the rectangle in the middle of a bin, as a share of the longest.
    fn share(&self, bin: usize) -> f64 {
        let off = (self.width * (bin as f64 + 0.5) - self.reach).abs();
        if off <= self.flat { 1.0 } else { (self.reach - off) / (self.reach - self.flat) }
    }
}

/// Where to cut: along which direction, and at which coordinate of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cut {
    direction: [f64; 2],
    at: f64,
}

impl Cut {
    /// The points on either side, `None` where one of both has fewer than `least`.
    fn sides(self, set: &[u32], local: &[[f64; 2]], least: usize) -> Option<[Vec<u32>; 2]> {
        let mut sides = [Vec::new(), Vec::new()];
        for (&i, p) in set.iter().zip(local) {
            sides[usize::from(along(self.direction, *p) >= self.at)].push(i);
        }
        sides.iter().all(|side| side.len() >= least).then_some(sides)
    }
}

/// Splits a patch along its emptiest bin over the rotations by 0, 45, 90 and 135 degrees, if that is empty enough.
fn halve(points: &Points, patch: &Patch, rule: &SplitRule) -> Option<[Patch; 2]> {
    let local = flat(points, patch, &patch.support);
    let gaps = DIRECTIONS.iter().filter_map(|&d| emptiest(patch, &local, d, rule.threshold));
    let (_, cut) = gaps.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let sides = cut.sides(&patch.support, &local, rule.min_points)?;
    // A half without a supported tile would lose its points; the patch stays whole.
    let [left, right] = sides.map(|set| trim(points, patch.frame, &set, rule.merge.distance));
    Some([left?, right?])
}

/// Coordinates of points in the plane of a patch.
fn flat(points: &Points, patch: &Patch, set: &[u32]) -> Vec<[f64; 2]> {
    let local = |i: u32| patch.frame.local(points.positions[i as usize]);
    set.iter().map(|&i| local(i)).map(|[x, y, _]| [x, y]).collect()
}

/// Splits a patch that is two planes: along the line for which two planes leave the least of its points' squared
/// distances, if this is less than half of those from one, or if the two parts would not be merged again. (Of a
/// single patch over everything G itself is too large to tell.) Its whole support counts, in each part about the
/// part's own plane.
fn fold(points: &Points, patch: &Patch, rule: &SplitRule) -> Option<[Patch; 2]> {
    let own = mean_square(&patch.moments, &patch.frame);
    if own <= (FLAT * rule.noise).powi(2) {
        return None;
    }
    let local = flat(points, patch, &patch.whole);
    let mut best: Option<(f64, Cut)> = None;
    for direction in DIRECTIONS {
        let bins = Bins::new(patch, direction)?;
        let mut members: Vec<Vec<(u32, f32)>> = vec![Vec::new(); bins.n];
        for (&i, &p) in patch.whole.iter().zip(&local) {
            members[bins.of(p)].push((i, 1.0));
        }
        let moments: Vec<Moments> =
            members.into_iter().map(|m| points.moments_about(patch.frame.center, m)).collect();
        let mut after = vec![Moments::new(); bins.n + 1];
        for b in (0..bins.n).rev() {
            after[b] = after[b + 1];
            after[b].merge(&moments[b]);
        }
        let mut before = Moments::new();
        for b in 1..bins.n {
            before.merge(&moments[b - 1]);
            let (Some(left), Some(right)) = (residual(&before), residual(&after[b])) else {
                continue;
            };
            let cost = left + right;
            if best.is_none_or(|x| cost < x.0) {
                best = Some((cost, Cut { direction, at: bins.edge(b) }));
            }
        }
    }
    let (cost, cut) = best?;
    let clear = cost < CLEAR_FOLD * own * patch.moments.weight();
    let sides = cut.sides(&patch.whole, &local, rule.min_points)?;
    let [left, right] = sides.map(|set| {
        let center = patch.frame.center;
        let frame = plane(&points.moments_about(center, set.iter().map(|&i| (i, 1.0))))?;
        trim(points, frame, &set, rule.merge.distance)
    });
    let (left, right) = (left?, right?);
    let apart = clear || Part::of(&left).joined(&Part::of(&right), &rule.merge).is_none();
    apart.then_some([left, right])
}

/// Sum of squared distances of points from their own plane.
fn residual(moments: &Moments) -> Option<f64> {
    let axes = moments.principal_axes()?;
    Some(axes.variances[0] * moments.weight())
}

fn along(direction: [f64; 2], p: [f64; 2]) -> f64 {
    direction[0] * p[0] + direction[1] * p[1]
}

/// The emptiest bin across a direction, if it is empty enough: its points as a share of the mean, and the cut through
/// its middle.
fn emptiest(
    patch: &Patch,
    local: &[[f64; 2]],
    direction: [f64; 2],
    threshold: f64,
) -> Option<(f64, Cut)> {
    let bins = Bins::new(patch, direction)?;
    let n = bins.n;
    let mut counts = vec![0_u32; n];
    for &p in local {
        counts[bins.of(p)] += 1;
    }
    let inner: Vec<(usize, f64)> =
        (1..n - 1).map(|b| (b, bins.share(b))).filter(|(_, s)| *s >= FULL).collect();
    let total: f64 = inner.iter().map(|&(b, _)| f64::from(counts[b])).sum();
    let mean = total / inner.iter().map(|(_, s)| s).sum::<f64>();
    let (bin, ratio, expected) = inner
        .iter()
        .map(|&(b, s)| (b, f64::from(counts[b]) / (mean * s), mean * s))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let chance = f64::from(counts[bin]) > expected - SIGNIFICANCE * expected.sqrt();
    if ratio.is_nan() || ratio >= threshold || chance {
        return None;
    }
    let at = bins.edge(bin) + 0.5 * bins.width;
    Some((ratio, Cut { direction, at }))
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::PointCloud;

    use super::*;

    const RULE: SplitRule = SplitRule {
        threshold: 2.0 / 3.0,
        min_points: 30,
        noise: 0.01,
        merge: Rule { distance: 0.1, deviation: 0.03, tolerance: 1.25 },
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
