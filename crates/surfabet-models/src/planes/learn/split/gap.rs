//! Splits at a gap: a bin with far fewer points than the others.
//!
//! The paper compares the emptiest bin with two thirds of all points of the patch, which every bin falls below; here
//! it is two thirds of the mean of the inner bins, per length of the strip that the rectangle has there.

use super::SplitRule;
use super::bins::{Bins, Cut, DIRECTIONS, flat};
use crate::planes::constants::{FULL_STRIP, GAP_DEVIATIONS};
use crate::planes::learn::trim::trim;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Splits a patch along its emptiest bin over the rotations by 0, 45, 90 and 135 degrees, if that is empty enough.
pub(super) fn at_gap(points: &Points, patch: &Patch, rule: &SplitRule) -> Option<[Patch; 2]> {
    let local = flat(points, patch, &patch.support);
    let gaps = DIRECTIONS.iter().filter_map(|&d| emptiest(patch, &local, d, rule.threshold));
    let (_, cut) = gaps.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let sides = cut.sides(&patch.support, &local, rule.min_points)?;
    // A half without a supported tile would lose its points; the patch stays whole.
    let [left, right] = sides.map(|set| trim(points, patch.frame, &set, rule.merge.distance));
    Some([left?, right?])
}

/// The emptiest bin across a direction, if it is empty enough: its points as a share of the mean, and the cut through
/// its middle.
///
/// With `c_b` the points of bin `b` and `l_b` the length of its strip as a share of the longest, over the inner bins with
/// `l_b >= 1/2`,
///
/// ```text
/// e_b = l_b (sum c / sum l)
/// min_b c_b / e_b < threshold   and   c_b < e_b - 3 sqrt(e_b)
/// ```
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
        (1..n - 1).map(|b| (b, bins.share(b))).filter(|(_, s)| *s >= FULL_STRIP).collect();
    let total: f64 = inner.iter().map(|&(b, _)| f64::from(counts[b])).sum();
    let mean = total / inner.iter().map(|(_, s)| s).sum::<f64>();
    let (bin, ratio, expected) = inner
        .iter()
        .map(|&(b, s)| (b, f64::from(counts[b]) / (mean * s), mean * s))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let chance = f64::from(counts[bin]) > expected - GAP_DEVIATIONS * expected.sqrt();
    if ratio.is_nan() || ratio >= threshold || chance {
        return None;
    }
    let at = bins.edge(bin) + 0.5 * bins.width;
    Some((ratio, Cut { direction, at }))
}
