//! Merging of patches that are close, parallel and in one plane (section II-D, figure 6).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;
use surfabet_geom::{Moments, Progress};

use super::m_step::plane;
use super::trim::{mean_square, trim};
use crate::disjoint::root;
use crate::error::Result;
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::vector::{dot, minus};

/// Pairs looked at between two questions whether to go on.
const PAIRS_PER_CHECK: usize = 4096;

/// What merging has to know of a set of points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    pub moments: Moments,
    pub frame: Frame,
    /// Sum of the sides that the points were seen from.
    pub facing: [f64; 3],
    /// Variance of the points without the surface's shape.
    pub noise: f64,
}

/// When two parts become one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// Largest distance of one part's points from the other's plane, as root of the mean square: G.
    pub distance: f64,
    /// Standard deviation that every part may have, metres.
    pub deviation: f64,
    /// Factor of the deviation of a part about its own plane that is allowed about the common one.
    pub tolerance: f64,
}

impl Part {
    /// The whole support of a patch.
    pub fn of(patch: &Patch) -> Self {
        Self {
            moments: patch.moments,
            frame: patch.frame,
            facing: patch.facing,
            noise: patch.noise * patch.noise,
        }
    }

    /// The union with another part and the mean square distance of its points from their plane, if `rule` allows.
    pub fn joined(&self, other: &Self, rule: &Rule) -> Option<(f64, Self)> {
        // The smaller of both mean distances, of which the paper takes the mean, not its square's root.
        let apart =
            mean_square(&self.moments, &other.frame).min(mean_square(&other.moments, &self.frame));
        if apart >= rule.distance * rule.distance {
            return None;
        }
        let mut moments = self.moments;
        moments.merge(&other.moments);
        let frame = plane(&moments)?;
        if dot(self.facing, frame.normal) * dot(other.facing, frame.normal) < 0.0 {
            return None;
        }
        let fits = |part: &Self| {
            let allowed = rule.tolerance * part.noise.sqrt().max(rule.deviation);
            mean_square(&part.moments, &frame) <= allowed * allowed
        };
        if !(fits(self) && fits(other)) {
            return None;
        }
        let share = other.moments.weight() / moments.weight();
        let joined = Self {
            moments,
            frame,
            facing: std::array::from_fn(|a| self.facing[a] + other.facing[a]),
            noise: (1.0 - share) * self.noise + share * other.noise,
        };
        Some((mean_square(&moments, &joined.frame), joined))
    }
}

/// An order on distances that are not NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cost(f64);

impl Eq for Cost {}

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// A pair of parts to join: what it costs, which, and how often each had been joined when that was found out.
type Candidate = Reverse<(Cost, [u32; 2], [u32; 2])>;

/// Joins neighbouring parts, those first whose union is flattest, until no pair is left that `rule` allows. Gives
/// the part that each has become, numbered by its first member.
pub(super) fn agglomerate(
    mut parts: Vec<Part>,
    pairs: &[[u32; 2]],
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let n = parts.len();
    let mut neighbors: Vec<Vec<u32>> = vec![Vec::new(); n];
    for &[a, b] in pairs {
        neighbors[a as usize].push(b);
        neighbors[b as usize].push(a);
    }
    let mut into: Vec<u32> = (0..n as u32).collect();
    let mut version = vec![0_u32; n];
    let costs: Vec<Option<f64>> = pairs
        .par_iter()
        .map(|&[a, b]| parts[a as usize].joined(&parts[b as usize], rule).map(|j| j.0))
        .collect();
    let mut queue: BinaryHeap<Candidate> = pairs
        .iter()
        .zip(costs)
        .filter_map(|(&pair, cost)| Some(Reverse((Cost(cost?), pair, [0, 0]))))
        .collect();
    let mut looked = 0;
    while let Some(Reverse((_, [a, b], versions))) = queue.pop() {
        looked += 1;
        if looked % PAIRS_PER_CHECK == 0 {
            progress.check()?;
        }
        let [i, j] = [a as usize, b as usize];
        if into[i] != a || into[j] != b || [version[i], version[j]] != versions {
            continue;
        }
        let Some((_, joined)) = parts[i].joined(&parts[j], rule) else { continue };
        parts[i] = joined;
        version[i] += 1;
        into[j] = a;
        let mut around = std::mem::take(&mut neighbors[i]);
        around.append(&mut neighbors[j]);
        for c in &mut around {
            *c = root(&mut into, *c);
        }
        around.sort_unstable();
        around.dedup();
        around.retain(|&c| c != a);
        for &c in &around {
            let k = c as usize;
            // Neighbours find this part under its new name when it is their turn.
            neighbors[k].push(a);
            if let Some((cost, _)) = parts[i].joined(&parts[k], rule) {
                let (pair, versions) = if a < c {
                    ([a, c], [version[i], version[k]])
                } else {
                    ([c, a], [version[k], version[i]])
                };
                queue.push(Reverse((Cost(cost), pair, versions)));
            }
        }
        neighbors[i] = around;
    }
    Ok((0..n as u32).map(|i| root(&mut into, i)).collect())
}

/// Merges patches until all pairs are dissimilar.
pub(super) fn merge(
    points: &Points,
    patches: Vec<Patch>,
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let grid_size = rule.distance;
    let pairs = close_pairs(&patches, grid_size);
    let parts = patches.iter().map(Part::of).collect();
    let into = agglomerate(parts, &pairs, rule, progress)?;
    let mut groups: Vec<Vec<Patch>> = patches.iter().map(|_| Vec::new()).collect();
    for (patch, &to) in patches.into_iter().zip(&into) {
        groups[to as usize].push(patch);
    }
    let merged: Vec<Patch> = groups
        .into_par_iter()
        .filter_map(|mut group| {
            if group.len() < 2 {
                return group.pop();
            }
            let mut support: Vec<u32> = group.iter().flat_map(|p| &p.whole).copied().collect();
            support.sort_unstable();
            let mut moments = Moments::new();
            group.iter().for_each(|p| moments.merge(&p.moments));
            trim(points, plane(&moments)?, &support, grid_size)
        })
        .collect();
    Ok(merged)
}

/// Pairs of patches of which supported tiles come within G of each other, both expanded by G.
pub(super) fn close_pairs(patches: &[Patch], grid_size: f64) -> Vec<[u32; 2]> {
    let boxes: Vec<([f64; 3], [f64; 3])> = patches.iter().map(|p| expanded(p, grid_size)).collect();
    // Along the axis on which the boxes overlap least, sorted by their lower ends.
    let axis = widest_axis(&boxes);
    let mut order: Vec<u32> = (0..patches.len() as u32).collect();
    order.sort_by(|&a, &b| {
        boxes[a as usize].0[axis].total_cmp(&boxes[b as usize].0[axis]).then(a.cmp(&b))
    });
    let overlap = |a: u32, b: u32| {
        let ((al, ah), (bl, bh)) = (boxes[a as usize], boxes[b as usize]);
        (0..3).all(|k| al[k] <= bh[k] && bl[k] <= ah[k])
    };
    let mut pairs: Vec<[u32; 2]> = order
        .par_iter()
        .enumerate()
        .flat_map_iter(|(at, &a)| {
            let end = boxes[a as usize].1[axis];
            order[at + 1..]
                .iter()
                .take_while(|&&b| boxes[b as usize].0[axis] <= end)
                .filter(|&&b| overlap(a, b))
                .filter(|&&b| close(&patches[a as usize], &patches[b as usize], grid_size))
                .map(|&b| [a.min(b), a.max(b)])
                .collect::<Vec<_>>()
        })
        .collect();
    pairs.sort_unstable();
    pairs
}

fn widest_axis(boxes: &[([f64; 3], [f64; 3])]) -> usize {
    let spread = |a: usize| {
        let low = boxes.iter().fold(f64::INFINITY, |m, b| m.min(b.0[a]));
        let high = boxes.iter().fold(f64::NEG_INFINITY, |m, b| m.max(b.1[a]));
        let mean = boxes.iter().map(|b| b.1[a] - b.0[a]).sum::<f64>() / boxes.len().max(1) as f64;
        (high - low) / mean.max(f64::MIN_POSITIVE)
    };
    (1..3).fold(0, |m, a| if spread(a) > spread(m) { a } else { m })
}

/// The axis-aligned box of a patch, expanded by G.
fn expanded(patch: &Patch, grid_size: f64) -> ([f64; 3], [f64; 3]) {
    let [low, size] = [patch.tiles.low(), patch.tiles.size()];
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .map(|at: [f64; 2]| patch.frame.at(std::array::from_fn(|a| low[a] + at[a] * size[a])));
    let of = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        std::array::from_fn(|a| corners.iter().fold(start, |m, c| pick(m, c[a])))
    };
    (
        of(f64::min, f64::INFINITY).map(|c| c - grid_size),
        of(f64::max, f64::NEG_INFINITY).map(|c| c + grid_size),
    )
}

/// True when a supported tile of one is within G, both expanded by G, of one of the other.
fn close(a: &Patch, b: &Patch, grid_size: f64) -> bool {
    let (few, many) = if a.tiles.n_supported() <= b.tiles.n_supported() { (a, b) } else { (b, a) };
    let nx = few.tiles.shape()[0];
    let reach = 2.0 * grid_size.max(0.5 * (few.tiles.edge() + many.tiles.edge()));
    few.tiles.supported().iter().enumerate().filter(|(_, s)| **s).any(|(t, _)| {
        let (low, high) = few.tiles.bounds(t % nx, t / nx);
        let middle = few.frame.at(std::array::from_fn(|k| 0.5 * (low[k] + high[k])));
        let half: [f64; 2] = std::array::from_fn(|k| 0.5 * (high[k] - low[k]));
        let d = minus(middle, many.frame.center);
        let extent = |axis: [f64; 3]| {
            half[0] * dot(few.frame.u, axis).abs() + half[1] * dot(few.frame.v, axis).abs()
        };
        if dot(d, many.frame.normal).abs() > reach + extent(many.frame.normal) {
            return false;
        }
        let at = [dot(d, many.frame.u), dot(d, many.frame.v)];
        let margin = [many.frame.u, many.frame.v].map(|axis| extent(axis) + reach);
        many.tiles.any_in(
            std::array::from_fn(|k| at[k] - margin[k]),
            std::array::from_fn(|k| at[k] + margin[k]),
        )
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;

    const RULE: Rule = Rule { distance: 0.06, deviation: 0.02, tolerance: 1.25 };

    /// Number of patches that remain of two of 1 m x 1 m; `second` moves a point of the unit square to the second.
    fn merged(rule: &Rule, second: impl Fn(f64, f64, f64) -> [f64; 3]) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut positions: Vec<[f32; 3]> = Vec::new();
        for i in 0..8000 {
            let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
            let z = rng.random_range(-0.035..0.035);
            let p = if i % 2 == 0 { [x, y, z] } else { second(x, y, z) };
            positions.push(p.map(|c| c as f32));
        }
        let cloud = PointCloud::from_positions(positions.clone()).0;
        let points = Points::new(&cloud, None).unwrap();
        let patches = (0..2)
            .map(|half| {
                let mut set: Vec<u32> =
                    (0..8000).filter(|i| i % 2 == half).map(|i| points.place[i]).collect();
                set.sort_unstable();
                let center = points.positions[set[0] as usize].map(f64::from);
                let moments = points.moments_about(center, set.iter().map(|&i| (i, 1.0)));
                trim(&points, plane(&moments).unwrap(), &set, rule.distance).unwrap()
            })
            .collect();
        merge(&points, patches, rule, &Silent).unwrap().len()
    }

    #[test]
    fn neighbours_in_one_plane_become_one() {
        assert_eq!(merged(&RULE, |x, y, z| [x + 1.02, y, z]), 1);
    }

    #[test]
    fn one_surface_in_two_layers_becomes_one() {
        assert_eq!(merged(&RULE, |x, y, z| [x, y, z + 0.01]), 1);
    }

    #[test]
    fn what_is_apart_stays_apart_even_in_one_plane() {
        assert_eq!(merged(&RULE, |x, y, z| [x + 1.5, y, z]), 2);
    }

    #[test]
    fn corners_and_layers_stay() {
        assert_eq!(merged(&RULE, |x, y, z| [1.0 + z, y, x]), 2);
        assert_eq!(merged(&RULE, |x, y, z| [x, y, z + 0.05]), 2);
    }

    #[test]
    fn the_papers_conditions_alone_merge_layers_closer_than_the_grid_size() {
        let paper = Rule { tolerance: f64::INFINITY, ..RULE };
        assert_eq!(merged(&paper, |x, y, z| [x, y, z + 0.05]), 1);
        assert_eq!(merged(&paper, |x, y, z| [x, y, z + 0.1]), 2);
    }
}
