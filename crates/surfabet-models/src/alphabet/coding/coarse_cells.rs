//! Items of the occurrences coded so far, found by the cell that they belong to.

use std::collections::HashMap;

use surfabet_geom::cells;

/// Items of one coarsest cell that are looked up at most, the last ones coded: reading a hostile file takes bounded
/// time. Part of the format.
const MAX_PER_CELL: usize = 128;

/// An item for each occurrence coded so far, by coarsest cell.
#[derive(Debug, Clone)]
pub(super) struct CoarseCells<T> {
    scales: u32,
    items: HashMap<[i32; 3], Vec<T>>,
}

impl<T> CoarseCells<T> {
    pub fn new(scales: u32) -> Self {
        Self { scales, items: HashMap::new() }
    }

    /// The coarsest cell that holds a cell of `scale`.
    fn coarsest(&self, cell: [i32; 3], scale: u32) -> [i32; 3] {
        cell.map(|c| c >> (self.scales - 1 - scale))
    }

    pub fn insert(&mut self, cell: [i32; 3], scale: u32, item: T) {
        self.items.entry(self.coarsest(cell, scale)).or_default().push(item);
    }

    /// The items in the coarsest cell that holds a cell, and in the 26 around that one, the last of each cell first.
    pub fn around(&self, cell: [i32; 3], scale: u32) -> impl Iterator<Item = &T> {
        cells::around(self.coarsest(cell, scale))
            .filter_map(|cell| self.items.get(&cell))
            .flat_map(|items| items.iter().rev().take(MAX_PER_CELL))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_coarsest_cells_that_touch_are_searched() {
        let mut cells = CoarseCells::new(3);
        // On scale 0, four cells make the side of a coarsest one.
        for x in 0..20 {
            cells.insert([x, 7, 7], 0, x);
        }
        let found = |cell, scale| {
            let mut found: Vec<i32> = cells.around(cell, scale).copied().collect();
            found.sort_unstable();
            found
        };
        assert_eq!(found([8, 8, 8], 0), (4..16).collect::<Vec<i32>>());
        assert_eq!(found([2, 1, 1], 2), (4..16).collect::<Vec<i32>>());
        assert_eq!(found([2, 1, 3], 2), []);
    }

    #[test]
    fn of_many_the_last_are_found() {
        let mut cells = CoarseCells::new(1);
        (0..1000).for_each(|k| cells.insert([5; 3], 0, k));
        let found: Vec<usize> = cells.around([5; 3], 0).copied().collect();
        assert_eq!(found, (1000 - MAX_PER_CELL..1000).rev().collect::<Vec<_>>());
    }
}
