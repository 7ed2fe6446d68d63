//! Grouping of points and samples by the cubic cells of a grid.

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

    /// Number of the cell with this key.
    pub fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }
}
