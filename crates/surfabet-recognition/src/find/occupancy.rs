//! Which coarse cells hold a surface: most motions are tried against these alone.

use crate::constants::{MAX_CELLS, OCCUPANCY_LEVELS};
use crate::surface::SurfaceSamples;

/// Which cells hold a steep surface, and which a level one: a bit per cell each.
pub(super) struct Occupancy {
    low: [f32; 3],
    per_cell: f32,
    size: [usize; 3],
    steep: Vec<u64>,
    level: Vec<u64>,
}

impl Occupancy {
    /// Cells of at least `side` metres about the samples that count; cells that share a face with one that holds a
    /// sample are occupied too.
    pub fn new(surface: &SurfaceSamples, side: f64, counts: impl Fn(usize) -> bool) -> Self {
        let bound = |pick: fn(f32, f32) -> f32, from: f32| -> [f32; 3] {
            std::array::from_fn(|a| surface.points.iter().map(|p| p[a]).fold(from, pick))
        };
        let [low, high] = [bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY)];
        let mut side = side;
        let cells = |side: f64| -> [f64; 3] {
            std::array::from_fn(|a| (f64::from(high[a] - low[a]) / side).floor() + 5.0)
        };
        while cells(side).iter().product::<f64>() > MAX_CELLS {
            side *= 1.25;
        }
        let size = cells(side).map(|c| c as usize);
        let words = size.iter().product::<usize>().div_ceil(64);
        let mut grid = Self {
            low: low.map(|c| c - 2.0 * side as f32),
            per_cell: 1.0 / side as f32,
            size,
            steep: vec![0; words],
            level: vec![0; words],
        };
        for (i, (p, n)) in surface.points.iter().zip(&surface.normals).enumerate() {
            if !counts(i) {
                continue;
            }
            let cell: [usize; 3] =
                std::array::from_fn(|a| ((p[a] - grid.low[a]) * grid.per_cell) as usize);
            let middle = (cell[2] * size[1] + cell[1]) * size[0] + cell[0];
            let row = size[0];
            let layer = size[0] * size[1];
            // The bounds leave two cells around every sample.
            let around = [
                middle,
                middle - 1,
                middle + 1,
                middle - row,
                middle + row,
                middle - layer,
                middle + layer,
            ];
            for k in around {
                if n[2].abs() < OCCUPANCY_LEVELS[0] {
                    grid.steep[k / 64] |= 1 << (k % 64);
                }
                if n[2].abs() > OCCUPANCY_LEVELS[1] {
                    grid.level[k / 64] |= 1 << (k % 64);
                }
            }
        }
        grid
    }

    /// Whether the cell of a point holds a surface, level or steep.
    pub fn has(&self, p: [f32; 3], level: bool) -> bool {
        let cell: [f32; 3] = std::array::from_fn(|a| (p[a] - self.low[a]) * self.per_cell);
        if !(0..3).all(|a| cell[a] >= 0.0 && cell[a] < self.size[a] as f32) {
            return false;
        }
        let [x, y, z] = cell.map(|c| c as usize);
        let k = (z * self.size[1] + y) * self.size[0] + x;
        let bits = if level { &self.level } else { &self.steep };
        bits[k / 64] >> (k % 64) & 1 != 0
    }
}
