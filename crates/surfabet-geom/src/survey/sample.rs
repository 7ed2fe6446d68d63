//! The points that a survey samples.

use surfabet_base::parallel;

use super::around::NeighborShapes;
use super::facing::facings;
use crate::cells;
use crate::cloud::PointCloud;
use crate::error::Result;
use crate::kdtree::KdTree;

/// Points that are sampled, at most. Medians of as many are exact to about two percent.
const MAX_SAMPLED: usize = 4096;

/// Points in the tree, about: of larger clouds some blocks of space are taken, whole. It bounds the time of building the
/// tree, and leaves a hundred points about each that is sampled.
const TREE_POINTS: usize = 400_000;

/// Points that show where the blocks may lie: quartiles of as many are exact to a few percent, and only the size of blocks
/// depends on them.
const PROBES: usize = 4096;

/// Blocks of space along the middle half of the points: of a room of ten million points, some 48 blocks long, one in 25 is
/// taken, hundreds in all.
const BLOCKS: f32 = 24.0;

/// Some points, one per place, in a tree.
pub(super) struct SampledCloud {
    pub positions: Vec<[f32; 3]>,
    /// The direction that the surface faces at each point, where that is known; about unit length.
    pub facings: Option<Vec<[f32; 3]>>,
    pub tree: KdTree,
    /// Distance between the sampled points, in the order of the cloud.
    step: usize,
}

impl SampledCloud {
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

    /// What `measure` gives of the sampled points, by number, where it gives anything.
    pub fn measure<T: Send>(&self, measure: impl Fn(usize) -> Option<T> + Send + Sync) -> Vec<T> {
        parallel::gather(self.positions.len().div_ceil(self.step), |k, found| {
            found.extend(measure(k * self.step));
        })
    }

    /// What is about the sampled points, by number.
    pub fn surroundings(&self) -> Vec<NeighborShapes> {
        self.measure(|point| Some(NeighborShapes::new(self, point)))
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
fn one_per_place(mut chosen: Vec<usize>, positions: &[[f32; 3]]) -> Vec<usize> {
    // The place of each, and in the lowest 32 bits its rank.
    let mut keys: Vec<u128> = parallel::map_range(chosen.len(), |rank| {
        // Zero is one place, whatever its sign.
        let place = positions[chosen[rank]].map(|c| u128::from((c + 0.0).to_bits()));
        place[0] << 96 | place[1] << 64 | place[2] << 32 | rank as u128
    });
    parallel::sort_wide_keys(&mut keys);
    let is_one_place = |keys: &&[u128]| keys[0] >> 32 == keys[1] >> 32;
    let mut repeated: Vec<u32> =
        keys.windows(2).filter(is_one_place).map(|keys| keys[1] as u32).collect();
    parallel::sort_numbers(&mut repeated);
    let mut repeated = repeated.into_iter().peekable();
    let mut ranks = 0..=u32::MAX;
    chosen.retain(|_| ranks.next().is_none_or(|rank| repeated.next_if_eq(&rank).is_none()));
    chosen
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
