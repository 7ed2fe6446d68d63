//! The kept points near an occurrence, where all are placed at once.

use std::collections::HashMap;

use surfabet_geom::cells::cell_of;

/// Kept points by cells as wide as the largest distance that is asked for.
#[derive(Debug, Clone)]
pub(super) struct KeptGrid {
    side: f32,
    cells: HashMap<[i32; 3], Vec<[f32; 3]>>,
}

impl KeptGrid {
    /// Without points, for distances of up to `reach` metres.
    pub fn new(reach: f32) -> Self {
        Self { side: reach, cells: HashMap::new() }
    }

    /// Calls `visit` for every point within the reach of `middle`.
    pub fn visit_near(&self, middle: [f32; 3], mut visit: impl FnMut([f32; 3])) {
        let limit = self.side * self.side;
        let cell = self.cell(middle);
        for k in 0..27 {
            let around = [k % 3, k / 3 % 3, k / 9];
            let at: [i32; 3] = std::array::from_fn(|a| cell[a].saturating_add(around[a] - 1));
            for &p in self.cells.get(&at).into_iter().flatten() {
                let d: [f32; 3] = std::array::from_fn(|a| p[a] - middle[a]);
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= limit {
                    visit(p);
                }
            }
        }
    }

    /// Adds a point.
    pub fn insert(&mut self, position: [f32; 3]) {
        self.cells.entry(self.cell(position)).or_default().push(position);
    }

    fn cell(&self, position: [f32; 3]) -> [i32; 3] {
        cell_of(position, self.side)
    }
}
