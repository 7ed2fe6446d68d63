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
use crate::error::Result;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Stands for no patch.
pub(in crate::planes) const NONE: u32 = u32::MAX;

/// Blocks of points per unit of parallel work.
const CHUNK: usize = 64;

/// The probabilities p_ij that are not zero, by patch, and the patch that each point supports.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Responsibilities {
    /// Point and probability; points ascending for each patch.
    entries: Grouped<(u32, f32)>,
    /// For each distinct point the patch with the largest probability.
    pub(in crate::planes) supports: Vec<u32>,
    /// Distance to that patch, metres; zero for points that support none.
    pub(super) distances: Vec<f32>,
}

impl Responsibilities {
    /// The points with a probability above zero for a patch, and this probability p_ij.
    pub fn of(&self, patch: usize) -> &[(u32, f32)] {
        self.entries.of(patch)
    }

    /// Mean distance of the points that support a patch, and the share of all points that do.
    pub(super) fn fit(&self) -> (f64, f64) {
        let near = self.supports.iter().filter(|&&s| s != NONE).count();
        let sum: f64 = self.distances.iter().map(|&d| f64::from(d)).sum();
        (sum / near.max(1) as f64, near as f64 / self.supports.len().max(1) as f64)
    }

    /// The support sets of `n` patches, points ascending: `S(s_j) = {a_i : p_ij = max_k p_ik}`.
    pub(super) fn support_sets(&self, n: usize) -> Vec<Vec<u32>> {
        let mut sets = vec![Vec::new(); n];
        for (i, &s) in self.supports.iter().enumerate() {
            if s != NONE {
                sets[s as usize].push(i as u32);
            }
        }
        sets
    }
}

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
    let near = candidates(points, patches, &mixture.reach);
    let n_blocks = points.n_blocks();
    let chunks = parallel::try_map_range(n_blocks.div_ceil(CHUNK), |c| -> Result<Weighed> {
        progress.check()?;
        let mut weighed = Weighed::default();
        for b in c * CHUNK..((c + 1) * CHUNK).min(n_blocks) {
            for i in points.block(b) {
                mixture.weigh(points, i, near.of(b), &mut weighed);
            }
        }
        Ok(weighed)
    })?;
    Ok(by_patch(patches.len(), &chunks))
}

/// Probabilities of all points for all patches, however far, and no mixing weights: eq. 1 as printed; `s` is S. Those that
/// are zero in double precision are left out.
///
/// # Errors
/// [`crate::Error::Cancelled`] when the caller asks to stop.
pub(in crate::planes) fn e_step_everywhere(
    points: &Points,
    patches: &[Patch],
    s: f64,
    progress: &dyn Progress,
) -> Result<Responsibilities> {
    let n_blocks = points.n_blocks();
    let chunks = parallel::try_map_range(n_blocks.div_ceil(CHUNK), |c| -> Result<Weighed> {
        let mut weighed = Weighed::default();
        for b in c * CHUNK..((c + 1) * CHUNK).min(n_blocks) {
            progress.check()?;
            for i in points.block(b) {
                weigh_all(points.positions[i], i as u32, patches, s, &mut weighed);
            }
        }
        Ok(weighed)
    })?;
    Ok(by_patch(patches.len(), &chunks))
}

/// p_ij of a point for all patches, and the closest.
fn weigh_all(p: [f32; 3], i: u32, patches: &[Patch], s: f64, to: &mut Weighed) {
    // The rectangle of a patch is never further than its supported tiles.
    let mut order: Vec<(f64, u32)> = (0..).zip(patches).map(|(j, q)| (q.least(p), j)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Beyond this above the least squared distance, exp(-d^2 / 2 S^2) is below the rounding of a sum of one.
    let margin = 2.0 * s * s * -f64::EPSILON.ln();
    let mut closest = (f64::INFINITY, NONE);
    to.costs.clear();
    for (least, j) in order {
        if least > closest.0 + margin {
            break;
        }
        let reach = if closest.1 == NONE { f64::INFINITY } else { (closest.0 + margin).sqrt() };
        let Some(squared) = patches[j as usize].squared_distance(p, reach) else { continue };
        to.costs.push((j, squared));
        if squared < closest.0 {
            closest = (squared, j);
        }
    }
    let weight = |squared: f64| ((closest.0 - squared) / (2.0 * s * s)).exp();
    let sum: f64 = to.costs.iter().map(|c| weight(c.1)).sum();
    let share = |&(j, squared): &(u32, f64)| (j, i, (weight(squared) / sum) as f32);
    to.entries.extend(to.costs.iter().map(share));
    to.supports.push(closest.1);
    to.distances.push(if closest.1 == NONE { 0.0 } else { closest.0.sqrt() as f32 });
}

/// The right side of eq. 1.
struct Mixture<'a> {
    patches: &'a [Patch],
    /// Largest distance of a point from each patch.
    reach: Vec<f64>,
    /// 1 / (2 f_j^2 S^2) for each patch.
    exponent: Vec<f64>,
    /// ln w_j / f_j for each patch.
    prior: Vec<f64>,
}

/// What a chunk of blocks gives, in the order of its points.
#[derive(Default)]
struct Weighed {
    /// Patch, point, probability.
    entries: Vec<(u32, u32, f32)>,
    supports: Vec<u32>,
    distances: Vec<f32>,
    /// Patch and -ln p_ij of the point at hand, up to a constant.
    costs: Vec<(u32, f64)>,
}

impl<'a> Mixture<'a> {
    fn new(patches: &'a [Patch], grid_size: f64, s: f64, factors: Option<&[f64]>) -> Self {
        let factor = |j: usize| factors.map_or(1.0, |f| f[j]);
        // Patches placed at random have no points yet: all w_j are 1 then.
        let known = patches.iter().all(|p| p.density > 0.0);
        let density = |p: &Patch| if known { p.density } else { 1.0 };
        let each = || patches.iter().enumerate();
        Self {
            patches,
            reach: each().map(|(j, _)| grid_size * factor(j).max(1.0)).collect(),
            exponent: each().map(|(j, _)| 0.5 / (factor(j) * s).powi(2)).collect(),
            prior: each().map(|(j, p)| (density(p) / factor(j)).ln()).collect(),
        }
    }

    /// p_ij of point `i` for the patches `near` it, and the patch with the largest.
    fn weigh(&self, points: &Points, i: usize, near: &[u32], to: &mut Weighed) {
        to.costs.clear();
        let mut closest = (f64::INFINITY, NONE, 0.0);
        for &j in near {
            let patch = &self.patches[j as usize];
            let Some(d) = patch.distance(points.positions[i], self.reach[j as usize]) else {
                continue;
            };
            if points.facing.as_ref().is_some_and(|f| patch.turned_away(f[i])) {
                continue;
            }
            let cost = self.exponent[j as usize] * d * d - self.prior[j as usize];
            to.costs.push((j, cost));
            // Of several the first.
            if cost < closest.0 {
                closest = (cost, j, d);
            }
        }
        // The least cost is subtracted first, so that a point far from all patches still counts for one.
        let weight = |cost: f64| (closest.0 - cost).exp();
        let sum: f64 = to.costs.iter().map(|c| weight(c.1)).sum();
        let share = |&(j, cost): &(u32, f64)| (j, i as u32, (weight(cost) / sum) as f32);
        to.entries.extend(to.costs.iter().map(share));
        to.supports.push(closest.1);
        to.distances.push(closest.2 as f32);
    }
}

/// The probabilities of all points sorted by patch; points stay in their order.
fn by_patch(n: usize, chunks: &[Weighed]) -> Responsibilities {
    let all = || chunks.iter().flat_map(|c| &c.entries).map(|&(j, i, p)| (j, (i, p)));
    Responsibilities {
        entries: Grouped::new(n, all),
        supports: chunks.iter().flat_map(|c| &c.supports).copied().collect(),
        distances: chunks.iter().flat_map(|c| &c.distances).copied().collect(),
    }
}

/// For each block the patches of which a supported tile may be within its `reach` of a point.
fn candidates(points: &Points, patches: &[Patch], reach: &[f64]) -> Grouped<u32> {
    let blocks: Vec<Vec<u32>> =
        parallel::map_range(patches.len(), |j| patches[j].blocks(points, reach[j]));
    let all = || (0..).zip(&blocks).flat_map(|(j, blocks)| blocks.iter().map(move |&b| (b, j)));
    Grouped::new(points.n_blocks(), all)
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
            assert_eq!(found.supports[i], best);
        }
        assert!(wanted.iter().map(Vec::len).sum::<usize>() > 500);
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
