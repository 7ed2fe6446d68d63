//! How many rectangles: merges and folds by which the likelihood gains more than chance.

use surfabet_geom::{Moments, Progress};

use super::mixture::Mixture;
use super::rectangle::{PARAMETERS, Rectangle};
use crate::error::Result;
use crate::planes::constants::{
    EXCHANGE_SIGMAS, FIRST_STEPS, FLAT_SIGMAS, FOLD_ANGLE, FOLD_DIRECTIONS, FOLD_PLACES, FOLDS,
    HOPELESS, LEAST_EXCHANGE, MOST_FITTED, MOST_MOVES, MOVE_STEPS, THICK_SIGMAS,
};
use crate::planes::fit::m_step::plane;
use crate::planes::patch::Frame;
use crate::vector::{dot, minus};

/// The best mixture that merges and folds lead to, one at a time, each the one that gains the most; parts need
/// `min_points`. `None` where that is more rectangles than are fitted together: something bent gains by each fold, and no number
/// of them is right.
pub(super) fn search(
    points: &[[f64; 3]],
    start: Mixture,
    noise: f64,
    min_points: usize,
    progress: &dyn Progress,
) -> Result<Option<Mixture>> {
    let mut now = start;
    // Half the logarithm of the number of points for each parameter (BIC); a rectangle has its weight beside the others.
    let cost = 0.5 * (PARAMETERS as f64 + 1.0) * (points.len() as f64).ln();
    for _ in 0..MOST_MOVES {
        let mut best: Option<(f64, Mixture)> = None;
        for Move { more, mixture } in moves(points, &now, noise, min_points) {
            let price = if more == 0.0 { LEAST_EXCHANGE } else { more * cost };
            let gain = |m: &Mixture| m.log_likelihood - now.log_likelihood - price;
            let tried = mixture.climb(points, FIRST_STEPS, 1.0, progress)?;
            if gain(&tried) < -HOPELESS * points.len() as f64 {
                continue;
            }
            let tried = tried.climb(points, MOVE_STEPS, 1.0, progress)?;
            let gained = gain(&tried);
            if gained > best.as_ref().map_or(0.0, |b| b.0) && (more < 0.0 || is_folded(&tried)) {
                best = Some((gained, tried));
            }
        }
        let Some((_, better)) = best else { break };
        now = better;
        if now.rectangles.len() > MOST_FITTED {
            return Ok(None);
        }
    }
    Ok(Some(now))
}

/// A mixture to be tried.
struct Move {
    /// By how many rectangles it has more than now: -1, 0 or 1. From 0 on, the last two are the parts of a fold.
    more: f64,
    mixture: Mixture,
}

/// What may be better than `now`: a rectangle with few points left out, two in about one plane as one, one that is thicker
/// than the noise as two, two near each other folded elsewhere.
fn moves(points: &[[f64; 3]], now: &Mixture, noise: f64, min_points: usize) -> Vec<Move> {
    let members = now.members(points);
    let moments: Vec<Moments> = members.iter().map(|m| moments_of(points, m)).collect();
    let deviation = |m: &Moments| m.principal_axes().map_or(0.0, |axes| axes.variances[0].sqrt());
    let mut found = Vec::new();
    let n = now.rectangles.len();
    for a in 0..n {
        if n > 1 && members[a].len() < min_points {
            found.push(Move { more: -1.0, mixture: without(now, &[a], &[]) });
        }
        for b in a + 1..n {
            let mut both = moments[a];
            both.merge(&moments[b]);
            let thickness = deviation(&both) / now.sigma;
            if thickness > EXCHANGE_SIGMAS || !now.rectangles[a].is_near(&now.rectangles[b]) {
                continue;
            }
            let set: Vec<u32> = members[a].iter().chain(&members[b]).copied().collect();
            let Some(joined) = around(points, &both, set.iter().copied(), now.sigma) else {
                continue;
            };
            for parts in folds(points, &joined, &set, now.sigma, min_points) {
                found.push(Move { more: 0.0, mixture: without(now, &[a, b], &parts) });
            }
            if thickness <= FLAT_SIGMAS {
                found.push(Move { more: -1.0, mixture: without(now, &[a, b], &[joined]) });
            }
        }
        if deviation(&moments[a]) > THICK_SIGMAS * now.sigma.min(noise) {
            for parts in folds(points, &now.rectangles[a], &members[a], now.sigma, min_points) {
                found.push(Move { more: 1.0, mixture: without(now, &[a], &parts) });
            }
        }
    }
    found
}

/// The mixture with some rectangles left out and others added behind.
fn without(now: &Mixture, left_out: &[usize], added: &[Rectangle]) -> Mixture {
    let kept = (0..now.rectangles.len()).filter(|j| !left_out.contains(j));
    let rectangles = kept.map(|j| now.rectangles[j]).chain(added.iter().copied()).collect();
    Mixture::new(rectangles, now.sigma, now.anywhere)
}

/// True when the last two rectangles are not in planes that are nearly parallel.
fn is_folded(mixture: &Mixture) -> bool {
    let [.., a, b] = mixture.rectangles.as_slice() else { return false };
    dot(a.frame.normal, b.frame.normal).abs() < FOLD_ANGLE.cos()
}

/// The parts of a rectangle beside the folds that leave the least squared distances, the best first.
fn folds(
    points: &[[f64; 3]],
    rectangle: &Rectangle,
    members: &[u32],
    sigma: f64,
    min_points: usize,
) -> Vec<[Rectangle; 2]> {
    let mut found: Vec<(f64, [Rectangle; 2])> = Vec::new();
    for k in 0..FOLD_DIRECTIONS {
        let angle = k as f64 * std::f64::consts::PI / FOLD_DIRECTIONS as f64;
        let [c, s] = [angle.cos(), angle.sin()];
        let reach = rectangle.half[0] * c.abs() + rectangle.half[1] * s.abs();
        let along = |i: &u32| {
            let d = minus(points[*i as usize], rectangle.frame.center);
            c * dot(d, rectangle.frame.u) + s * dot(d, rectangle.frame.v)
        };
        let mut best: Option<(f64, f64)> = None;
        let mut bins = vec![Moments::new(); FOLD_PLACES];
        for i in members {
            let bin = (along(i) / reach + 1.0) * 0.5 * FOLD_PLACES as f64;
            bins[(bin.max(0.0) as usize).min(FOLD_PLACES - 1)].add(points[*i as usize], 1.0);
        }
        for place in 1..FOLD_PLACES {
            let sum = |bins: &[Moments]| {
                bins.iter().fold(Moments::new(), |mut sum, bin| {
                    sum.merge(bin);
                    sum
                })
            };
            let sides = [sum(&bins[..place]), sum(&bins[place..])];
            if sides.iter().any(|side| side.weight() < min_points as f64) {
                continue;
            }
            let residual = |m: &Moments| Some(m.principal_axes()?.variances[0] * m.weight());
            let (Some(a), Some(b)) = (residual(&sides[0]), residual(&sides[1])) else { continue };
            if best.is_none_or(|x| a + b < x.0) {
                best = Some((a + b, (2.0 * place as f64 / FOLD_PLACES as f64 - 1.0) * reach));
            }
        }
        let Some((cost, at)) = best else { continue };
        let (low, high): (Vec<u32>, Vec<u32>) = members.iter().partition(|&i| along(i) < at);
        let part =
            |set: &[u32]| around(points, &moments_of(points, set), set.iter().copied(), sigma);
        if let (Some(low), Some(high)) = (part(&low), part(&high)) {
            found.push((cost, [low, high]));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().take(FOLDS).map(|f| f.1).collect()
}

fn moments_of(points: &[[f64; 3]], set: &[u32]) -> Moments {
    let mut moments = Moments::new();
    set.iter().for_each(|&i| moments.add(points[i as usize], 1.0));
    moments
}

/// The rectangle in the plane of `moments` along the principal axes of the points in it. Its sides are those of an even
/// rectangle of the same variances.
pub(super) fn around(
    points: &[[f64; 3]],
    moments: &Moments,
    set: impl Iterator<Item = u32>,
    sigma: f64,
) -> Option<Rectangle> {
    let Frame { normal, .. } = plane(moments)?;
    let axes = moments.principal_axes()?;
    let u = axes.directions[2];
    let v = crate::vector::cross(normal, u);
    let center = moments.mean();
    let (mut squares, mut n) = ([0.0; 2], 0.0);
    for i in set {
        let d = minus(points[i as usize], center);
        squares[0] += dot(d, u).powi(2);
        squares[1] += dot(d, v).powi(2);
        n += 1.0;
    }
    // An even side of length 2 h has the variance h^2 / 3, and noise adds its own.
    let half = squares.map(|s: f64| (3.0 * (s / n - sigma * sigma)).max(sigma * sigma).sqrt());
    Some(Rectangle { frame: Frame { center, u, v, normal }, half })
}
