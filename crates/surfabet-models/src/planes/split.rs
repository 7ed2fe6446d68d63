//! Patch split: where a patch has too few points along a line across it, it becomes two (section II-C, figure 5).

use super::patch::Patch;
use super::points::Points;
use super::trim::trim;

/// Bins whose strip of the rectangle is shorter than this share of the longest are partial and do not count.
const FULL: f64 = 0.5;

/// Standard deviations by which a bin has to fall below the mean, so that chance does not split.
const SIGNIFICANCE: f64 = 3.0;

/// Deepest recursion: a patch becomes at most two to this power.
const DEPTH: u32 = 12;

/// Splits a patch, and what comes of it again, until all parts are evenly supported.
///
/// The paper compares the emptiest bin with two thirds of all points of the patch, which every bin falls below; here
/// it is two thirds of the mean of the inner bins, per length of the strip that the rectangle has there.
pub(super) fn split(points: &Points, patch: Patch, threshold: f64, grid_size: f64) -> Vec<Patch> {
    let mut parts = Vec::new();
    let mut stack = vec![(patch, DEPTH)];
    while let Some((patch, depth)) = stack.pop() {
        let halves = (depth > 0).then(|| halve(points, &patch, threshold, grid_size)).flatten();
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

/// Where to cut: along which direction, and at which coordinate of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cut {
    direction: [f64; 2],
    at: f64,
    /// Points in the bin as a share of the mean.
    share: f64,
}

fn halve(points: &Points, patch: &Patch, threshold: f64, grid_size: f64) -> Option<[Patch; 2]> {
    let local: Vec<[f64; 2]> = patch
        .support
        .iter()
        .map(|&i| {
            let [x, y, _] = patch.frame.local(points.positions[i as usize]);
            [x, y]
        })
        .collect();
    let cut = cut(patch, &local, threshold)?;
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for (&i, p) in patch.support.iter().zip(&local) {
        let side = if along(cut.direction, *p) < cut.at { &mut left } else { &mut right };
        side.push(i);
    }
    let [left, right] = [left, right].map(|set| trim(points, patch.frame, &set, grid_size));
    // A half without a supported tile would lose its points; the patch stays whole.
    Some([left?, right?])
}

fn along(direction: [f64; 2], p: [f64; 2]) -> f64 {
    direction[0] * p[0] + direction[1] * p[1]
}

/// The emptiest bin over the rotations by 0, 45, 90 and 135 degrees, if it is empty enough.
fn cut(patch: &Patch, local: &[[f64; 2]], threshold: f64) -> Option<Cut> {
    const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
    let directions = [[1.0, 0.0], [DIAGONAL, DIAGONAL], [0.0, 1.0], [-DIAGONAL, DIAGONAL]];
    directions.into_iter().filter_map(|d| emptiest(patch, local, d, threshold)).fold(
        None,
        |best: Option<Cut>, c| match best {
            Some(b) if b.share <= c.share => Some(b),
            _ => Some(c),
        },
    )
}

fn emptiest(patch: &Patch, local: &[[f64; 2]], direction: [f64; 2], threshold: f64) -> Option<Cut> {
    let tiles = &patch.tiles;
    let [low, size] = [tiles.low(), tiles.size()];
    let half = [0.5 * size[0] * direction[0].abs(), 0.5 * size[1] * direction[1].abs()];
    let middle = along(direction, std::array::from_fn(|a| low[a] + 0.5 * size[a]));
    let reach = half[0] + half[1];
    let n = (2.0 * reach / tiles.edge()).ceil().max(1.0) as usize;
    if n < 3 {
        return None;
    }
    let width = tiles.edge();
    let mut counts = vec![0_u32; n];
    for p in local {
        let bin = ((along(direction, *p) - middle + reach) / width).max(0.0) as usize;
        counts[bin.min(n - 1)] += 1;
    }
    // Length of the line across the rectangle in the middle of a bin, as a share of the longest.
    let flat = (half[0] - half[1]).abs();
    let share = |bin: usize| {
        let off = (width * (bin as f64 + 0.5) - reach).abs();
        if off <= flat { 1.0 } else { (reach - off) / (reach - flat) }
    };
    let inner: Vec<(usize, f64)> =
        (1..n - 1).map(|b| (b, share(b))).filter(|(_, s)| *s >= FULL).collect();
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
    let at = middle - reach + width * (bin as f64 + 0.5);
    Some(Cut { direction, at, share: ratio })
}
