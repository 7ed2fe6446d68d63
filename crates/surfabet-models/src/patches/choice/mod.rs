//! Choice of what to code for a sheet: the hierarchy, masks, shapes and thickness of least Lagrangian cost
//! `J = D + lambda R`.
//!
//! The distortion D is the squared distance that input points would have from the decoded surface with its
//! thickness, plus that of decoded points from the input, in squared finest pixels. The rate R is the price in bits
//! under the models of the coder, as trained by the round before; input that no patch is near to adds that of points.
//!
//! | file | what is chosen |
//! |---|---|
//! | `misfit` | distance of two slabs |
//! | `beside` | price of points beside the patches |
//! | `mask` | pixels of a patch |
//! | `shape` | depth of a patch as a sum of shapes, and its thickness |
//! | `rounds` | all of it again with the prices of the round before, and the price of points beside the patches |
//! | `solution` | coefficients of more and more shapes |

mod beside;
mod mask;
mod misfit;
mod rounds;
mod shape;
mod solution;

use crate::patches::coding::{GeometryModels, SET, beside_context, split_context};
use crate::patches::constants::{DECODED_WEIGHT, MAX_STRAY, SHEET_BITS};
use crate::patches::model::{Lattice, LatticePatch, PATCH_PIXELS, Square};
use crate::patches::sheets::{Run, Sheet};
use crate::patches::surface::basis::Basis;
pub(super) use beside::PointPrice;
use mask::{distances_to_runs, fill_holes};
pub(super) use rounds::{Rounds, RoundsOutcome};

/// States of the pixels beside a square as the choice assumes them: what lies there is chosen at the same time.
const BESIDE: [usize; 2] = [SET; 2];

/// Patches beside a square, likewise.
const NEIGHBOURS: usize = 2;

/// What the choice depends on.
pub(in crate::patches) struct Choice<'a> {
    /// Prices of decisions.
    pub models: &'a GeometryModels,
    /// Shapes of all levels.
    pub bases: &'a [Basis],
    /// Squared pixels that a bit must save.
    pub lambda: f32,
    /// Depth step in pixels.
    pub step: f32,
    pub lattice: Lattice,
    /// Of points for what is left out, where there will be some.
    pub points: Option<PointPrice>,
}

/// What all squares of a sheet share.
struct SheetPixels {
    /// Squared distance of every pixel of the tile to the nearest run; zero where there is one.
    squared_distances: Vec<f32>,
    /// Pixels per side of the tile.
    width: usize,
    /// Samples per pixel.
    density: f32,
}

/// A square of a tile.
#[derive(Clone, Copy)]
struct TileSquare {
    level: u32,
    /// First column and row within the tile, finest pixels.
    corner: [usize; 2],
    /// Doublings from a finest pixel to one of the level.
    doublings: u32,
}

impl TileSquare {
    /// Mask pixel that a run of the square lies in.
    fn pixel_of(&self, run: &Run) -> usize {
        let column = (usize::from(run.u) - self.corner[0]) >> self.doublings;
        let row = (usize::from(run.v) - self.corner[1]) >> self.doublings;
        row * PATCH_PIXELS as usize + column
    }
}

/// What to code at a square, and its cost J.
struct ChosenSquare {
    square: Square,
    cost: f32,
}

impl Choice<'_> {
    /// The best hierarchy for a sheet. Errors count once in each of its copies, its bits but once.
    pub fn sheet(&self, sheet: &Sheet) -> Square {
        Choice { lambda: self.lambda / sheet.copies, ..*self }.own_sheet(sheet)
    }

    fn own_sheet(&self, sheet: &Sheet) -> Square {
        let width = self.lattice.tile_pixels() as usize;
        let runs = &sheet.runs;
        let n: f32 = runs.iter().map(|r| r.n).sum();
        let pixels = SheetPixels {
            squared_distances: distances_to_runs(runs, width),
            width,
            density: n / runs.len() as f32,
        };
        let best = self.square(&pixels, runs, self.tile_square(0, [0, 0]));
        if sheet.small {
            let left_out: f32 = runs.iter().map(|r| self.cost_of_stray(r)).sum();
            if left_out < best.cost + SHEET_BITS * self.lambda {
                return Square::Empty;
            }
        }
        best.square
    }

    /// Cost J of the points that stand for `n` samples without a patch; zero where none will.
    fn cost_of_points(&self, n: f32) -> f32 {
        self.points.map_or(0.0, |points| self.lambda * points.bits(n))
    }

    /// Cost J of a run of a small sheet that is left out.
    fn cost_of_stray(&self, run: &Run) -> f32 {
        let is_far = self.points.is_some_and(|points| points.is_beyond(run.stray));
        let points = if is_far { self.cost_of_points(run.n) } else { 0.0 };
        run.n * run.stray.min(MAX_STRAY).powi(2) + points
    }

    /// How much the depth of decoded points that is off counts against that of input points.
    fn decoded_weight(&self) -> f32 {
        self.points.map_or(DECODED_WEIGHT, |points| points.decoded_weight)
    }

    fn tile_square(&self, level: u32, corner: [usize; 2]) -> TileSquare {
        TileSquare { level, corner, doublings: self.lattice.doublings(level) }
    }

    /// The best of one patch, four squares of the next level, and nothing.
    fn square(&self, pixels: &SheetPixels, runs: &[Run], at: TileSquare) -> ChosenSquare {
        let level = at.level;
        let (is_root, is_finest) = (level == 0, level + 1 == self.lattice.levels);
        let empty_bit = |empty: bool| {
            let context = beside_context(level, if runs.is_empty() { [0; 2] } else { BESIDE });
            if is_root { 0.0 } else { self.models.empty[context].cost(empty) }
        };
        if runs.is_empty() {
            return ChosenSquare { square: Square::Empty, cost: self.lambda * empty_bit(true) };
        }
        let split_bit = |split: bool| {
            let context = split_context(level, NEIGHBOURS, false);
            if is_finest { 0.0 } else { self.models.split[context].cost(split) }
        };
        let presence = empty_bit(false);
        let mut best = self.patch(pixels, runs, at);
        best.cost += self.lambda * (presence + split_bit(false));
        if !is_root {
            // Left out: as if all samples were half a square away from what remains.
            let away = (0.5 * self.lattice.patch_width(level) as f32).powi(2);
            let bits = empty_bit(true);
            let left_out = |r: &Run| r.n * away + self.cost_of_points(r.n);
            let cost = runs.iter().map(left_out).sum::<f32>() + self.lambda * bits;
            if cost < best.cost {
                best = ChosenSquare { square: Square::Empty, cost };
            }
        }
        if !is_finest {
            let cost = self.lambda * (presence + split_bit(true));
            if let Some(split) = self.split(pixels, runs, at, cost, best.cost) {
                best = split;
            }
        }
        best
    }

    /// Four squares of the next level, when `cost` and theirs stay below `limit` and one of them is not empty.
    fn split(
        &self,
        pixels: &SheetPixels,
        runs: &[Run],
        at: TileSquare,
        mut cost: f32,
        limit: f32,
    ) -> Option<ChosenSquare> {
        let half = self.lattice.patch_width(at.level + 1) as usize;
        let child_of = |run: &Run| {
            let right = usize::from(usize::from(run.u) - at.corner[0] >= half);
            let lower = usize::from(usize::from(run.v) - at.corner[1] >= half);
            2 * lower + right
        };
        let mut sizes = [0; 4];
        runs.iter().for_each(|run| sizes[child_of(run)] += 1);
        let mut below = sizes.map(Vec::with_capacity);
        runs.iter().for_each(|run| below[child_of(run)].push(*run));
        let mut children: [Square; 4] = Default::default();
        for (child, (square, runs)) in children.iter_mut().zip(&below).enumerate() {
            let corner = [at.corner[0] + (child & 1) * half, at.corner[1] + (child >> 1) * half];
            let chosen = self.square(pixels, runs, self.tile_square(at.level + 1, corner));
            cost += chosen.cost;
            *square = chosen.square;
            if cost >= limit {
                return None;
            }
        }
        let any = children.iter().any(|c| *c != Square::Empty);
        any.then(|| ChosenSquare { square: Square::Split(Box::new(children)), cost })
    }

    /// One patch for all runs of a square: first its mask, then depth and thickness for the runs of set pixels.
    fn patch(&self, pixels: &SheetPixels, runs: &[Run], at: TileSquare) -> ChosenSquare {
        let (mask, mut cost) = self.mask(pixels, runs, at);
        let mut inside: Vec<Run> = Vec::with_capacity(runs.len() + mask.count_ones() as usize);
        inside.extend(runs.iter().filter(|r| mask >> at.pixel_of(r) & 1 != 0));
        let n_measured = inside.len();
        let measured = inside.iter().fold(0_u64, |measured, r| measured | 1 << at.pixel_of(r));
        fill_holes(&mut inside, mask & !measured, at, pixels.density);
        let shape = self.shape(&inside, n_measured, at);
        cost += shape.cost;
        let patch = LatticePatch { mask, ..shape.patch };
        ChosenSquare { square: Square::Patch(Box::new(patch)), cost }
    }
}
