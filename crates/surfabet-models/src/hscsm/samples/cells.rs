//! Samples by cell, to find those in a box.

use std::ops::Range;

use surfabet_geom::morton::{MortonMap, decode, encode};

use crate::hscsm::samples::{CellLattice, Samples};

/// The samples of a cloud by larger cells.
pub(in crate::hscsm) struct SampleCells {
    lattice: CellLattice,
    ranges: MortonMap<(u32, u32)>,
    /// Coordinates of the first and the last cells that hold a sample.
    low: [u64; 3],
    high: [u64; 3],
}

impl SampleCells {
    /// Cells whose side is that of the samples' own times two to the power of `doublings`.
    pub fn new(samples: &Samples, doublings: u32) -> Self {
        let mut ranges = MortonMap::<(u32, u32)>::default();
        let (mut low, mut high) = ([u64::MAX; 3], [0; 3]);
        for (i, sample) in (0..).zip(&samples.all) {
            let key = sample.key >> (3 * doublings);
            let range = ranges.entry(key).or_insert((i, i));
            range.1 = i + 1;
            let cell = decode(key);
            low = std::array::from_fn(|a| cell[a].min(low[a]));
            high = std::array::from_fn(|a| cell[a].max(high[a]));
        }
        Self { lattice: samples.lattice(doublings), ranges, low, high }
    }

    /// Calls `each` with the numbers of the samples of every cell that the box touches.
    pub fn in_box(&self, low: [f32; 3], high: [f32; 3], mut each: impl FnMut(Range<usize>)) {
        // No further than there are samples: a box may be far larger than the scene.
        let (low, high) = (self.lattice.coordinates(low), self.lattice.coordinates(high));
        let low: [u64; 3] = std::array::from_fn(|a| low[a].max(self.low[a]));
        let high: [u64; 3] = std::array::from_fn(|a| high[a].min(self.high[a]));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    if let Some(&(from, to)) = self.ranges.get(&encode([x, y, z])) {
                        each(from as usize..to as usize);
                    }
                }
            }
        }
    }
}
