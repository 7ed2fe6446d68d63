//! The cells that a position takes its attributes from, and their weights.

use surfabet_base::rounding::floor_f32;
use surfabet_geom::morton::{MortonMap, step};

use super::cells::cell_key;

/// The cells around a position and their weights; none without cells.
pub(in crate::patches) struct Weighted {
    cells: [u32; 8],
    weights: [f32; 8],
    n: usize,
    /// Sum of the weights.
    pub total: f32,
}

impl Weighted {
    /// Without cells.
    pub const NONE: Self = Self { cells: [0; 8], weights: [0.0; 8], n: 0, total: 0.0 };

    /// Adds a cell; at most eight.
    fn push(&mut self, cell: u32, weight: f32) {
        (self.cells[self.n], self.weights[self.n]) = (cell, weight);
        self.n += 1;
        self.total += weight;
    }

    /// One cell alone.
    pub fn only(cell: u32) -> Self {
        let mut found = Self::NONE;
        found.push(cell, 1.0);
        found
    }

    /// Cells and weights.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        let cells = self.cells[..self.n].iter().map(|&cell| cell as usize);
        cells.zip(self.weights)
    }

    /// Weighted mean of the values of the cells; zero without any.
    pub fn mean<const N: usize>(&self, value: impl Fn(usize) -> [f32; N]) -> [f32; N] {
        let mut sum = [0.0; N];
        for (cell, weight) in self.iter() {
            let value = value(cell);
            (0..N).for_each(|c| sum[c] += weight * value[c]);
        }
        if self.n == 0 { sum } else { sum.map(|s| s / self.total) }
    }

    /// The cell with the largest weight, of equals the first.
    pub fn heaviest(&self) -> Option<usize> {
        let heavier = |a: (usize, f32), b: (usize, f32)| if b.1 > a.1 { b } else { a };
        self.iter().reduce(heavier).map(|(cell, _)| cell)
    }
}

/// No cell at a corner.
const NO_CELL: u32 = u32::MAX;

/// Finds the cells around positions, and remembers those of the last.
pub(in crate::patches) struct Corners<'a> {
    places: &'a MortonMap<u32>,
    slots: Vec<(u64, [u32; 8])>,
}

impl<'a> Corners<'a> {
    /// Slots; a patch passes through a few hundred cubes.
    const SIZE: usize = 1 << 10;

    /// Numbers of the cells by key.
    pub fn new(places: &'a MortonMap<u32>) -> Self {
        // No key has its highest bit set.
        Self { places, slots: vec![(u64::MAX, [NO_CELL; 8]); Self::SIZE] }
    }

    /// The cells around a position (pixels) with their trilinear weights: of the eight between whose middles it is those that
    /// there are. None where these hardly count.
    pub fn around(&mut self, position: [f32; 3]) -> Weighted {
        let shifted = position.map(|c| c - 0.5);
        let low = shifted.map(floor_f32);
        let part: [f32; 3] = std::array::from_fn(|a| shifted[a] - low[a] as f32);
        let corners = self.at(cell_key(low));
        let mut found = Weighted::NONE;
        for (corner, &place) in corners.iter().enumerate() {
            if place != NO_CELL {
                let side = |a: usize| if corner >> a & 1 != 0 { part[a] } else { 1.0 - part[a] };
                found.push(place, side(0) * side(1) * side(2));
            }
        }
        if found.total > 1e-6 { found } else { Weighted::NONE }
    }

    /// Numbers of the cell `low` and its seven successors; [`NO_CELL`] for those that there are not.
    fn at(&mut self, low: u64) -> &[u32; 8] {
        let slot = &mut self.slots[(low ^ low >> 10 ^ low >> 20) as usize % Self::SIZE];
        if slot.0 != low {
            let corner = |corner: usize| {
                let along = (0..3).filter(|a| corner >> a & 1 != 0);
                let key = along.fold(low, |key, axis| step(key, axis, true));
                self.places.get(&key).copied().unwrap_or(NO_CELL)
            };
            *slot = (low, std::array::from_fn(corner));
        }
        &slot.1
    }
}
