//! Splits as printed (section II-C), at the emptiest bin.

use super::trim::trim;
use crate::planes::constants::SPLIT_DEPTH;
use crate::planes::fit::split::{Bins, Cut, DIRECTIONS, flat};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Points that span a plane.
const LEAST_POINTS: usize = 3;

/// Splits a patch recursively until the support of all parts is homogeneous.
pub(super) fn split(points: &Points, patch: Patch, threshold: f64, grid_size: f64) -> Vec<Patch> {
    let mut parts = Vec::new();
    let mut stack = vec![(patch, SPLIT_DEPTH)];
    while let Some((patch, depth)) = stack.pop() {
        let halves = (depth > 0).then(|| halves(points, &patch, threshold, grid_size)).flatten();
        match halves {
            Some([first, second]) => stack.extend([(second, depth - 1), (first, depth - 1)]),
            None => parts.push(patch),
        }
    }
    parts
}

/// The parts of a patch on both sides of its emptiest bin, over all rotations, if `min_p` is below two thirds of the mean
/// of the bins. (Below two thirds of the number of all points, as printed, every bin is.) The first and the last bin are
/// partial and do not count, nor do those of the diagonals whose strip of the rectangle is short.
fn halves(points: &Points, patch: &Patch, threshold: f64, grid_size: f64) -> Option<[Patch; 2]> {
    let local = flat(points, patch, &patch.support);
    let mut best: Option<(f64, Cut)> = None;
    for direction in DIRECTIONS {
        let Some(bins) = Bins::new(patch, direction) else { continue };
        let mut counts = vec![0.0; bins.n];
        local.iter().for_each(|&p| counts[bins.of(p)] += 1.0);
        let inner: Vec<usize> = (1..bins.n - 1).filter(|&b| bins.share(b) >= 1.0).collect();
        let mean = inner.iter().map(|&b| counts[b]).sum::<f64>() / inner.len() as f64;
        for b in inner {
            let ratio = counts[b] / mean;
            if ratio < best.map_or(threshold, |x| x.0) {
                let at = bins.edge(b) + 0.5 * bins.width;
                best = Some((ratio, Cut { direction, at }));
            }
        }
    }
    let sides = best?.1.sides(&patch.support, &local, LEAST_POINTS)?;
    let [left, right] = sides.map(|set| trim(points, patch.frame, &set, grid_size));
    Some([left?, right?])
}
