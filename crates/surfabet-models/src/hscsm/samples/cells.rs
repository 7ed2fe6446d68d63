//! Samples by cell, to find those in a box.

use std::ops::Range;

use surfabet_geom::morton::{MortonMap, encode};

use crate::hscsm::samples::{CellLattice, Samples};

/// The samples of a cloud by larger cells.
pub(in crate::hscsm) struct SampleCells {
    lattice: CellLattice,
    ranges: MortonMap<(u32, u32)>,
}

impl SampleCells {
    /// Cells whose side is that of the samples' own times two to the power of `doublings`.
    pub fn new(samples: &Samples, doublings: u32) -> Self {
        let mut ranges = MortonMap::<(u32, u32)>::default();
        for (i, sample) in (0..).zip(&samples.all) {
            let range = ranges.entry(sample.key >> (3 * doublings)).or_insert((i, i));
            range.1 = i + 1;
        }
        Self { lattice: samples.lattice(doublings), ranges }
    }

    /// Calls `each` with the numbers of the samples of every cell that the box touches.
    pub fn in_box(&self, low: [f32; 3], high: [f32; 3], mut each: impl FnMut(Range<usize>)) {
        let (low, high) = (self.lattice.coordinates(low), self.lattice.coordinates(high));
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
