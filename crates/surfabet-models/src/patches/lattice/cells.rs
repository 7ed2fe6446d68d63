//! Sorting things into the cubic cells of a grid.

use rayon::prelude::*;

/// Bits of a cell coordinate in a key.
const KEY_BITS: u32 = 21;

/// Cell coordinates are above `-LIMIT` and below `LIMIT`.
pub(super) const LIMIT: i32 = 1 << (KEY_BITS - 1);

/// Integer cell coordinates as one number; sorts by x, then y, then z. Coordinates beyond the grid are taken to
/// its rim; callers check the extent of a cloud before.
pub(super) fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, &c| key << KEY_BITS | (c.clamp(1 - LIMIT, LIMIT - 1) + LIMIT) as u64)
}

/// Cell of a position in a grid of cells of side `size`.
pub(super) fn cell_of(p: [f32; 3], size: f32) -> [i32; 3] {
    p.map(|c| (c / size).floor() as i32)
}

/// Things grouped by their keys.
pub(super) struct Groups {
    /// Different keys, growing.
    pub keys: Vec<u64>,
    /// Things of group i are `order[starts[i]..starts[i + 1]]`, by growing number.
    pub starts: Vec<u32>,
    /// Numbers of the things.
    pub order: Vec<u32>,
}

impl Groups {
    /// Groups `count` things by `key`.
    pub fn new(count: usize, key: impl Fn(usize) -> u64 + Sync) -> Self {
        let mut keyed: Vec<(u64, u32)> =
            (0..count).into_par_iter().map(|i| (key(i), i as u32)).collect();
        keyed.par_sort_unstable();
        let mut keys = Vec::new();
        let mut starts = Vec::new();
        for (place, (key, _)) in (0..).zip(&keyed) {
            if keys.last() != Some(key) {
                keys.push(*key);
                starts.push(place);
            }
        }
        starts.push(keyed.len() as u32);
        Self { keys, starts, order: keyed.into_iter().map(|(_, i)| i).collect() }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Things of group `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.order[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Group with this key.
    pub fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }
}
