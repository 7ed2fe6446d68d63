//! What the kept points of each occurrence add to the sums, so that they are taken away without computing Gaussians.

use super::{LANES, Likelihood, ReachableBlocks};
use crate::bic_alphabet::constants::{MAX_SHARED_BLOCKS, MAX_SHARED_POINTS};

/// The sums of one block over the points of one occurrence.
#[derive(Debug, Clone, PartialEq, Eq)]
struct BlockShare {
    block: u32,
    sums: [u32; LANES],
}

/// The share of every occurrence in the sums, where there is memory for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::bic_alphabet) struct Shares {
    /// By place; empty without memory.
    by_place: Vec<Option<Vec<BlockShare>>>,
    /// A sum by block, all zero.
    scratch: Vec<[i64; LANES]>,
}

impl Shares {
    /// Of `places` occurrences without points.
    pub fn new(likelihood: &Likelihood, reachable: &ReachableBlocks, places: usize) -> Self {
        if reachable.len() > MAX_SHARED_BLOCKS {
            return Self { by_place: Vec::new(), scratch: Vec::new() };
        }
        let scratch = vec![[0; LANES]; likelihood.n_blocks()];
        Self { by_place: vec![Some(Vec::new()); places], scratch }
    }

    /// Sets the share of the occurrence at `place`, whose kept points these are.
    pub fn set(
        &mut self,
        likelihood: &Likelihood,
        reachable: &ReachableBlocks,
        place: u32,
        kept: &[[f32; 3]],
    ) {
        let Some(share) = self.by_place.get_mut(place as usize) else { return };
        if kept.len() > MAX_SHARED_POINTS {
            *share = None;
            return;
        }
        let blocks = share.get_or_insert_default();
        blocks.clear();
        let sums = &mut self.scratch;
        likelihood.scatter(kept, reachable.of(place), true, sums, |_| ());
        for &block in reachable.of(place) {
            let of = std::mem::take(&mut sums[block as usize]);
            if of != [0; LANES] {
                // At most MAX_SHARED_POINTS Gaussians of at most 2^22.
                blocks.push(BlockShare { block, sums: of.map(|sum| sum as u32) });
            }
        }
        blocks.shrink_to_fit();
    }

    /// Takes the share of the occurrence at `place` away from `sums`, calling `touched` for each block that may have
    /// changed; false, and nothing is done, where the share is not known.
    pub fn take_away(
        &self,
        place: u32,
        sums: &mut [[i64; LANES]],
        mut touched: impl FnMut(u32),
    ) -> bool {
        let Some(Some(share)) = self.by_place.get(place as usize) else { return false };
        for BlockShare { block, sums: of } in share {
            touched(*block);
            for (sum, &value) in sums[*block as usize].iter_mut().zip(of) {
                *sum -= i64::from(value);
            }
        }
        true
    }
}
