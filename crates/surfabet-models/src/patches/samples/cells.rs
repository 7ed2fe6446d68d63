//! Sorting things into the cubic cells of a grid.

use rayon::prelude::*;
pub(in crate::patches) use surfabet_geom::cells::cell_of;

use crate::groups::Groups;

/// Bits of a cell coordinate in a key.
const KEY_BITS: u32 = 21;

/// Cell coordinates are above `-LIMIT` and below `LIMIT`.
pub(in crate::patches) const LIMIT: i32 = 1 << (KEY_BITS - 1);

/// Integer cell coordinates as one number; sorts by x, then y, then z. Coordinates beyond the grid are taken to
/// its rim; callers check the extent of a cloud before.
pub(in crate::patches) fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, &c| key << KEY_BITS | (c.clamp(1 - LIMIT, LIMIT - 1) + LIMIT) as u64)
}

/// Things grouped by the keys of their cells.
pub(in crate::patches) struct Cells {
    /// Different keys, growing.
    keys: Vec<u64>,
    /// Things of each key, by growing number.
    groups: Groups,
}

impl Cells {
    /// Groups `count` things by `key`.
    pub fn new(count: usize, key: impl Fn(usize) -> u64 + Sync) -> Self {
        let mut keyed: Vec<(u64, u32)> =
            (0..count).into_par_iter().map(|i| (key(i), i as u32)).collect();
        keyed.par_sort_unstable();
        let (keys, sizes): (Vec<u64>, Vec<usize>) =
            keyed.chunk_by(|a, b| a.0 == b.0).map(|run| (run[0].0, run.len())).unzip();
        let mut groups = Groups::with_capacity(count);
        groups.extend(&sizes, keyed.into_iter().map(|(_, i)| i));
        Self { keys, groups }
    }

    /// Number of cells with anything in them.
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Things of cell `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        self.groups.of(i)
    }

    /// Place of the cell with this key.
    pub fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }
}
