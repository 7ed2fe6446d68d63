//! E-step: the probability that each point belongs to each patch (section II-A).
//!
//! With `d_ij` the distance of point `i` to the closest supported tile of patch `j`,
//!
//! ```text
//! p_ij ~ w_j / f_j exp(-d_ij^2 / (2 f_j^2 S^2)),   sum_j p_ij = 1      (eq. 1)
//! S = G / sqrt(-2 ln W)                                                (eq. 2)
//! ```
//!
//! `f_j` is the factor of the noise at the angle at which the patch was seen ([`Incidence`](super::incidence::Incidence)), one where that is
//! unknown and in the paper.
//!
//! The mixing weight `w_j`, the number of points per area of patch `j`, is not in the paper: it weighs patches alike. Without
//! it a patch right through a noisy wall lives on the points that happen to lie far from the wall; it has few points for
//! its area, and so it loses them.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::grouped::Grouped;
use super::responsibilities::{CHUNK, Chunk, Responsibilities, in_chunks};
use crate::error::Result;
use crate::planes::patch::{Patch, Reach};
use crate::planes::points::Points;

/// Stands for no patch.
pub(in crate::planes) const NONE: u32 = u32::MAX;

/// S = G / sqrt(-2 ln W), metres (eq. 2): the standard deviation that gives a point at distance `grid_size` (G) the
/// weight W.
pub fn weight_scale(grid_size: f64, weight_at_grid_size: f64) -> f64 {
    grid_size / (-2.0 * weight_at_grid_size.ln()).sqrt()
}

/// Probabilities of all points for the patches within reach, which is the grid size G, or f_j G where that is more; `s` is S
/// and `factors` are f_j, none for one.
///
/// # Errors
/// [`crate::Error::Cancelled`] when the caller asks to stop.
pub fn e_step(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    s: f64,
    factors: Option<&[f64]>,
    progress: &dyn Progress,
) -> Result<Responsibilities> {
    let mixture = Mixture::new(patches, grid_size, s, factors);
    let near = mixture.candidates(points);
    let chunks = in_chunks(points, progress, |b, costs, chunk| {
        points.block(b).for_each(|i| mixture.weigh(points, i, near.of(b), costs, chunk));
    })?;
    Ok(Responsibilities::new(patches.len(), chunks))
}

/// For each distinct point the patch with the largest probability, by [`e_step`], or [`NONE`].
pub(in crate::planes) fn supports(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    s: f64,
    factors: Option<&[f64]>,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let mixture = Mixture::new(patches, grid_size, s, factors);
    let near = mixture.candidates(points);
    let n_blocks = points.n_blocks();
    let of_chunks = parallel::try_map_range(n_blocks.div_ceil(CHUNK), |c| -> Result<Vec<u32>> {
        progress.check()?;
        let blocks = c * CHUNK..((c + 1) * CHUNK).min(n_blocks);
        let of_block = |b| points.block(b).map(move |i| (b, i));
        let all = blocks.flat_map(of_block);
        Ok(all.map(|(b, i)| mixture.support(points, i, near.of(b))).collect())
    })?;
    Ok(of_chunks.concat())
}

/// As [`supports`], by [`e_step_everywhere`].
pub(in crate::planes) fn supports_everywhere(
    points: &Points,
    patches: &[Patch],
    s: f64,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let chunks = weighed_everywhere(points, patches, s, progress)?;
    let supports: Vec<&[u32]> = chunks.iter().map(|chunk| &chunk.supports[..]).collect();
    Ok(supports.concat())
}

/// Probabilities of all points for all patches, however far, and no mixing weights: eq. 1 as printed; `s` is S. Those that
/// are zero in double precision are left out.
///
/// # Errors
/// [`crate::Error::Cancelled`] when the caller asks to stop.
pub(super) fn e_step_everywhere(
    points: &Points,
    patches: &[Patch],
    s: f64,
    progress: &dyn Progress,
) -> Result<Responsibilities> {
    let chunks = weighed_everywhere(points, patches, s, progress)?;
    Ok(Responsibilities::new(patches.len(), chunks))
}

/// [`e_step_everywhere`] by point.
fn weighed_everywhere(
    points: &Points,
    patches: &[Patch],
    s: f64,
    progress: &dyn Progress,
) -> Result<Vec<Chunk>> {
    in_chunks(points, progress, |b, costs, chunk| {
        let positions = &points.positions[points.block(b)];
        positions.iter().for_each(|&p| weigh_all(p, patches, s, costs, chunk));
    })
}

/// p_ij of a point for all patches, and the closest.
fn weigh_all(p: [f32; 3], patches: &[Patch], s: f64, costs: &mut Costs, to: &mut Chunk) {
    // The rectangle of a patch is never further than its supported tiles.
    let mut order: Vec<(f64, u32)> = (0..).zip(patches).map(|(j, q)| (q.least(p), j)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Beyond this above the least squared distance, exp(-d^2 / 2 S^2) is below the rounding of a sum of one.
    let margin = 2.0 * s * s * -f64::EPSILON.ln();
    let mut closest = (f64::INFINITY, NONE);
    costs.clear();
    for (least, j) in order {
        if least > closest.0 + margin {
            break;
        }
        let reach = if closest.1 == NONE { f64::INFINITY } else { (closest.0 + margin).sqrt() };
        let Some(squared) = patches[j as usize].squared_distance(p, reach) else { continue };
        costs.push((j, squared));
        if squared < closest.0 {
            closest = (squared, j);
        }
    }
    let weight = |squared: f64| ((closest.0 - squared) / (2.0 * s * s)).exp();
    let sum: f64 = costs.iter().map(|c| weight(c.1)).sum();
    let share = |&(j, squared): &(u32, f64)| (j, (weight(squared) / sum) as f32);
    to.entries.extend(costs.iter().map(share));
    let distance = if closest.1 == NONE { 0.0 } else { closest.0.sqrt() };
    to.end_point(closest.1, distance);
}

/// What a square loses at most when its root is squared again.
const BELOW_ROUNDING: f64 = 1.0 - 1e-12;

/// The right side of eq. 1.
struct Mixture<'a> {
    terms: Vec<Term<'a>>,
}

/// What a patch adds to it.
struct Term<'a> {
    patch: &'a Patch,
    /// Largest distance of a point.
    reach: Reach,
    /// 1 / (2 f_j^2 S^2).
    exponent: f64,
    /// ln w_j / f_j.
    prior: f64,
}

/// Patches and `-ln p_ij` of the point at hand, up to a constant.
type Costs = Vec<(u32, f64)>;

impl<'a> Mixture<'a> {
    fn new(patches: &'a [Patch], grid_size: f64, s: f64, factors: Option<&[f64]>) -> Self {
        // Patches placed at random have no points yet: all w_j are 1 then.
        let known = patches.iter().all(|p| p.density > 0.0);
        let term = |(j, patch): (usize, &'a Patch)| {
            let factor = factors.map_or(1.0, |f| f[j]);
            let density = if known { patch.density } else { 1.0 };
            Term {
                patch,
                reach: patch.reach(grid_size * factor.max(1.0)),
                exponent: 0.5 / (factor * s).powi(2),
                prior: (density / factor).ln(),
            }
        };
        Self { terms: patches.iter().enumerate().map(term).collect() }
    }

    /// p_ij of point `i` for the patches `near` it, and the patch with the largest.
    fn weigh(&self, points: &Points, i: usize, near: &[u32], costs: &mut Costs, to: &mut Chunk) {
        costs.clear();
        let mut closest = (f64::INFINITY, NONE, 0.0);
        let position = points.positions[i];
        for &j in near {
            let Term { patch, reach, exponent, prior } = &self.terms[j as usize];
            let Some(d) = patch.distance_within(position, reach) else { continue };
            if points.facing.as_ref().is_some_and(|f| patch.turned_away(f[i])) {
                continue;
            }
            let cost = exponent * d * d - prior;
            costs.push((j, cost));
            // Of several the first.
            if cost < closest.0 {
                closest = (cost, j, d);
            }
        }
        if let [(j, _)] = costs[..] {
            to.entries.push((j, 1.0));
        } else {
            // The least cost is subtracted first, so that a point far from all patches still counts for one.
            costs.iter_mut().for_each(|c| c.1 = (closest.0 - c.1).exp());
            let sum: f64 = costs.iter().map(|c| c.1).sum();
            to.entries.extend(costs.iter().map(|&(j, weight)| (j, (weight / sum) as f32)));
        }
        to.end_point(closest.1, closest.2);
    }

    /// The patch with the largest p_ij of point `i`, as [`Mixture::weigh`] finds it. Tiles of a patch are looked at only where its
    /// plane is near enough for a larger one than those before it.
    fn support(&self, points: &Points, i: usize, near: &[u32]) -> u32 {
        let mut closest = (f64::INFINITY, NONE);
        let position = points.positions[i];
        for &j in near {
            let Term { patch, reach, exponent, prior } = &self.terms[j as usize];
            let cost = |squared: f64| exponent * squared - prior;
            let is_near = |squared: f64| cost(BELOW_ROUNDING * squared) < closest.0;
            let Some(d) = patch.distance_where(position, reach, is_near) else { continue };
            let is_seen = || !points.facing.as_ref().is_some_and(|f| patch.turned_away(f[i]));
            // Of several the first.
            if cost(d * d) < closest.0 && is_seen() {
                closest = (cost(d * d), j);
            }
        }
        closest.1
    }

    /// For each block the patches of which a supported tile may be within reach of a point.
    fn candidates(&self, points: &Points) -> Grouped<u32> {
        let of = |term: &Term<'_>| term.patch.blocks(points, term.reach.height);
        let blocks: Vec<Vec<u32>> = parallel::map(&self.terms, of);
        let all = || (0..).zip(&blocks).flat_map(|(j, blocks)| blocks.iter().map(move |&b| (b, j)));
        Grouped::new(points.n_blocks(), all)
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::{PointCloud, Silent};

    use super::super::seed;
    use super::*;

    #[test]
    fn a_point_at_the_grid_size_weighs_w() {
        for (g, w) in [(1.0, 0.01), (0.05, 0.3)] {
            let s: f64 = weight_scale(g, w);
            assert!(((-g * g / (2.0 * s * s)).exp() - w).abs() < 1e-12);
        }
    }

    /// Against the distances of all points to all patches.
    #[test]
    fn probabilities_are_those_of_eq_1_for_all_patches_within_reach() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let cloud: Vec<[f32; 3]> =
            (0..3000).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
        let points = Points::new(&PointCloud::from_positions(cloud).0, None).unwrap();
        let mut patches = seed::random(&points, 7, 5);
        for (j, patch) in patches.iter_mut().enumerate() {
            let n = patch.tiles.supported().len();
            patch.tiles.support((0..n).map(|t| t % (j + 2) == 0).collect());
            patch.density = 1.0 + j as f64;
        }
        let (g, s) = (0.2, 0.07);
        let found = e_step(&points, &patches, g, s, None, &Silent).unwrap();
        let supports = supports(&points, &patches, g, s, None, &Silent).unwrap();
        let mut wanted: Vec<Vec<(u32, f64)>> = vec![Vec::new(); patches.len()];
        for (i, &p) in points.positions.iter().enumerate() {
            let weights: Vec<(usize, f64)> = patches
                .iter()
                .enumerate()
                .filter_map(|(j, patch)| {
                    let d = patch.distance(p, g)?;
                    Some((j, patch.density * (-d * d / (2.0 * s * s)).exp()))
                })
                .collect();
            let sum: f64 = weights.iter().map(|w| w.1).sum();
            for &(j, w) in &weights {
                wanted[j].push((i as u32, w / sum));
            }
            let best =
                weights.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(NONE, |b| b.0 as u32);
            assert_eq!(supports[i], best);
        }
        assert!(wanted.iter().map(Vec::len).sum::<usize>() > 500);
        // The same by point, and the support sets.
        for (j, set) in found.support_sets().iter().enumerate() {
            let by_point = (0..points.len()).flat_map(|i| {
                let own = found.of_point(i).iter().filter(move |e| e.0 as usize == j);
                own.map(move |e| (i as u32, e.1))
            });
            assert!(by_point.eq(found.of(j).iter().copied()));
            let members = (0..points.len() as u32).filter(|&i| supports[i as usize] == j as u32);
            assert!(members.eq(set.iter().copied()));
        }
        for (j, wanted) in wanted.iter().enumerate() {
            let of = found.of(j);
            assert_eq!(of.len(), wanted.len());
            for (&(i, p), &(k, w)) in of.iter().zip(wanted) {
                assert_eq!(i, k);
                assert!((f64::from(p) - w).abs() < 1e-5, "{p} {w}");
            }
        }
    }
}
