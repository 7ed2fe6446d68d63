//! How the geometry is said in binary decisions: one function for writing, reading and pricing.

pub(in crate::patches) mod points;
pub(in crate::patches) mod surroundings;

use surfabet_entropy::{Bit, Cells, Coder, Quadtree, SInt, Symbols, UInt};

use crate::patches::coding::surroundings::{Place, Placed, Surroundings, UNKNOWN};
use crate::patches::model::{
    Lattice, LatticePatch, MAX_DEPTH, MAX_LEVELS, MAX_THICKNESS, MAX_TILE, Node, PATCH_PIXELS, Root,
};
use crate::patches::surface::basis::N_SHAPES;
use crate::patches::surface::leaf::Leaf;

/// Bits of the height of the quadtree over tiles.
const HEIGHT_BITS: u32 = 5;

/// Heights of the quadtree with models of their own.
const HEIGHTS: u32 = 3;

/// A depth that nothing around suggests is said to this many steps.
const COARSE: i32 = 4;

const LEVELS: usize = MAX_LEVELS as usize;

/// Every adaptive model of the geometry.
#[derive(Debug, Clone)]
pub(in crate::patches) struct GeometryModels {
    corner: SInt,
    tiles: Quadtree,
    sheets: UInt,
    candidate: UInt,
    base: SInt,
    pub(in crate::patches) empty: [Bit; LEVELS * 9],
    pub(in crate::patches) split: [Bit; LEVELS * 6],
    pub(in crate::patches) full: [Bit; LEVELS * 9],
    pub(in crate::patches) mask: Vec<Bit>,
    pub(in crate::patches) thickness: [SInt; 2],
    pub(in crate::patches) depth: [SInt; LEVELS * 3],
    pub(in crate::patches) last: [Symbols; LEVELS],
    pub(in crate::patches) shapes: Vec<SInt>,
    pub(in crate::patches) last_shape: [UInt; LEVELS],
}

impl Default for GeometryModels {
    fn default() -> Self {
        let last = || {
            Symbols::new(N_SHAPES as u32).expect("the number of shapes is the size of an alphabet")
        };
        Self {
            corner: SInt::new(),
            tiles: Quadtree::new(HEIGHTS),
            sheets: UInt::new(),
            candidate: UInt::new(),
            base: SInt::new(),
            empty: [Bit::new(); LEVELS * 9],
            split: [Bit::new(); LEVELS * 6],
            full: [Bit::new(); LEVELS * 9],
            mask: vec![Bit::with_memory(Bit::MAX_MEMORY); LEVELS * 81],
            thickness: [const { SInt::new() }; 2],
            depth: [const { SInt::new() }; LEVELS * 3],
            last: std::array::from_fn(|_| last()),
            shapes: vec![SInt::new(); LEVELS * N_SHAPES],
            last_shape: [const { UInt::new() }; LEVELS],
        }
    }
}

impl GeometryModels {
    /// Model of a mask pixel at a level, from the states of the pixels left, above, above left and above right.
    pub(in crate::patches) fn pixel(&mut self, level: u32, states: [usize; 4]) -> &mut Bit {
        &mut self.mask[pixel_index(level, states)]
    }
}

/// Place of the model of a mask pixel.
pub(in crate::patches) fn pixel_index(level: u32, states: [usize; 4]) -> usize {
    states.iter().fold(level as usize, |index, s| index * 3 + s)
}

/// All sheets as they were written, read or priced.
#[derive(Debug, Default)]
pub(in crate::patches) struct Said {
    pub roots: Vec<Root>,
    /// Their patches, in the order of the file.
    pub leaves: Vec<Leaf>,
}

/// Writes, reads or prices all sheets. When reading, none are `given`; in any case all come back. No more than `max_patches` are read.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::patches) fn code_geometry<C: Coder>(
    coder: &mut C,
    models: &mut GeometryModels,
    lattice: Lattice,
    given: &[Root],
    max_patches: usize,
) -> Result<Said, C::Error> {
    let mut writer = Sheets {
        coder,
        models,
        around: Surroundings::new(lattice),
        roots: Vec::with_capacity(given.len()),
        max_patches,
        levels: lattice.levels,
        tile_pixels: lattice.tile_pixels(),
        last_base: 0,
    };
    for side in 0..6 {
        let from = given.partition_point(|r| r.side < side);
        let to = given.partition_point(|r| r.side <= side);
        writer.side(side, &given[from..to])?;
    }
    Ok(Said { roots: writer.roots, leaves: writer.around.into_leaves() })
}

struct Sheets<'a, C> {
    coder: &'a mut C,
    models: &'a mut GeometryModels,
    around: Surroundings,
    roots: Vec<Root>,
    max_patches: usize,
    levels: u32,
    tile_pixels: i32,
    last_base: i32,
}

impl<C: Coder> Sheets<'_, C> {
    fn side(&mut self, side: u8, given: &[Root]) -> Result<(), C::Error> {
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
        let code = |r: &Root| morton(std::array::from_fn(|a| (r.tile[a] - low[a]) as u32));
        // When reading there is nothing to sort.
        let mut given: Vec<(u64, &Root)> = given.iter().map(|r| (code(r), r)).collect();
        given.sort_by_key(|&(code, _)| code);
        let (codes, given): (Vec<u64>, Vec<&Root>) = given.into_iter().unzip();
        let height = u32::BITS - span.leading_zeros();
        let height = self.coder.bypass(u64::from(height), HEIGHT_BITS)? as u32;
        if height > 21 || low.iter().any(|l| l.unsigned_abs() > MAX_TILE as u32) {
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

    fn tile(&mut self, side: u8, tile: [i32; 2], given: &[&Root]) -> Result<(), C::Error> {
        let more = given.len().saturating_sub(1) as u32;
        let n = self.coder.uint(&mut self.models.sheets, more)? as usize + 1;
        if n > self.max_patches.min(MAX_SHEETS)
            || tile.iter().any(|t| t.unsigned_abs() > MAX_TILE as u32)
        {
            return Err(self.coder.corrupt(format!("{n} sheets at tile {tile:?}")));
        }
        for i in 0..n {
            let root = given.get(i).copied();
            let candidates = self.around.candidates(side, tile);
            let base = self.base(&candidates, root)?;
            let place = Place {
                side,
                level: self.levels - 1,
                corner: tile.map(|t| t * self.tile_pixels),
                sheet: self.roots.len() as u32,
                base,
            };
            let node = self.node(place, root.map(|r| &r.node), true)?;
            self.roots.push(Root { side, tile, node });
        }
        self.around.finish_tile(side, tile);
        Ok(())
    }

    /// Depth that a sheet is said about: of a surface that reaches the tile, or anew.
    fn base(&mut self, candidates: &[i32], root: Option<&Root>) -> Result<i32, C::Error> {
        let depth = root.map_or(0, |r| first_depth(&r.node));
        let nearest = (0..candidates.len()).min_by_key(|&i| (candidates[i] - depth).abs());
        let chosen = nearest.filter(|&i| (candidates[i] - depth).abs() <= NEAR_BASE);
        if !candidates.is_empty() {
            let said = chosen.map_or(0, |i| i as u32 + 1);
            let read = self.coder.uint(&mut self.models.candidate, said)? as usize;
            if read > 0 {
                return match candidates.get(read - 1) {
                    Some(&base) => Ok(base),
                    None => {
                        Err(self.coder.corrupt(format!("surface {read} of {}", candidates.len())))
                    }
                };
            }
        }
        let coarse = i64::from((depth - self.last_base).div_euclid(COARSE)) as i32;
        let read = self.coder.sint(&mut self.models.base, coarse)?;
        let base =
            i64::from(self.last_base) + i64::from(read) * i64::from(COARSE) + i64::from(COARSE / 2);
        let bound = i64::from(MAX_DEPTH);
        self.last_base = base.clamp(-bound, bound) as i32;
        Ok(self.last_base)
    }

    fn node(
        &mut self,
        place: Place,
        given: Option<&Node>,
        is_root: bool,
    ) -> Result<Node, C::Error> {
        let level = place.level as usize;
        let width = PATCH_PIXELS << place.level;
        let [u, v] = place.corner;
        let west = self.around.state(&place, [u - 1, v + width / 2]);
        let north = self.around.state(&place, [u + width / 2, v - 1]);
        if !is_root {
            let model = &mut self.models.empty[level * 9 + west * 3 + north];
            if self.coder.bit(model, matches!(given, Some(Node::Empty)))? {
                return Ok(Node::Empty);
            }
        }
        let prediction = self.around.predict(&place);
        if level > 0 {
            let context = level * 6 + prediction.voices * 2 + prediction.finer;
            let is_split = matches!(given, Some(Node::Split(_)));
            if self.coder.bit(&mut self.models.split[context], is_split)? {
                let mut children: [Node; 4] = Default::default();
                for (child, node) in children.iter_mut().enumerate() {
                    let offset = [child as i32 & 1, child as i32 >> 1];
                    let corner = std::array::from_fn(|a| place.corner[a] + offset[a] * width / 2);
                    let below = Place { level: place.level - 1, corner, ..place };
                    let given = match given {
                        Some(Node::Split(of)) => Some(&of[child]),
                        _ => None,
                    };
                    *node = self.node(below, given, false)?;
                }
                if children.iter().all(|c| *c == Node::Empty) {
                    return Err(self.coder.corrupt("a split without patches".into()));
                }
                return Ok(Node::Split(Box::new(children)));
            }
        }
        let given = match given {
            Some(Node::Leaf(patch)) => *patch,
            _ => LatticePatch::default(),
        };
        let mask = self.mask(&place, [west, north], given.mask)?;
        let mut patch = LatticePatch { mask, ..LatticePatch::default() };
        let difference = given.coefficients[0] - prediction.depth;
        let context = level * 3 + prediction.voices;
        let depth = i64::from(self.coder.sint(&mut self.models.depth[context], difference)?)
            + i64::from(prediction.depth);
        if depth.abs() > i64::from(MAX_DEPTH) {
            return Err(self.coder.corrupt(format!("a patch at depth {depth}")));
        }
        patch.coefficients[0] = depth as i32;
        self.shapes(level, &given, &mut patch)?;
        let difference = i32::from(given.thickness) - prediction.thickness;
        let model = &mut self.models.thickness[usize::from(prediction.voices > 0)];
        let thickness =
            i64::from(prediction.thickness) + i64::from(self.coder.sint(model, difference)?);
        if !(0..=i64::from(MAX_THICKNESS)).contains(&thickness) {
            return Err(self
                .coder
                .corrupt(format!("a half thickness of {thickness} quarter pixels")));
        }
        patch.thickness = thickness as u8;
        if self.around.len() == self.max_patches {
            return Err(self.coder.corrupt(format!("more than {} patches", self.max_patches)));
        }
        let Place { side, level, corner, sheet, .. } = place;
        self.around.add(Placed { leaf: Leaf { side, level, corner, patch }, sheet });
        Ok(Node::Leaf(patch))
    }

    fn mask(&mut self, place: &Place, beside: [usize; 2], given: u64) -> Result<u64, C::Error> {
        let level = place.level;
        let full = &mut self.models.full[level as usize * 9 + beside[0] * 3 + beside[1]];
        if self.coder.bit(full, given == u64::MAX)? {
            return Ok(u64::MAX);
        }
        let mut mask = 0_u64;
        for bit in 0..64_i32 {
            let (column, row) = (bit % PATCH_PIXELS, bit / PATCH_PIXELS);
            let state = |around: &Surroundings, du: i32, dv: i32| {
                let (c, r) = (column + du, row + dv);
                if (0..PATCH_PIXELS).contains(&c) && r >= 0 {
                    (mask >> (PATCH_PIXELS * r + c) & 1) as usize
                } else {
                    // The pixel next to the border, at the middle of the cell beyond.
                    let near = |x: i32| match x {
                        x if x < 0 => -1,
                        x if x >= PATCH_PIXELS => PATCH_PIXELS << level,
                        x => (x << level) + (1 << level) / 2,
                    };
                    around.state(place, [place.corner[0] + near(c), place.corner[1] + near(r)])
                }
            };
            let around = &self.around;
            let states = [
                state(around, -1, 0),
                state(around, 0, -1),
                state(around, -1, -1),
                state(around, 1, -1),
            ];
            let set = self.coder.bit(self.models.pixel(level, states), given >> bit & 1 != 0)?;
            mask |= u64::from(set) << bit;
        }
        if mask == 0 {
            return Err(self.coder.corrupt("a patch without pixels".into()));
        }
        Ok(mask)
    }

    fn shapes(
        &mut self,
        level: usize,
        given: &LatticePatch,
        patch: &mut LatticePatch,
    ) -> Result<(), C::Error> {
        let last = (1..N_SHAPES).rev().find(|&k| given.coefficients[k] != 0).unwrap_or(0);
        let last = self.coder.symbol(&mut self.models.last[level], last as u32)? as usize;
        for k in 1..last {
            let model = &mut self.models.shapes[level * N_SHAPES + k];
            patch.coefficients[k] = self.coder.sint(model, given.coefficients[k])?;
        }
        if last > 0 {
            let given = given.coefficients[last];
            let magnitude = given.unsigned_abs().saturating_sub(1);
            let magnitude = self.coder.uint(&mut self.models.last_shape[level], magnitude)?;
            let negative = bypass_flag(self.coder, given < 0)?;
            if magnitude >= MAX_DEPTH as u32 {
                return Err(self.coder.corrupt(format!("a coefficient of {magnitude} steps")));
            }
            let value = magnitude as i32 + 1;
            patch.coefficients[last] = if negative { -value } else { value };
        }
        if let Some(c) = patch.coefficients.iter().find(|c| c.unsigned_abs() > MAX_DEPTH as u32) {
            return Err(self.coder.corrupt(format!("a coefficient of {c} steps")));
        }
        Ok(())
    }
}

/// Most sheets of a side over one tile: a reader looks at all of them for every patch.
pub(in crate::patches) const MAX_SHEETS: usize = 1024;

/// A sheet is said about a surface around it when no further than this from it, in steps.
const NEAR_BASE: i32 = 16;

/// Depth of the first patch of a hierarchy.
fn first_depth(node: &Node) -> i32 {
    fn first(node: &Node) -> Option<i32> {
        match node {
            Node::Empty => None,
            Node::Leaf(patch) => Some(patch.coefficients[0]),
            Node::Split(children) => children.iter().find_map(first),
        }
    }
    first(node).unwrap_or(0)
}

/// Place along the quadtree's walk.
fn morton(tile: [u32; 2]) -> u64 {
    (0..u32::BITS).fold(0, |code, bit| {
        let of = |a: usize| u64::from(tile[a] >> bit & 1);
        code | of(0) << (2 * bit) | of(1) << (2 * bit + 1)
    })
}

fn bypass_flag<C: Coder>(coder: &mut C, value: bool) -> Result<bool, C::Error> {
    Ok(coder.bypass(u64::from(value), 1)? != 0)
}

const _: () = assert!(UNKNOWN == 2);
