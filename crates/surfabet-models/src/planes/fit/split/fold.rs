//! Splits at a fold: a patch that is two planes.

use surfabet_geom::Moments;

use super::SplitRule;
use super::bins::{Bins, Cut, DIRECTIONS, flat};
use crate::planes::constants::{CLEAR_FOLD, FOLD_SIGMAS};
use crate::planes::fit::m_step::plane;
use crate::planes::fit::merge::PlanarSet;
use crate::planes::fit::trim::{mean_square, trim};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Splits a patch that is two planes: at the line for which two planes leave the least of its points' squared
/// distances, if this is less than half of those from one, or if the two parts would not be merged again. (The second
/// condition alone fails for a single patch over everything, whose G is too large.) The whole support counts, in each
/// part about the part's own plane.
pub(super) fn at_fold(points: &Points, patch: &Patch, rule: &SplitRule) -> Option<[Patch; 2]> {
    let own = mean_square(&patch.moments, &patch.frame);
    let factor = PlanarSet::of(patch).noise_factor(&patch.frame, rule.merge.incidence);
    if own <= (FOLD_SIGMAS * rule.noise * factor).powi(2) {
        return None;
    }
    let local = flat(points, patch, &patch.whole);
    let (cost, cut) = best_cut(points, patch, &local)?;
    let clear = cost < CLEAR_FOLD * own * patch.moments.weight();
    let sides = cut.sides(&patch.whole, &local, rule.min_points)?;
    let [left, right] = sides.map(|set| {
        let center = patch.frame.center;
        let frame = plane(&points.moments_about(center, set.iter().map(|&i| (i, 1.0))))?;
        trim(points, frame, &set, rule.merge.distance)
    });
    let (left, right) = (left?, right?);
    let apart = clear || PlanarSet::of(&left).joined(&PlanarSet::of(&right), &rule.merge).is_none();
    apart.then_some([left, right])
}

/// The cut between bins, over all directions, for which the sum of the squared distances of the points on either side
/// from their own plane is least, and this sum.
fn best_cut(points: &Points, patch: &Patch, local: &[[f64; 2]]) -> Option<(f64, Cut)> {
    let mut best: Option<(f64, Cut)> = None;
    for direction in DIRECTIONS {
        let bins = Bins::new(patch, direction)?;
        let mut members: Vec<Vec<(u32, f32)>> = vec![Vec::new(); bins.n];
        for (&i, &p) in patch.whole.iter().zip(local) {
            members[bins.of(p)].push((i, 1.0));
        }
        let moments: Vec<Moments> =
            members.into_iter().map(|m| points.moments_about(patch.frame.center, m)).collect();
        // Moments of all bins from b on.
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
    best
}

/// Sum of the squared distances of points from their own plane: the smallest eigenvalue of their scatter matrix.
fn residual(moments: &Moments) -> Option<f64> {
    let axes = moments.principal_axes()?;
    Some(axes.variances[0] * moments.weight())
}
