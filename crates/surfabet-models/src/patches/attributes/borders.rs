//! Colours and scalars at the borders of a tile.
//!
//! Each tile rounds its fields by itself, and its cells at a border are predicted from one side alone. So two tiles would miss
//! different things at the border between them. A tile therefore also codes what its cells at a border miss of what both tiles
//! know, the mean of what lies on both sides, per block of cells. These corrections are a field on the blocks, in steps of a
//! share of those of the cells. A cell takes those of the blocks around it, nearly the whole beside a face, and less with each
//! cell further. What is beyond a face need not be there: a tile decodes alone.

use surfabet_entropy::Coder;
use surfabet_geom::morton::{MortonMap, step};

use super::cells::{cell_of_key, index};
use super::field::{CellValues, FRACTION, FieldCoding, Steps, choose_field, code_field};
use super::wanted::Wanted;
use crate::patches::constants::{BORDER_BLOCK_BITS, BORDER_FINENESS};

/// Cells along the side of a block, and from a face to the first cell that is not corrected.
const BLOCK: i64 = 1 << BORDER_BLOCK_BITS;

/// Bits of a cell's key that are its place in the block.
const KEY_BITS: u32 = 3 * BORDER_BLOCK_BITS;

/// Parts of one that values are whole numbers of.
const UNIT: f32 = (1 << FRACTION) as f32;

/// The cube of a tile in cells of attributes, each a finest pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Border {
    /// Lowest cell.
    pub low: [i64; 3],
    /// Cells along each axis.
    pub side: i64,
}

impl Border {
    /// Cells from the nearest face to a cell; 0 for those beside a face, less than 0 beyond.
    fn depth(self, cell: [i32; 3]) -> i64 {
        let along = |a: usize| {
            let from = i64::from(cell[a]) - self.low[a];
            from.min(self.side - 1 - from)
        };
        (0..3).map(along).fold(i64::MAX, i64::min)
    }

    /// The axes along which a cell is the first beyond a face, and whether the tile lies up from it.
    pub(super) fn crossed(self, cell: [i32; 3]) -> impl Iterator<Item = (usize, bool)> {
        (0..3).filter_map(move |a| match i64::from(cell[a]) - self.low[a] {
            -1 => Some((a, true)),
            from if from == self.side => Some((a, false)),
            _ => None,
        })
    }

    /// Whether a cell is next to a face, on either side of it.
    pub(super) fn is_beside(self, cell: [i32; 3]) -> bool {
        matches!(self.depth(cell), -1 | 0)
    }
}

/// How the corrections of blocks are coded.
const OF_BLOCKS: FieldCoding = FieldCoding::Whole;

/// The cells of a field.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct FieldCells<'a> {
    /// Sorted keys.
    pub keys: &'a [u64],
    /// The blocks at the borders of a tile, where values are corrected there.
    pub border: Option<&'a BorderBlocks>,
    /// How their values are coded.
    pub coding: FieldCoding,
}

/// The blocks of cells at the borders of a tile.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct BorderBlocks {
    pub border: Border,
    /// Sorted keys.
    keys: Vec<u64>,
    places: MortonMap<u32>,
    /// Numbers of the cells that are corrected, growing, and how far from a face each is; 0 beyond.
    cells: Vec<(u32, i64)>,
}

/// What a file stores of a field: coefficients of the transform.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct Stored {
    of_cells: Vec<i32>,
    /// Of the corrections at the borders of a tile.
    of_blocks: Option<Vec<i32>>,
}

impl FieldCells<'_> {
    /// The values of least cost for those that are `wanted`, and what is stored of them; `lambda` is the squared error that a bit
    /// must save. `missed` gives what decoded values miss at the blocks of a border.
    pub(super) fn choose<const N: usize>(
        self,
        steps: Steps<N>,
        wanted: &Wanted<'_, N>,
        lambda: f32,
        missed: impl Fn(&BorderBlocks, &[[f32; N]]) -> Vec<[f32; N]>,
    ) -> (Vec<[f32; N]>, Stored) {
        let choose =
            |targets: &[[f32; N]]| choose_field(self.keys, steps, self.coding, targets, lambda);
        let first = choose(&wanted.at_first());
        let again = wanted.again(&first.values).map(|targets| choose(&targets));
        let CellValues { mut values, coefficients } = again.unwrap_or(first);
        let of_blocks = self.border.map(|border| {
            let missed = missed(border, &values);
            border.choose(steps, &missed, lambda, self.keys, &mut values)
        });
        (values, Stored { of_cells: coefficients, of_blocks })
    }

    /// Reads values, or writes or prices the given ones.
    ///
    /// # Errors
    /// Those of the coder.
    pub(super) fn code<C: Coder, const N: usize>(
        self,
        coder: &mut C,
        steps: Steps<N>,
        given: Option<&Stored>,
    ) -> Result<(Vec<[f32; N]>, Stored), C::Error> {
        let of_cells = given.map(|stored| stored.of_cells.as_slice());
        let CellValues { mut values, coefficients } =
            code_field(coder, self.keys, steps, self.coding, of_cells)?;
        let of_blocks = match self.border {
            Some(border) => {
                let given = given.and_then(|stored| stored.of_blocks.as_deref());
                Some(border.code(coder, steps, given, self.keys, &mut values)?)
            }
            None => None,
        };
        Ok((values, Stored { of_cells: coefficients, of_blocks }))
    }
}

impl BorderBlocks {
    /// Those of a tile with these sorted cells.
    pub fn new(border: Border, cells: &[u64]) -> Self {
        let (mut near, mut keys) = (Vec::new(), Vec::new());
        for (i, &key) in (0..).zip(cells) {
            let depth = border.depth(cell_of_key(key)).max(0);
            if depth < BLOCK {
                near.push((i, depth));
                keys.push(key >> KEY_BITS);
            }
        }
        keys.dedup();
        Self { border, places: index(&keys), keys, cells: near }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Number of the block of a cell.
    pub fn block_of(&self, cell: u64) -> Option<usize> {
        self.places.get(&(cell >> KEY_BITS)).map(|&block| block as usize)
    }

    /// The corrections of least cost for `missed`, what the cells beside a face miss in each block, added to `values`;
    /// `lambda` is the squared error that a bit must save of the cells.
    fn choose<const N: usize>(
        &self,
        steps: Steps<N>,
        missed: &[[f32; N]],
        lambda: f32,
        cells: &[u64],
        values: &mut [[f32; N]],
    ) -> Vec<i32> {
        // The cells beside a face take this share.
        let share = (2 * BLOCK - 1) as f32 / (2 * BLOCK) as f32;
        let scale = BORDER_FINENESS as f32 / share;
        let targets: Vec<[f32; N]> = missed.iter().map(|value| value.map(|c| scale * c)).collect();
        let CellValues { values: chosen, coefficients } =
            choose_field(&self.keys, steps, OF_BLOCKS, &targets, lambda);
        self.correct(&chosen, cells, values);
        coefficients
    }

    /// Reads corrections, or writes or prices the given ones, and adds them to `values`.
    ///
    /// # Errors
    /// Those of the coder.
    fn code<C: Coder, const N: usize>(
        &self,
        coder: &mut C,
        steps: Steps<N>,
        given: Option<&[i32]>,
        cells: &[u64],
        values: &mut [[f32; N]],
    ) -> Result<Vec<i32>, C::Error> {
        let coded = code_field(coder, &self.keys, steps, OF_BLOCKS, given)?;
        self.correct(&coded.values, cells, values);
        Ok(coded.coefficients)
    }

    /// Adds the corrections of the blocks, in parts of the fineness, to the values of the cells.
    fn correct<const N: usize>(
        &self,
        of_blocks: &[[f32; N]],
        cells: &[u64],
        values: &mut [[f32; N]],
    ) {
        let whole = |value: &[f32; N]| value.map(|c| (c * UNIT) as i64);
        let of_blocks: Vec<[i64; N]> = of_blocks.iter().map(whole).collect();
        for &(i, depth) in &self.cells {
            let (sum, total) = self.around(cells[i as usize], &of_blocks);
            let (share, unit) = (2 * (BLOCK - depth) - 1, 2 * BLOCK * BORDER_FINENESS * total);
            for c in 0..N {
                let correction = (2 * share * sum[c] + unit).div_euclid(2 * unit);
                values[i as usize][c] += correction as f32 / UNIT;
            }
        }
    }

    /// Weighted sum of the values of the blocks around a cell, trilinear between their middles, and that of the weights; blocks
    /// that do not exist are left out.
    fn around<const N: usize>(&self, cell: u64, of_blocks: &[[i64; N]]) -> ([i64; N], i64) {
        // Twice the way from the middle of the block to that of the cell.
        let off = cell_of_key(cell).map(|c| 2 * i64::from(c).rem_euclid(BLOCK) + 1 - BLOCK);
        let (mut sum, mut total) = ([0; N], 0);
        for corner in 0..8_usize {
            let displaced = (0..3).filter(|axis| corner >> axis & 1 != 0);
            let key = displaced.fold(cell >> KEY_BITS, |key, axis| step(key, axis, off[axis] > 0));
            let Some(&block) = self.places.get(&key) else { continue };
            let part = |axis: usize| match corner >> axis & 1 {
                0 => 2 * BLOCK - off[axis].abs(),
                _ => off[axis].abs(),
            };
            let weight = part(0) * part(1) * part(2);
            (0..N).for_each(|c| sum[c] += weight * of_blocks[block as usize][c]);
            total += weight;
        }
        (sum, total)
    }
}

#[cfg(test)]
mod tests {
    use surfabet_entropy::Price;

    use super::*;
    use crate::patches::attributes::cells::cell_key;

    const CUBE: Border = Border { low: [-16, 0, -16], side: 32 };

    /// Cells of a plane through the cube, two cells beyond it at one end.
    fn plane() -> Vec<u64> {
        let rows = (-16..18).flat_map(|x| (0..32).map(move |y| cell_key([x, y, 3])));
        let mut cells: Vec<u64> = rows.collect();
        cells.sort_unstable();
        cells
    }

    #[test]
    fn corrections_fade_away_from_the_faces() {
        let cells = plane();
        let blocks = BorderBlocks::new(CUBE, &cells);
        let ones = vec![[BORDER_FINENESS as f32; 1]; blocks.len()];
        let mut values = vec![[0.0]; cells.len()];
        blocks.correct(&ones, &cells, &mut values);
        for (&key, &[value]) in cells.iter().zip(&values) {
            let [x, y, _] = cell_of_key(key);
            let from = (x + 16).min(15 - x).min(y).min(31 - y).max(0);
            let expected = (1.0 - (from as f32 + 0.5) / BLOCK as f32).max(0.0);
            assert!((value - expected).abs() <= 0.5 / UNIT, "{x} {y}: {value}");
        }
    }

    #[test]
    fn what_was_missed_is_there_once_it_is_corrected() {
        let cells = plane();
        let blocks = BorderBlocks::new(CUBE, &cells);
        let steps = Steps([100]);
        // Smooth along the border.
        let missed: Vec<[f32; 1]> = (0..blocks.len()).map(|_| [7.0]).collect();
        let mut values = vec![[20.0]; cells.len()];
        let chosen = blocks.choose(steps, &missed, 1.0, &cells, &mut values);
        for (&key, [value]) in cells.iter().zip(&values) {
            if CUBE.is_beside(cell_of_key(key)) {
                let half_a_step = 0.5 * 100.0 / BORDER_FINENESS as f32;
                assert!((value - 27.0).abs() <= half_a_step, "{value}");
            }
        }
        let mut again = vec![[20.0]; cells.len()];
        let mut price = Price::default();
        let Ok(coded) = blocks.code(&mut price, steps, Some(&chosen), &cells, &mut again);
        assert_eq!(coded, chosen);
        assert_eq!(again, values);
    }
}
