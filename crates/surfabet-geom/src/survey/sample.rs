//! The points that a survey looks at.

use rayon::prelude::*;
use surfabet_base::parallel;

use super::facing::facings;
use super::median;
use crate::cells;
use crate::cloud::PointCloud;
use crate::error::Result;
use crate::kdtree::{KdTree, Neighbor};
use crate::vector::dot;

/// Points that are looked at, at most. Medians of as many are exact to about two percent.
const MAX_SAMPLED: usize = 4096;

/// Points in the tree, about: of larger clouds some blocks of space are taken, whole. It bounds the time of building the
/// tree, and leaves a hundred points about each that is looked at.
const TREE_POINTS: usize = 400_000;

/// Points that show where the blocks may lie: quartiles of as many are exact to a few percent, and only the size of blocks
/// depends on them.
const PROBES: usize = 4096;

/// Blocks of space along the middle half of the points: of a room of ten million points, some 48 blocks long, one in 25 is
/// taken, hundreds in all.
const BLOCKS: f32 = 24.0;

/// Some points, one per place, with the neighbours of each.
pub(super) struct Sample {
    pub positions: Vec<[f32; 3]>,
    /// The direction that the surface faces at each point, where that is known; about unit length.
    pub facings: Option<Vec<[f32; 3]>>,
    pub tree: KdTree,
    /// Distance between the points that are looked at, in the order of the cloud.
    step: usize,
}

impl Sample {
    /// The sample of a cloud with at least one point.
    pub fn of(cloud: &PointCloud) -> Result<Self> {
        let (chosen, mut sample) = Self::chosen_of(cloud.positions())?;
        sample.facings = facings(cloud, &chosen, &sample.positions, &sample.tree);
        Ok(sample)
    }

    /// The sample of some positions, of which nobody knows how surfaces face; at least one.
    pub fn of_positions(positions: &[[f32; 3]]) -> Result<Self> {
        Ok(Self::chosen_of(positions)?.1)
    }

    /// The numbers of the positions that are chosen, and their sample without facings.
    fn chosen_of(positions: &[[f32; 3]]) -> Result<(Vec<usize>, Self)> {
        let chosen = one_per_place(some_blocks(positions), positions);
        let positions: Vec<[f32; 3]> = chosen.iter().map(|&i| positions[i]).collect();
        let tree = KdTree::new(&positions)?;
        let step = positions.len().div_ceil(MAX_SAMPLED).max(1);
        Ok((chosen, Self { positions, facings: None, tree, step }))
    }

    /// What `measure` gives of the points that are looked at, by number, where it gives anything.
    pub fn measure<T: Send>(&self, measure: impl Fn(usize) -> Option<T> + Send + Sync) -> Vec<T> {
        parallel::gather(self.positions.len().div_ceil(self.step), |k, found| {
            found.extend(measure(k * self.step));
        })
    }

    /// Median distance of a point to the nearest other one, metres; zero where there is none.
    pub fn spacing(&self) -> f64 {
        median(self.measure(|i| {
            let mut near = Vec::new();
            self.tree.k_nearest(self.positions[i], 2, &mut near);
            Some(f64::from(near.get(1)?.squared_distance()).sqrt())
        }))
    }

    /// The `k` points nearest to a point, itself included, that face the same way; all, where facings are not known, and
    /// fewer, where most around face the other way.
    pub fn near(&self, i: usize, k: usize) -> Vec<Neighbor> {
        let mut near = Vec::new();
        let Some(facings) = &self.facings else {
            self.tree.k_nearest(self.positions[i], k, &mut near);
            return near;
        };
        self.tree.k_nearest(self.positions[i], 2 * k, &mut near);
        near.retain(|n| dot(facings[n.index()], facings[i]) > 0.0);
        near.truncate(k);
        near
    }

    /// Positions of neighbours.
    pub fn positions_of<'a>(&'a self, near: &'a [Neighbor]) -> impl Iterator<Item = [f32; 3]> + 'a {
        near.iter().map(|n| self.positions[n.index()])
    }
}

/// The numbers of all points, or of more than [`TREE_POINTS`] those in some blocks of space, so that points keep their
/// neighbours.
fn some_blocks(positions: &[[f32; 3]]) -> Vec<usize> {
    let one_of = positions.len().div_ceil(TREE_POINTS) as u64;
    let side = block_side(positions);
    if one_of < 2 || side <= 0.0 {
        return (0..positions.len()).collect();
    }
    // Bits of a product with a large odd number are as good as random.
    let hash = |key: u64| key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    let is_chosen =
        |&i: &usize| hash(cells::key(cells::cell_of(positions[i], side))).is_multiple_of(one_of);
    let some: Vec<usize> =
        parallel::gather(positions.len(), |i, some| some.extend(Some(i).filter(is_chosen)));
    // Where nearly all points are in one block, it may not be among the chosen ones.
    if some.len() < TREE_POINTS / 8 { (0..positions.len()).collect() } else { some }
}

/// Of the points at one place the first: scans that were merged, or stored once per return, hold some twice, and as
/// neighbours of one another these would hide the noise.
fn one_per_place(chosen: Vec<usize>, positions: &[[f32; 3]]) -> Vec<usize> {
    // Zero is one place, whatever its sign.
    let place = |i: usize| positions[i].map(|c| (c + 0.0).to_bits());
    let mut by_place: Vec<usize> = chosen;
    by_place.par_sort_unstable_by_key(|&i| (place(i), i));
    by_place.dedup_by_key(|i| place(*i));
    by_place.par_sort_unstable();
    by_place
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
