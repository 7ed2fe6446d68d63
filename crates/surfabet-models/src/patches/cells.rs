//! Points by cell, for looking up what lies in a box.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

use super::samples::{Lattice, Samples, morton};

/// Hash of a Morton code: multiplied with the golden ratio, which spreads neighbouring codes. Which cells a
/// file makes us look up is no secret to defend, and the lookup's order never matters.
#[derive(Default)]
struct MortonHasher(u64);

impl Hasher for MortonHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, value: u64) {
        let product = (self.0 ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = product ^ (product >> 32);
    }
}

/// The samples of a cloud by cells of several of theirs.
pub(super) struct Cells {
    lattice: Lattice,
    ranges: HashMap<u64, (u32, u32), BuildHasherDefault<MortonHasher>>,
}

impl Cells {
    /// Cells whose side is that of the samples' own times two to the power of `doublings`.
    pub fn new(samples: &Samples, doublings: u32) -> Self {
        let mut ranges: HashMap<u64, (u32, u32), _> = HashMap::default();
        for (i, sample) in (0..).zip(&samples.all) {
            let range = ranges.entry(sample.key >> (3 * doublings)).or_insert((i, i));
            range.1 = i + 1;
        }
        Self { lattice: samples.lattice(doublings), ranges }
    }

    /// Calls `each` with the places of the samples of every cell that the box touches.
    pub fn in_box(&self, low: [f32; 3], high: [f32; 3], mut each: impl FnMut(Range<usize>)) {
        let (low, high) = (self.lattice.coordinates(low), self.lattice.coordinates(high));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    if let Some(&(from, to)) = self.ranges.get(&morton([x, y, z])) {
                        each(from as usize..to as usize);
                    }
                }
            }
        }
    }
}
