//! What is known of the surface around a place while patches are written or read one by one.

use std::collections::{HashMap, HashSet};

use crate::patches::model::{Lattice, MAX_DEPTH, PATCH_PIXELS};
use crate::patches::surface::basis::{Basis, FRACTION};
use crate::patches::surface::leaf::Leaf;

/// Surfaces of other sheets go on here when their depths agree within this many finest pixels.
const REACH: i64 = 8;

/// State of a pixel that may not have been coded yet.
pub(in crate::patches) const UNKNOWN: usize = 2;

/// A patch of a sheet.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct Placed {
    pub leaf: Leaf,
    /// Number of the sheet.
    pub sheet: u32,
}

/// Where the next patch will lie.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct Place {
    pub side: u8,
    pub level: u32,
    pub corner: [i32; 2],
    pub sheet: u32,
    /// Depth of the sheet, in steps.
    pub base: i32,
}

/// What the neighbours say about a place.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::patches) struct Prediction {
    /// Depth of the middle, in steps.
    pub depth: i32,
    /// Half thickness.
    pub thickness: i32,
    /// Number of neighbouring patches that said so, at most 2.
    pub voices: usize,
    /// Whether any neighbour is of a finer level.
    pub finer: usize,
}

pub(in crate::patches) struct Surroundings {
    bases: Vec<Basis>,
    patches: Vec<Placed>,
    by_block: HashMap<(u8, i32, i32), Vec<u32>>,
    done: HashSet<(u8, [i32; 2])>,
    tile_pixels: i32,
    /// Largest difference of depths on one surface, in steps with fraction.
    reach: i64,
    /// Thickness of the patch before.
    thickness: i32,
}

impl Surroundings {
    /// Nothing yet.
    pub fn new(lattice: Lattice) -> Self {
        Self {
            bases: Basis::of_levels(lattice.levels),
            patches: Vec::new(),
            by_block: HashMap::new(),
            done: HashSet::new(),
            tile_pixels: lattice.tile_pixels(),
            reach: (REACH << (FRACTION + 4)) / i64::from(lattice.depth_step),
            thickness: 4,
        }
    }

    /// Number of patches so far.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// All patches, in the order in which they were added.
    pub fn into_leaves(self) -> Vec<Leaf> {
        self.patches.into_iter().map(|placed| placed.leaf).collect()
    }

    pub fn add(&mut self, placed: Placed) {
        let index = self.patches.len() as u32;
        let leaf = placed.leaf;
        let block = leaf.corner.map(|c| c.div_euclid(PATCH_PIXELS));
        let blocks = 1 << leaf.level;
        for bv in block[1]..block[1] + blocks {
            for bu in block[0]..block[0] + blocks {
                self.by_block.entry((leaf.side, bu, bv)).or_default().push(index);
            }
        }
        self.thickness = i32::from(leaf.patch.thickness);
        self.patches.push(placed);
    }

    /// All sheets of this tile are known now.
    pub fn finish_tile(&mut self, side: u8, tile: [i32; 2]) {
        self.done.insert((side, tile));
    }

    /// Depth of a patch at a position in half pixels, in steps with fraction; outside it, of its tilted plane.
    fn depth(&self, leaf: &Leaf, half: [i32; 2]) -> i64 {
        let local: [i32; 2] = std::array::from_fn(|a| half[a] - 2 * leaf.corner[a]);
        let (c, limit) = (&leaf.patch.coefficients, 2 * leaf.width());
        if local.iter().all(|&x| (0..=limit).contains(&x)) {
            return self.bases[leaf.level as usize].depth(c, local.map(|x| x as usize));
        }
        // sqrt(3) with the fraction of the shapes.
        const ROOT_3: i64 = 7094;
        let along = |a: usize| i64::from(2 * local[a] - limit) * ROOT_3 / i64::from(limit);
        (i64::from(c[0]) << FRACTION) + i64::from(c[1]) * along(0) + i64::from(c[2]) * along(1)
    }

    /// Patches of this sheet, or of others at about this depth, that hold a block's pixel.
    fn at(&self, place: &Place, pixel: [i32; 2]) -> Option<&Leaf> {
        let block = pixel.map(|c| c.div_euclid(PATCH_PIXELS));
        let found = self.by_block.get(&(place.side, block[0], block[1]))?;
        let half = pixel.map(|c| 2 * c + 1);
        let mut best: Option<(&Leaf, i64)> = None;
        for &i in found {
            let Placed { leaf, sheet } = &self.patches[i as usize];
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

    /// Whether the pixel is set, 0 or 1, or [`UNKNOWN`].
    pub fn state(&self, place: &Place, pixel: [i32; 2]) -> usize {
        if let Some(leaf) = self.at(place, pixel) {
            return usize::from(leaf.is_set(pixel[0] - leaf.corner[0], pixel[1] - leaf.corner[1]));
        }
        let tile = pixel.map(|c| c.div_euclid(self.tile_pixels));
        let own = place.corner.map(|c| c.div_euclid(self.tile_pixels));
        // Within the own tile, what comes before in the order of squares is known to be empty.
        if self.done.contains(&(place.side, tile)) || tile == own { 0 } else { UNKNOWN }
    }

    /// Depth, thickness and level that the patches next to a place suggest.
    pub fn predict(&self, place: &Place) -> Prediction {
        let width = PATCH_PIXELS << place.level;
        let [u, v] = place.corner;
        let middle = width / 2;
        let beside = [
            [u - 1, v + middle],
            [u + middle, v - 1],
            [u + width, v + middle],
            [u + middle, v + width],
        ];
        let center = [2 * u + width, 2 * v + width];
        let (mut depth, mut thickness, mut voices, mut finer) = (0_i64, 0, 0, 0);
        for pixel in beside {
            let Some(leaf) = self.at(place, pixel) else { continue };
            depth += self.depth(leaf, center);
            thickness += i32::from(leaf.patch.thickness);
            voices += 1;
            finer |= usize::from(leaf.level < place.level);
        }
        if voices == 0 {
            return Prediction { depth: place.base, thickness: self.thickness, voices: 0, finer };
        }
        let rounding = voices << (FRACTION - 1);
        let mean = (depth + rounding).div_euclid(voices << FRACTION);
        let bound = i64::from(MAX_DEPTH);
        Prediction {
            depth: mean.clamp(-bound, bound) as i32,
            thickness: (2 * thickness + voices as i32) / (2 * voices as i32),
            voices: voices.min(2) as usize,
            finer,
        }
    }

    /// Depths at which the surfaces around a tile reach it, in steps, each once, nearest sides first.
    pub fn candidates(&self, side: u8, tile: [i32; 2]) -> Vec<i32> {
        let corner = tile.map(|t| t * self.tile_pixels);
        let width = self.tile_pixels;
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

/// Most depths that a tile's surroundings suggest.
const MAX_CANDIDATES: usize = 12;
