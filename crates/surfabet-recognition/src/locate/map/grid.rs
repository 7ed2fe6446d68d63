//! Dense grids of cells over the box of a map.

use surfabet_geom::cells::cell_of;

/// The cells of side `cell` from a lowest corner on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::locate) struct Lattice {
    /// Lowest corner, metres about the map's origin.
    pub low: [f32; 3],
    /// Side of a cell, metres.
    pub cell: f32,
    /// Cells per metre.
    per_metre: f32,
    /// Cells per axis.
    pub size: [i32; 3],
}

impl Lattice {
    pub fn new(low: [f32; 3], cell: f32, size: [i32; 3]) -> Self {
        Self { low, cell, per_metre: 1.0 / cell, size }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.size.iter().map(|&n| n as usize).product()
    }

    /// The cell of a position, also outside.
    #[inline]
    pub fn cell_of(&self, p: [f32; 3]) -> [i32; 3] {
        let cells = std::array::from_fn(|a| (p[a] - self.low[a]) * self.per_metre);
        cell_of(cells, 1.0)
    }

    /// Where a cell stands in memory, x fastest; `None` outside.
    #[inline]
    pub fn index(&self, [x, y, z]: [i32; 3]) -> Option<usize> {
        let [nx, ny, nz] = self.size;
        let is_inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
        is_inside.then(|| ((z as usize * ny as usize) + y as usize) * nx as usize + x as usize)
    }

    /// Middle of a cell.
    pub fn middle(&self, cell: [i32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| self.low[a] + (cell[a] as f32 + 0.5) * self.cell)
    }
}
