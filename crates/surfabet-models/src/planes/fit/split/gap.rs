//! Splits at a gap: a bin with far fewer points than the others.
//!
//! The paper compares the emptiest bin with two thirds of all points of the patch, which every bin falls below; here
//! it is two thirds of the mean of the inner bins, per length of the strip that the rectangle has there.

use super::SplitRule;
use super::bins::{Bins, Cut, DIRECTIONS, flat};
use crate::planes::constants::{BIN_STEPS, FULL_STRIP, GAP_DEVIATIONS, GAP_ROWS};
use crate::planes::fit::trim::trim;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Splits a patch along its emptiest bin over the rotations by 0, 45, 90 and 135 degrees, if that is empty enough.
pub(super) fn at_gap(points: &Points, patch: &Patch, rule: &SplitRule) -> Option<[Patch; 2]> {
    let local = flat(points, patch, &patch.support);
    let weights = weights(points, patch, &local);
    let steps = if points.line_spacing.is_some() { 1.0 } else { BIN_STEPS };
    let weights = weights.as_deref();
    let of = |&d: &[f64; 2]| emptiest(patch, &local, weights, d, [rule.threshold, steps]);
    let gaps = DIRECTIONS.iter().filter_map(of);
    let (_, cut) = gaps.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let sides = cut.sides(&patch.support, &local, rule.min_points)?;
    // A half without a supported tile would lose its points; the patch stays whole.
    let [left, right] = sides.map(|set| trim(points, patch.frame, &set, rule.merge.distance));
    Some([left?, right?])
}

/// By how much each point counts on scan lines, `None` for one each elsewhere: in tiles larger than G its share of the points of its
/// tile. Bins then count tiles with points: a line that falls between two bins is no gap.
fn weights(points: &Points, patch: &Patch, local: &[[f64; 2]]) -> Option<Vec<f64>> {
    points.line_spacing?;
    let tiles: Vec<Option<usize>> = local.iter().map(|&p| patch.tiles.tile_at(p)).collect();
    let mut counts = vec![0_u32; patch.tiles.supported().len()];
    tiles.iter().flatten().for_each(|&t| counts[t] += 1);
    Some(tiles.iter().map(|tile| tile.map_or(0.0, |t| f64::from(counts[t]).recip())).collect())
}

/// The emptiest bin across a direction, if it is empty enough: its points as a share of the mean, and the cut through
/// its middle. Bins start at every quarter of their width, so that a gap as wide as one is seen wherever it lies; on scan
/// lines, where bins hold whole tiles, at every width.
///
/// With `c_b` the weight of the points of bin `b`, `n_b` their number, and `l_b` the length of its strip as a share of the longest, over the inner bins with
/// `l_b >= 1/2`,
///
/// ```text
/// e_b = l_b (sum c / sum l)
/// min_b c_b / e_b < threshold   and   n_b < e_b - max(3 sqrt(e_b), 1.1 r_b)  with e_b of n instead of c
/// ```
///
/// and the points `r_b` of a row across the patch: of a regular grid some bins hold one row less than others.
fn emptiest(
    patch: &Patch,
    local: &[[f64; 2]],
    weights: Option<&[f64]>,
    direction: [f64; 2],
    [threshold, steps]: [f64; 2],
) -> Option<(f64, Cut)> {
    let bins = Bins::new(patch, direction)?;
    let parts = steps as usize;
    let mut counts = vec![0_u32; bins.n * parts];
    local.iter().for_each(|&p| counts[bins.part_of(p, parts)] += 1);
    let counts = before(counts.into_iter().map(f64::from));
    let weighed = weights.map(|weights| {
        let mut sums = vec![0.0; bins.n * parts];
        for (&p, weight) in local.iter().zip(weights) {
            sums[bins.part_of(p, parts)] += weight;
        }
        before(sums)
    });
    let weighed = weighed.as_ref().unwrap_or(&counts);
    let of = |sums: &[f64], first: usize| sums[first + parts] - sums[first];
    let inner: Vec<(usize, f64)> = (parts..=(bins.n - 2) * parts)
        .map(|first| (first, bins.share_at(first as f64 / steps)))
        .filter(|(_, s)| *s >= FULL_STRIP)
        .collect();
    let lengths: f64 = inner.iter().map(|(_, s)| s).sum();
    let mean = |sums: &[f64]| inner.iter().map(|&(b, _)| of(sums, b)).sum::<f64>() / lengths;
    let (mean, expected) = (mean(weighed), mean(&counts));
    let (first, ratio, expected) = inner
        .iter()
        .map(|&(b, s)| (b, of(weighed, b) / (mean * s), expected * s))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    // On scan lines bins hold whole tiles.
    let row = if weights.is_some() { 0.0 } else { expected * spacing(patch) / bins.width };
    let least = expected - (GAP_ROWS * row).max(GAP_DEVIATIONS * expected.sqrt());
    let chance = of(&counts, first) > least;
    if ratio.is_nan() || ratio >= threshold || chance {
        return None;
    }
    let at = bins.edge_at(first as f64 / steps + 0.5);
    Some((ratio, Cut { direction, at }))
}

/// Distance between the rows of points, as if they were a regular grid over the supported tiles, metres.
///
/// `n` points at the distance `s` reach `s / 2` over a rectangle of area `A` and half perimeter `P` to all sides:
/// `n s^2 = A + P s + s^2`.
fn spacing(patch: &Patch) -> f64 {
    let [x, y] = patch.tiles.size();
    let n = (patch.support.len() as f64 - 1.0).max(1.0);
    let half = 0.5 * (x + y) / n;
    half + (half * half + patch.tiles.area() / n).sqrt()
}

/// Sums before each of some values, and of all.
fn before(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let add = |sum: &mut f64, value: f64| {
        *sum += value;
        Some(*sum)
    };
    std::iter::once(0.0).chain(values.into_iter().scan(0.0, add)).collect()
}
