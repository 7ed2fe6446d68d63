//! E-step: how probable it is that each point belongs to each patch (eq. 1 and 2).

use rayon::prelude::*;
use surfabet_geom::Progress;

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
    /// First entry of each patch, and the end.
    starts: Vec<usize>,
    /// Point and probability; points ascending for each patch.
    entries: Vec<(u32, f32)>,
    /// For each distinct point the patch with the largest probability.
    pub(in crate::planes) supports: Vec<u32>,
    /// Distance to that patch, metres; zero for points that support none.
    pub(super) distances: Vec<f32>,
}

impl Responsibilities {
    /// Points with a chance to belong to a patch, and that chance (p_ij).
    pub fn of(&self, patch: usize) -> &[(u32, f32)] {
        &self.entries[self.starts[patch]..self.starts[patch + 1]]
    }

    /// Mean distance of the points that support a patch, and the share of all points that do.
    pub(super) fn fit(&self) -> (f64, f64) {
        let near = self.supports.iter().filter(|&&s| s != NONE).count();
        let sum: f64 = self.distances.iter().map(|&d| f64::from(d)).sum();
        (sum / near.max(1) as f64, near as f64 / self.supports.len().max(1) as f64)
    }

    /// The points that support each of `n` patches (S), ascending.
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

/// The standard deviation S that gives a point at distance `grid_size` (G) the weight W (eq. 2), metres.
pub fn weight_scale(grid_size: f64, weight_at_grid_size: f64) -> f64 {
    grid_size / (-2.0 * weight_at_grid_size.ln()).sqrt()
}

/// What one chunk of blocks finds.
struct Found {
    /// Patch, point, probability.
    entries: Vec<(u32, u32, f32)>,
    supports: Vec<u32>,
    distances: Vec<f32>,
}

/// Probabilities of all points for the patches within reach, which is the grid size G; `s` is S.
///
/// Eq. 1 weighs patches alike; here the weights are also in proportion to the number of points per area of each patch,
/// as the mixing weights of a mixture of surfaces are. Otherwise a patch right through a noisy wall lives on the points
/// that happen to lie far from the wall; it has few points for its area, and so it loses them.
///
/// # Errors
/// [`crate::Error::Cancelled`] when the caller asks to stop.
pub fn e_step(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    s: f64,
    progress: &dyn Progress,
) -> Result<Responsibilities> {
    let near = candidates(points, patches, grid_size);
    let exponent = -1.0 / (2.0 * s * s);
    let known = patches.iter().all(|p| p.density > 0.0);
    // The logarithm of the density in the unit of a squared distance.
    let prior = |p: &Patch| if known { 2.0 * s * s * p.density.ln() } else { 0.0 };
    let prior: Vec<f64> = patches.iter().map(prior).collect();
    let n_blocks = points.n_blocks();
    let chunks = (0..n_blocks.div_ceil(CHUNK)).into_par_iter().map(|c| -> Result<Found> {
        progress.check()?;
        let mut found = Found { entries: Vec::new(), supports: Vec::new(), distances: Vec::new() };
        let mut costs: Vec<(u32, f64)> = Vec::new();
        for b in c * CHUNK..((c + 1) * CHUNK).min(n_blocks) {
            let near = near.of(b);
            for i in points.block(b) {
                costs.clear();
                let mut closest = (f64::INFINITY, NONE, 0.0);
                for &j in near {
                    let patch = &patches[j as usize];
                    let Some((d, _)) = patch.distance(points.positions[i], grid_size) else {
                        continue;
                    };
                    if points.facing.as_ref().is_some_and(|f| patch.turned_away(f[i])) {
                        continue;
                    }
                    let cost = d * d - prior[j as usize];
                    costs.push((j, cost));
                    // Of several the first.
                    if cost < closest.0 {
                        closest = (cost, j, d);
                    }
                }
                // The least is taken off first, so that a point far from all patches still counts for one.
                let weight = |cost: f64| (exponent * (cost - closest.0)).exp();
                let sum: f64 = costs.iter().map(|c| weight(c.1)).sum();
                let share = |&(j, cost): &(u32, f64)| (j, i as u32, (weight(cost) / sum) as f32);
                found.entries.extend(costs.iter().map(share));
                found.supports.push(closest.1);
                found.distances.push(closest.2 as f32);
            }
        }
        Ok(found)
    });
    let chunks = chunks.collect::<Result<Vec<Found>>>()?;
    Ok(by_patch(patches.len(), &chunks))
}

fn by_patch(n: usize, chunks: &[Found]) -> Responsibilities {
    let mut starts = vec![0; n + 1];
    for &(j, _, _) in chunks.iter().flat_map(|c| &c.entries) {
        starts[j as usize + 1] += 1;
    }
    for j in 0..n {
        starts[j + 1] += starts[j];
    }
    let mut next = starts.clone();
    let mut entries = vec![(0, 0.0); starts[n]];
    for &(j, i, p) in chunks.iter().flat_map(|c| &c.entries) {
        entries[next[j as usize]] = (i, p);
        next[j as usize] += 1;
    }
    Responsibilities {
        starts,
        entries,
        supports: chunks.iter().flat_map(|c| &c.supports).copied().collect(),
        distances: chunks.iter().flat_map(|c| &c.distances).copied().collect(),
    }
}

/// The patches that may be within reach of each block.
struct Candidates {
    starts: Vec<usize>,
    patches: Vec<u32>,
}

impl Candidates {
    fn of(&self, block: usize) -> &[u32] {
        &self.patches[self.starts[block]..self.starts[block + 1]]
    }
}

fn candidates(points: &Points, patches: &[Patch], reach: f64) -> Candidates {
    let blocks: Vec<Vec<u32>> =
        patches.par_iter().map(|patch| patch.blocks(points, reach)).collect();
    let mut starts = vec![0; points.n_blocks() + 1];
    for &b in blocks.iter().flatten() {
        starts[b as usize + 1] += 1;
    }
    for b in 0..points.n_blocks() {
        starts[b + 1] += starts[b];
    }
    let mut next = starts.clone();
    let mut of = vec![0; blocks.iter().map(Vec::len).sum()];
    for (j, blocks) in blocks.iter().enumerate() {
        for &b in blocks {
            of[next[b as usize]] = j as u32;
            next[b as usize] += 1;
        }
    }
    Candidates { starts, patches: of }
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
        let found = e_step(&points, &patches, g, s, &Silent).unwrap();
        let mut wanted: Vec<Vec<(u32, f64)>> = vec![Vec::new(); patches.len()];
        for (i, &p) in points.positions.iter().enumerate() {
            let weights: Vec<(usize, f64)> = patches
                .iter()
                .enumerate()
                .filter_map(|(j, patch)| {
                    let (d, _) = patch.distance(p, g)?;
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
