//! Grouping of points and samples by the cubic cells of a grid.

use std::ops::{Range, RangeInclusive};

use surfabet_base::parallel;
pub(in crate::patches) use surfabet_geom::cells::cell_of;

use crate::groups::Groups;

/// Bits of a cell coordinate in a key.
pub(in crate::patches) const KEY_BITS: u32 = 21;

/// Cell coordinates are above `-LIMIT` and below `LIMIT`.
pub(in crate::patches) const LIMIT: i32 = 1 << (KEY_BITS - 1);

/// Integer cell coordinates as one number; sorts by x, then y, then z. Coordinates beyond the grid are taken to
/// its rim; callers check the extent of a cloud before.
pub(in crate::patches) fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, &c| key << KEY_BITS | (c.clamp(1 - LIMIT, LIMIT - 1) + LIMIT) as u64)
}

/// Items grouped by the keys of their cells.
pub(in crate::patches) struct CellGroups {
    /// Different keys, growing.
    keys: Vec<u64>,
    /// Items of each key, by growing number.
    groups: Groups,
}

impl CellGroups {
    /// Groups `count` items by `key`.
    pub fn new(count: usize, key: impl Fn(usize) -> u64 + Sync) -> Self {
        let mut keyed: Vec<(u64, u32)> = parallel::map_range(count, |i| (key(i), i as u32));
        parallel::sort_keyed(&mut keyed);
        let cells = || keyed.chunk_by(|a, b| a.0 == b.0);
        let n_cells = cells().count();
        let mut keys = Vec::with_capacity(n_cells);
        keys.extend(cells().map(|cell| cell[0].0));
        let mut groups = Groups::with_capacity(n_cells, count);
        groups.extend(cells().map(<[_]>::len), keyed.iter().map(|&(_, i)| i));
        Self { keys, groups }
    }

    /// Number of cells that hold items.
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Items of cell `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        self.groups.of(i)
    }

    /// The items of all cells, without their keys.
    pub fn into_groups(self) -> Groups {
        self.groups
    }

    /// The cells from number `start` on whose keys lie in a range; no cell before may lie in it. Quick where that is not far on.
    pub fn within(&self, start: usize, range: RangeInclusive<u64>) -> Range<usize> {
        let keys = &self.keys[start..];
        let mut stride = 1;
        while stride < keys.len() && keys[stride] < *range.start() {
            stride *= 2;
        }
        let (low, high) = (stride / 2, keys.len().min(stride + 1));
        let first = low + keys[low..high].partition_point(|key| key < range.start());
        let n = keys[first..].iter().take_while(|key| *key <= range.end()).count();
        start + first..start + first + n
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_is_within_a_range_is_found_from_any_earlier_cell(
            items in prop::collection::vec(0..60_u64, 0..40), low in 0..60_u64, length in 0..9_u64, back in 0..30_usize,
        ) {
            let cells = CellGroups::new(items.len(), |i| items[i]);
            let mut keys = items.clone();
            keys.sort_unstable();
            keys.dedup();
            let first = keys.partition_point(|&k| k < low);
            let found = cells.within(first.saturating_sub(back), low..=low + length);
            let inside = keys.iter().filter(|&&k| (low..=low + length).contains(&k)).count();
            prop_assert_eq!(found, first..first + inside);
        }
    }
}
