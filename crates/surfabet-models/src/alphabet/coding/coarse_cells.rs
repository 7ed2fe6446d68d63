//! What was said about occurrences near to a cell.

use std::collections::HashMap;

use surfabet_geom::cells::around;

/// What is looked at of a coarsest cell, the last said; reading a hostile file takes bounded time.
const REMEMBERED: usize = 128;

/// Something about each occurrence said so far, by the coarsest cells.
#[derive(Debug, Clone)]
pub(in crate::alphabet) struct Nearby<T> {
    scales: u32,
    by_cell: HashMap<[i32; 3], Vec<T>>,
}

impl<T> Nearby<T> {
    pub fn new(scales: u32) -> Self {
        Self { scales, by_cell: HashMap::new() }
    }

    fn coarse(&self, cell: [i32; 3], scale: u32) -> [i32; 3] {
        cell.map(|c| c >> (self.scales - 1 - scale))
    }

    pub fn add(&mut self, cell: [i32; 3], scale: u32, what: T) {
        self.by_cell.entry(self.coarse(cell, scale)).or_default().push(what);
    }

    /// What was added in the coarsest cell that holds a cell, and in the 26 around that one.
    pub fn about(&self, cell: [i32; 3], scale: u32) -> impl Iterator<Item = &T> {
        around(self.coarse(cell, scale))
            .filter_map(|cell| self.by_cell.get(&cell))
            .flat_map(|there| there.iter().rev().take(REMEMBERED))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_coarsest_cells_that_touch_are_looked_at() {
        let mut nearby = Nearby::new(3);
        // On scale 0, four cells make the side of a coarsest one.
        for x in 0..20 {
            nearby.add([x, 7, 7], 0, x);
        }
        let found = |cell, scale| {
            let mut found: Vec<i32> = nearby.about(cell, scale).copied().collect();
            found.sort_unstable();
            found
        };
        assert_eq!(found([8, 8, 8], 0), (4..16).collect::<Vec<i32>>());
        assert_eq!(found([2, 1, 1], 2), (4..16).collect::<Vec<i32>>());
        assert_eq!(found([2, 1, 3], 2), []);
    }

    #[test]
    fn of_many_the_last_are_remembered() {
        let mut nearby = Nearby::new(1);
        (0..1000).for_each(|k| nearby.add([5; 3], 0, k));
        let found: Vec<usize> = nearby.about([5; 3], 0).copied().collect();
        assert_eq!(found, (1000 - REMEMBERED..1000).rev().collect::<Vec<_>>());
    }
}
