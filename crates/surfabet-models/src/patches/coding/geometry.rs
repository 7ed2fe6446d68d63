//! Sides, tiles, sheets and their hierarchies of squares.

use surfabet_entropy::{Cells, Coder};

use super::models::{GeometryModels, beside_context, split_context};
use super::surroundings::{SheetLeaf, SquarePlace, Surroundings};
use crate::patches::model::{Lattice, LatticePatch, MAX_DEPTH, MAX_TILE, SheetTree, Square};
use crate::patches::surface::leaf::Leaf;

/// Bits of the height of the quadtree over tiles.
const HEIGHT_BITS: u32 = 5;

/// Greatest height of the quadtree: all tiles from `-MAX_TILE` to `MAX_TILE`.
const MAX_HEIGHT: u32 = 21;

/// A base that no surface around suggests is coded in steps of this many depth steps.
const COARSE: i32 = 4;

/// Most sheets of a side over one tile: a reader searches all of them for every patch.
pub(in crate::patches) const MAX_SHEETS: usize = 1024;

/// The writer lets a sheet continue a surface around its tile when their depths differ by no more than this, in steps.
const NEAR_BASE: i32 = 16;

/// All sheets and their patches.
#[derive(Debug, Default)]
pub(in crate::patches) struct Geometry {
    /// By side, then along a space-filling curve of the tiles.
    pub sheets: Vec<SheetTree>,
    /// Their patches, in the order of the file.
    pub leaves: Vec<Leaf>,
}

/// Writes, reads or prices all sheets. When reading, none are `given`; in any case all come back. No more than
/// `max_patches` are read.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::patches) fn code_geometry<C: Coder>(
    coder: &mut C,
    models: &mut GeometryModels,
    lattice: Lattice,
    given: &[SheetTree],
    max_patches: usize,
) -> Result<Geometry, C::Error> {
    let mut walk = Walk {
        coder,
        models,
        around: Surroundings::new(lattice),
        sheets: Vec::with_capacity(given.len()),
        max_patches,
        lattice,
        last_base: 0,
    };
    for side in 0..6 {
        let from = given.partition_point(|r| r.side < side);
        let to = given.partition_point(|r| r.side <= side);
        walk.side(side, &given[from..to])?;
    }
    Ok(Geometry { sheets: walk.sheets, leaves: walk.around.into_leaves() })
}

/// The walk over all sheets, with what is known so far.
pub(super) struct Walk<'a, C> {
    pub coder: &'a mut C,
    pub models: &'a mut GeometryModels,
    pub around: Surroundings,
    sheets: Vec<SheetTree>,
    max_patches: usize,
    pub lattice: Lattice,
    /// Depth of the last sheet that continued no surface around, in steps.
    last_base: i32,
}

impl<C: Coder> Walk<'_, C> {
    /// All sheets of a side: whether there are any, the lowest tile, and tiles as the leaves of a quadtree.
    fn side(&mut self, side: u8, given: &[SheetTree]) -> Result<(), C::Error> {
        if !bypass_flag(self.coder, !given.is_empty())? {
            return Ok(());
        }
        let mut low = [0; 2];
        let mut span = 0_u32;
        for (a, low) in low.iter_mut().enumerate() {
            let least = given.iter().map(|r| r.tile[a]).min().unwrap_or(0);
            let most = given.iter().map(|r| r.tile[a]).max().unwrap_or(0);
            span = span.max((most - least) as u32);
            *low = self.coder.sint(&mut self.models.corner, least)?;
        }
        let code = |r: &SheetTree| morton(std::array::from_fn(|a| (r.tile[a] - low[a]) as u32));
        // When reading there is nothing to sort.
        let mut given: Vec<(u64, &SheetTree)> = given.iter().map(|r| (code(r), r)).collect();
        given.sort_by_key(|&(code, _)| code);
        let (codes, given): (Vec<u64>, Vec<&SheetTree>) = given.into_iter().unzip();
        let height = u32::BITS - span.leading_zeros();
        let height = self.coder.bypass(u64::from(height), HEIGHT_BITS)? as u32;
        if height > MAX_HEIGHT || low.iter().any(|l| l.unsigned_abs() > MAX_TILE as u32) {
            return Err(self
                .coder
                .corrupt(format!("tiles from {low:?} over 2^{height} are out of range")));
        }
        // Every tile holds a patch.
        let mut tiles = Cells::new(&codes, height, self.max_patches);
        while let Some(cell) = tiles.next(self.coder, &mut self.models.tiles)? {
            let tile = std::array::from_fn(|a| low[a] + cell.at[a] as i32);
            self.tile(side, tile, &given[cell.given])?;
        }
        Ok(())
    }

    /// The sheets of a tile, one after another.
    fn tile(&mut self, side: u8, tile: [i32; 2], given: &[&SheetTree]) -> Result<(), C::Error> {
        let more = given.len().saturating_sub(1) as u32;
        let n = self.coder.uint(&mut self.models.sheets, more)? as usize + 1;
        if n > self.max_patches.min(MAX_SHEETS)
            || tile.iter().any(|t| t.unsigned_abs() > MAX_TILE as u32)
        {
            return Err(self.coder.corrupt(format!("{n} sheets at tile {tile:?}")));
        }
        for i in 0..n {
            let given = given.get(i).map(|sheet| &sheet.root);
            let candidates = self.around.candidates(side, tile);
            let base = self.base(&candidates, given)?;
            let place = SquarePlace {
                side,
                level: 0,
                corner: tile.map(|t| t * self.lattice.tile_pixels()),
                sheet: self.sheets.len() as u32,
                base,
            };
            let root = self.square(place, given, true)?;
            self.sheets.push(SheetTree { side, tile, root });
        }
        self.around.finish_tile(side, tile);
        Ok(())
    }

    /// Base of a sheet, a depth in steps near its first patch: that of a surface around the tile which it continues, or
    /// one that is coded coarsely.
    fn base(&mut self, candidates: &[i32], given: Option<&Square>) -> Result<i32, C::Error> {
        let depth = given.map_or(0, first_depth);
        let nearest = (0..candidates.len()).min_by_key(|&i| (candidates[i] - depth).abs());
        let chosen = nearest.filter(|&i| (candidates[i] - depth).abs() <= NEAR_BASE);
        if !candidates.is_empty() {
            // Zero: none.
            let number = chosen.map_or(0, |i| i as u32 + 1);
            let number = self.coder.uint(&mut self.models.candidate, number)? as usize;
            if number > 0 {
                return candidates.get(number - 1).copied().ok_or_else(|| {
                    self.coder.corrupt(format!("surface {number} of {}", candidates.len()))
                });
            }
        }
        let coarse = i64::from((depth - self.last_base).div_euclid(COARSE)) as i32;
        let coarse = self.coder.sint(&mut self.models.base, coarse)?;
        let middle = i64::from(coarse) * i64::from(COARSE) + i64::from(COARSE / 2);
        let base = i64::from(self.last_base) + middle;
        let bound = i64::from(MAX_DEPTH);
        self.last_base = base.clamp(-bound, bound) as i32;
        Ok(self.last_base)
    }

    /// What stands at a square, and in the squares within. The root of a sheet is never empty.
    fn square(
        &mut self,
        place: SquarePlace,
        given: Option<&Square>,
        is_root: bool,
    ) -> Result<Square, C::Error> {
        let SquarePlace { level, corner: [u, v], .. } = place;
        let half = self.lattice.patch_width(level) / 2;
        let beside = [[u - 1, v + half], [u + half, v - 1]];
        let beside = beside.map(|pixel| self.around.state(&place, pixel));
        if !is_root {
            let model = &mut self.models.empty[beside_context(level, beside)];
            if self.coder.bit(model, matches!(given, Some(Square::Empty)))? {
                return Ok(Square::Empty);
            }
        }
        let prediction = self.around.predict(&place);
        if level + 1 < self.lattice.levels {
            let context = split_context(level, prediction.neighbours, prediction.finer);
            let is_split = matches!(given, Some(Square::Split(_)));
            if self.coder.bit(&mut self.models.split[context], is_split)? {
                return self.split(place, given);
            }
        }
        let given = match given {
            Some(Square::Patch(patch)) => **patch,
            _ => LatticePatch::default(),
        };
        let patch = self.patch(&place, beside, &prediction, &given)?;
        if self.around.len() == self.max_patches {
            return Err(self.coder.corrupt(format!("more than {} patches", self.max_patches)));
        }
        let SquarePlace { side, level, corner, sheet, .. } = place;
        self.around.add(SheetLeaf { leaf: Leaf { side, level, corner, patch }, sheet });
        Ok(Square::Patch(Box::new(patch)))
    }

    /// The four squares that a square is split in.
    fn split(&mut self, place: SquarePlace, given: Option<&Square>) -> Result<Square, C::Error> {
        let half = self.lattice.patch_width(place.level) / 2;
        let mut children: [Square; 4] = Default::default();
        for (child, square) in children.iter_mut().enumerate() {
            let offset = [child as i32 & 1, child as i32 >> 1];
            let corner = std::array::from_fn(|a| place.corner[a] + offset[a] * half);
            let below = SquarePlace { level: place.level + 1, corner, ..place };
            let given = match given {
                Some(Square::Split(of)) => Some(&of[child]),
                _ => None,
            };
            *square = self.square(below, given, false)?;
        }
        if children.iter().all(|c| *c == Square::Empty) {
            return Err(self.coder.corrupt("a split without patches".into()));
        }
        Ok(Square::Split(Box::new(children)))
    }
}

/// Depth of the first patch of a hierarchy.
pub(in crate::patches) fn first_depth(root: &Square) -> i32 {
    fn first(square: &Square) -> Option<i32> {
        match square {
            Square::Empty => None,
            Square::Patch(patch) => Some(patch.coefficients[0]),
            Square::Split(children) => children.iter().find_map(first),
        }
    }
    first(root).unwrap_or(0)
}

/// Place of a tile along the walk of the quadtree.
fn morton(tile: [u32; 2]) -> u64 {
    (0..u32::BITS).fold(0, |code, bit| {
        let of = |a: usize| u64::from(tile[a] >> bit & 1);
        code | of(0) << (2 * bit) | of(1) << (2 * bit + 1)
    })
}

pub(super) fn bypass_flag<C: Coder>(coder: &mut C, value: bool) -> Result<bool, C::Error> {
    Ok(coder.bypass(u64::from(value), 1)? != 0)
}
