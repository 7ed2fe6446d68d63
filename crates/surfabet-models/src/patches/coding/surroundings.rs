//! Predictions for a square from the patches that were coded before it.

use rustc_hash::{FxHashMap, FxHashSet};

use super::models::UNKNOWN;
use crate::patches::model::{Lattice, MAX_DEPTH, PATCH_PIXELS, THICKNESS_STEPS};
use crate::patches::surface::basis::{Basis, FRACTION};
use crate::patches::surface::leaf::Leaf;

/// A patch of another sheet continues the surface when their depths differ by at most this many finest pixels.
const REACH: i64 = 8;

/// Half thickness that the first patch is predicted to have: one pixel.
const FIRST_THICKNESS: i32 = THICKNESS_STEPS as i32;

/// sqrt(3) with the fraction of the shapes.
const ROOT_3: i64 = 7094;

/// Most depths that the surroundings of a tile suggest.
const MAX_CANDIDATES: usize = 12;

/// A patch of a sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct SheetLeaf {
    pub leaf: Leaf,
    /// Number of the sheet.
    pub sheet: u32,
}

/// Where a square lies, and in which sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct SquarePlace {
    pub side: u8,
    pub level: u32,
    /// First column and row, in pixels of the finest level.
    pub corner: [i32; 2],
    /// Number of the sheet.
    pub sheet: u32,
    /// Base of the sheet, in depth steps.
    pub base: i32,
}

/// What the patches beside a square predict for it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Prediction {
    /// Depth of the middle, in steps.
    pub depth: i32,
    /// Half thickness, in steps.
    pub thickness: i32,
    /// Number of patches beside the square, at most 2.
    pub neighbours: usize,
    /// Whether any of them is of a finer level.
    pub finer: bool,
}

/// All patches coded so far, by where they lie.
pub(super) struct Surroundings {
    lattice: Lattice,
    bases: Vec<Basis>,
    patches: Vec<SheetLeaf>,
    /// Patches by side and square of 8 x 8 finest pixels.
    by_block: FxHashMap<(u8, i32, i32), Vec<u32>>,
    /// Side and tile of which all sheets are coded.
    finished: FxHashSet<(u8, [i32; 2])>,
    /// Largest difference of depths on one surface, in steps with fraction.
    reach: i64,
    /// Thickness of the patch before.
    thickness: i32,
}

impl Surroundings {
    /// Surroundings without patches.
    pub fn new(lattice: Lattice) -> Self {
        Self {
            lattice,
            bases: Basis::of_levels(lattice.levels),
            patches: Vec::new(),
            by_block: FxHashMap::default(),
            finished: FxHashSet::default(),
            reach: (REACH << (FRACTION + 4)) / i64::from(lattice.depth_step),
            thickness: FIRST_THICKNESS,
        }
    }

    /// Number of patches so far.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// All patches, in the order in which they were added.
    pub fn into_leaves(self) -> Vec<Leaf> {
        self.patches.into_iter().map(|patch| patch.leaf).collect()
    }

    /// Adds the patch that was coded last.
    pub fn add(&mut self, patch: SheetLeaf) {
        let index = self.patches.len() as u32;
        let leaf = patch.leaf;
        let block = leaf.corner.map(|c| c.div_euclid(PATCH_PIXELS));
        let blocks = 1 << self.lattice.doublings(leaf.level);
        for bv in block[1]..block[1] + blocks {
            for bu in block[0]..block[0] + blocks {
                self.by_block.entry((leaf.side, bu, bv)).or_default().push(index);
            }
        }
        self.thickness = i32::from(leaf.patch.thickness);
        self.patches.push(patch);
    }

    /// Marks a tile: all of its sheets are coded.
    pub fn finish_tile(&mut self, side: u8, tile: [i32; 2]) {
        self.finished.insert((side, tile));
    }

    /// Depth of a patch at a position in half pixels, in steps with fraction. Outside of the patch it is that of its
    /// tilted plane, `c_0 + c_1 P_1(x) + c_2 P_1(y)` with `P_1(x) = sqrt(3) x`.
    fn depth(&self, leaf: &Leaf, half: [i32; 2]) -> i64 {
        let local: [i32; 2] = std::array::from_fn(|a| half[a] - 2 * leaf.corner[a]);
        let (c, limit) = (&leaf.patch.coefficients, 2 * self.lattice.patch_width(leaf.level));
        if local.iter().all(|&x| (0..=limit).contains(&x)) {
            return self.bases[leaf.level as usize].depth(c, local.map(|x| x as usize));
        }
        let along = |a: usize| i64::from(2 * local[a] - limit) * ROOT_3 / i64::from(limit);
        (i64::from(c[0]) << FRACTION) + i64::from(c[1]) * along(0) + i64::from(c[2]) * along(1)
    }

    /// The patch that a finest pixel lies in: the one of the square's own sheet, or the one of another sheet whose depth
    /// there is nearest to the base and within [`REACH`] of it.
    fn at(&self, place: &SquarePlace, pixel: [i32; 2]) -> Option<&Leaf> {
        let block = pixel.map(|c| c.div_euclid(PATCH_PIXELS));
        let found = self.by_block.get(&(place.side, block[0], block[1]))?;
        let half = pixel.map(|c| 2 * c + 1);
        let mut best: Option<(&Leaf, i64)> = None;
        for &i in found {
            let SheetLeaf { leaf, sheet } = &self.patches[i as usize];
            if *sheet == place.sheet {
                return Some(leaf);
            }
            let off = (self.depth(leaf, half) - (i64::from(place.base) << FRACTION)).abs();
            if off <= self.reach && best.is_none_or(|(_, b)| off < b) {
                best = Some((leaf, off));
            }
        }
        best.map(|(leaf, _)| leaf)
    }

    /// State of a finest pixel as a square of this sheet sees it: 0 unset, 1 set, or [`UNKNOWN`].
    pub fn state(&self, place: &SquarePlace, pixel: [i32; 2]) -> usize {
        if let Some(leaf) = self.at(place, pixel) {
            return usize::from(leaf.is_set(
                &self.lattice,
                pixel[0] - leaf.corner[0],
                pixel[1] - leaf.corner[1],
            ));
        }
        let width = self.lattice.tile_pixels();
        let tile = pixel.map(|c| c.div_euclid(width));
        let own = place.corner.map(|c| c.div_euclid(width));
        // Within the own tile, what comes earlier in the order of squares and has no patch is empty.
        if self.finished.contains(&(place.side, tile)) || tile == own { 0 } else { UNKNOWN }
    }

    /// Depth and thickness of the patches beside a square: the mean of their depths, continued to its middle, and of
    /// their thicknesses. Without any, its base and the thickness of the patch before.
    pub fn predict(&self, place: &SquarePlace) -> Prediction {
        let width = self.lattice.patch_width(place.level);
        let [u, v] = place.corner;
        let middle = width / 2;
        let beside = [
            [u - 1, v + middle],
            [u + middle, v - 1],
            [u + width, v + middle],
            [u + middle, v + width],
        ];
        let center = [2 * u + width, 2 * v + width];
        let (mut depth, mut thickness, mut n, mut finer) = (0_i64, 0, 0_i64, false);
        for pixel in beside {
            let Some(leaf) = self.at(place, pixel) else { continue };
            depth += self.depth(leaf, center);
            thickness += i32::from(leaf.patch.thickness);
            n += 1;
            finer |= leaf.level > place.level;
        }
        if n == 0 {
            let (depth, thickness) = (place.base, self.thickness);
            return Prediction { depth, thickness, neighbours: 0, finer };
        }
        let rounding = n << (FRACTION - 1);
        let mean = (depth + rounding).div_euclid(n << FRACTION);
        let bound = i64::from(MAX_DEPTH);
        Prediction {
            depth: mean.clamp(-bound, bound) as i32,
            thickness: (2 * thickness + n as i32) / (2 * n as i32),
            neighbours: n.min(2) as usize,
            finer,
        }
    }

    /// Depths at which patches beside a tile reach it, in steps, at most [`MAX_CANDIDATES`]. Of depths within half of
    /// [`REACH`] of each other only the first counts.
    pub fn candidates(&self, side: u8, tile: [i32; 2]) -> Vec<i32> {
        let width = self.lattice.tile_pixels();
        let corner = tile.map(|t| t * width);
        let mut found: Vec<i32> = Vec::new();
        for step in 0..width / PATCH_PIXELS {
            let along = step * PATCH_PIXELS + PATCH_PIXELS / 2;
            let beside = [
                [corner[0] - 1, corner[1] + along],
                [corner[0] + along, corner[1] - 1],
                [corner[0] + width, corner[1] + along],
                [corner[0] + along, corner[1] + width],
            ];
            for pixel in beside {
                let block = pixel.map(|c| c.div_euclid(PATCH_PIXELS));
                let Some(here) = self.by_block.get(&(side, block[0], block[1])) else { continue };
                for &i in here {
                    let half = pixel.map(|c| 2 * c + 1);
                    let depth = self.depth(&self.patches[i as usize].leaf, half) >> FRACTION;
                    let bound = i64::from(MAX_DEPTH);
                    let depth = depth.clamp(-bound, bound) as i32;
                    if found.len() < MAX_CANDIDATES
                        && found
                            .iter()
                            .all(|f| (i64::from(*f - depth) << FRACTION).abs() * 2 > self.reach)
                    {
                        found.push(depth);
                    }
                }
            }
        }
        found
    }
}
