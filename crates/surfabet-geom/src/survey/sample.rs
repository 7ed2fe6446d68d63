//! The points that a survey looks at.

use rayon::prelude::*;

use super::median;
use crate::cells;
use crate::error::Result;
use crate::kdtree::{KdTree, Neighbor};

/// Points that are looked at, at most. Medians of as many are exact to about two percent.
const MAX_SAMPLED: usize = 4096;

/// Points in the tree, about: of larger clouds some blocks of space are taken, whole.
const TREE_POINTS: usize = 400_000;

/// Points that show where the blocks may lie.
const PROBES: usize = 4096;

/// Blocks of space along the middle half of the points.
const BLOCKS: f32 = 24.0;

/// Neighbours among which one at another place is looked for: as many points may be at one place.
const MOST_DUPLICATES: usize = 9;

/// Some points with the neighbours of each.
pub(super) struct Sample {
    pub positions: Vec<[f32; 3]>,
    pub tree: KdTree,
    /// Distance between the points that are looked at, in the order of the cloud.
    step: usize,
}

impl Sample {
    /// The sample of a cloud with at least one point.
    pub fn of(positions: &[[f32; 3]]) -> Result<Self> {
        let positions = some_blocks(positions);
        let tree = KdTree::new(&positions)?;
        let step = positions.len().div_ceil(MAX_SAMPLED).max(1);
        Ok(Self { positions, tree, step })
    }

    /// What `measure` gives of the points that are looked at, where it gives anything.
    pub fn measure<T: Send>(&self, measure: impl Fn([f32; 3]) -> Option<T> + Sync) -> Vec<T> {
        self.positions.par_iter().step_by(self.step).filter_map(|&p| measure(p)).collect()
    }

    /// Median distance of a point to the nearest one at another place, metres; zero where there is none.
    pub fn spacing(&self) -> f64 {
        median(self.measure(|p| {
            let mut near = Vec::new();
            self.tree.k_nearest(p, MOST_DUPLICATES, &mut near);
            let apart = near.iter().map(|n| n.squared_distance()).find(|&d| d > 0.0)?;
            Some(f64::from(apart).sqrt())
        }))
    }

    /// Positions of neighbours.
    pub fn positions_of<'a>(&'a self, near: &'a [Neighbor]) -> impl Iterator<Item = [f32; 3]> + 'a {
        near.iter().map(|n| self.positions[n.index()])
    }
}

/// All points, or of more than [`TREE_POINTS`] those in some blocks of space, so that points keep their neighbours.
fn some_blocks(positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let one_of = positions.len().div_ceil(TREE_POINTS) as u64;
    let side = block_side(positions);
    if one_of < 2 || side <= 0.0 {
        return positions.to_vec();
    }
    // Bits of a product with a large odd number are as good as random.
    let hash = |key: u64| key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    let chosen = |p: &[f32; 3]| hash(cells::key(cells::cell_of(*p, side))).is_multiple_of(one_of);
    let some: Vec<[f32; 3]> = positions.par_iter().copied().filter(chosen).collect();
    // Where nearly all points are in one block, it may not be among the chosen ones.
    if some.len() < TREE_POINTS / 8 { positions.to_vec() } else { some }
}

/// Side of a block, metres: a part of the box that holds the middle half of the points along each axis.
fn block_side(positions: &[[f32; 3]]) -> f32 {
    let step = positions.len().div_ceil(PROBES).max(1);
    let along = |axis: usize| {
        let mut probes: Vec<f32> = positions.iter().step_by(step).map(|p| p[axis]).collect();
        probes.sort_by(f32::total_cmp);
        probes[3 * probes.len() / 4] - probes[probes.len() / 4]
    };
    (0..3).map(along).fold(0.0, f32::max) / BLOCKS
}
