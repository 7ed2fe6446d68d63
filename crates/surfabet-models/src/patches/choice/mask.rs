//! Which pixels of a patch are set.

use super::{BESIDE, Choice, SheetPixels, TileSquare};
use crate::patches::coding::{UNKNOWN, beside_context, pixel_context};
use crate::patches::constants::{DECODED_WEIGHT, HOLE_WEIGHT, MASK_PASSES, NEAREST_SAMPLE};
use crate::patches::model::PATCH_PIXELS;
use crate::patches::sheets::Run;

/// Pixels per side of a mask.
const SIDE: usize = PATCH_PIXELS as usize;

/// Pixels of a mask.
const AREA: usize = SIDE * SIDE;

/// Distortion of each pixel of a patch, if it is set and if not.
struct PixelCosts {
    set: [f32; AREA],
    unset: [f32; AREA],
}

/// Contexts of the pixels of a level.
const CONTEXTS: usize = pixel_context(1, [0; 4]);

/// Pixels from one row of a [`MaskGrid`] to the next.
const STRIDE: usize = SIDE + 2;

/// A mask with a rim of unknown pixels, and what its pixels cost in bits.
struct MaskGrid {
    /// Row by row, from the rim above; below there is none.
    states: [u8; STRIDE * (SIDE + 1)],
    bits: [[f32; 2]; CONTEXTS],
    /// No less than [`Self::bits_about`] any pixel, rounding included.
    most_about: f32,
}

impl MaskGrid {
    fn new(mask: u64, bits: [[f32; 2]; CONTEXTS]) -> Self {
        let most = bits.as_flattened().iter().copied().fold(0.0, f32::max);
        let most_about = most + most + most + most + most;
        let states = [UNKNOWN as u8; STRIDE * (SIDE + 1)];
        let mut grid = Self { states, bits, most_about };
        (0..AREA).for_each(|pixel| grid.set(pixel, mask >> pixel & 1 != 0));
        grid
    }

    /// Where a pixel stands.
    #[inline]
    fn at(pixel: usize) -> usize {
        (pixel / SIDE + 1) * STRIDE + pixel % SIDE + 1
    }

    #[inline]
    fn set(&mut self, pixel: usize, set: bool) {
        self.states[Self::at(pixel)] = u8::from(set);
    }

    /// Bits that a pixel takes in its context.
    #[inline]
    fn bits(&self, pixel: usize) -> f32 {
        let at = Self::at(pixel);
        let state = |back: usize| usize::from(self.states[at - back]);
        let states = [state(1), state(STRIDE), state(STRIDE + 1), state(STRIDE - 1)];
        self.bits[pixel_context(0, states)][state(0)]
    }

    /// Bits of a pixel and of the four that it is context of.
    #[inline]
    fn bits_about(&self, pixel: usize) -> f32 {
        let (column, below) = (pixel % SIDE, pixel + SIDE);
        let mut bits = self.bits(pixel);
        if column + 1 < SIDE {
            bits += self.bits(pixel + 1);
        }
        if below < AREA {
            bits += self.bits(below);
            if column + 1 < SIDE {
                bits += self.bits(below + 1);
            }
            if column > 0 {
                bits += self.bits(below - 1);
            }
        }
        bits
    }
}

impl Choice<'_> {
    /// Pixels that are worth setting, and the cost J of them and of those that are not. At least one of the set pixels
    /// holds a run.
    pub(super) fn mask(&self, pixels: &SheetPixels, runs: &[Run], at: TileSquare) -> (u64, f32) {
        let costs = self.pixel_costs(pixels, runs, at);
        let PixelCosts { set, unset } = &costs;
        let full = &self.models.full[beside_context(at.level, BESIDE)];
        let all: f32 = set.iter().sum::<f32>() + self.lambda * full.cost(true);

        let measured = (0..AREA).filter(|&p| unset[p] > 0.0).fold(0_u64, |m, p| m | 1 << p);
        let mut mask = (0..AREA).filter(|&p| set[p] < unset[p]).fold(0_u64, |m, p| m | 1 << p);
        if mask & measured == 0 {
            // The pixel with samples that would lose most.
            let most = (0..AREA)
                .filter(|&p| unset[p] > 0.0)
                .max_by(|&a, &b| (unset[a] - set[a]).total_cmp(&(unset[b] - set[b])));
            mask |= most.map_or(1, |p| 1_u64 << p);
        }
        let mut grid = MaskGrid::new(mask, self.mask_bits(at.level));
        for _ in 0..MASK_PASSES {
            for pixel in 0..AREA {
                mask = self.reconsider(mask, pixel, measured, &costs, &mut grid);
            }
        }
        let loss: f32 = (0..AREA).map(|p| if mask >> p & 1 != 0 { set[p] } else { unset[p] }).sum();
        let bits: f32 = full.cost(false) + (0..AREA).map(|p| grid.bits(p)).sum::<f32>();
        let partial = loss + self.lambda * bits;
        if all <= partial { (u64::MAX, all) } else { (mask, partial) }
    }

    /// The mask with `pixel` set or not, whichever costs less: its distortion, and the price of its own bit and of the
    /// four bits that it is context of.
    fn reconsider(
        &self,
        mask: u64,
        pixel: usize,
        measured: u64,
        costs: &PixelCosts,
        grid: &mut MaskGrid,
    ) -> u64 {
        let (with, without) = (mask | 1 << pixel, mask & !(1 << pixel));
        // Mostly bits make no difference.
        let most_bits = self.lambda * grid.most_about;
        let mut cost = |set: bool, loss: f32| {
            grid.set(pixel, set);
            loss + self.lambda * grid.bits_about(pixel)
        };
        let (set, unset) = (costs.set[pixel], costs.unset[pixel]);
        let is_set = if without & measured == 0 || set + most_bits <= unset {
            true
        } else if set > unset + most_bits {
            false
        } else {
            cost(true, set) <= cost(false, unset)
        };
        grid.set(pixel, is_set);
        if is_set { with } else { without }
    }

    /// Bits of a pixel of a level by context and value.
    fn mask_bits(&self, level: u32) -> [[f32; 2]; CONTEXTS] {
        let first = pixel_context(level, [0; 4]);
        std::array::from_fn(|context| {
            let model = &self.models.mask[first + context];
            [false, true].map(|set| model.cost(set))
        })
    }

    /// What each pixel costs without its bits. Unset, its n samples lie at a mean squared distance of `side^2 / 3` from
    /// what remains, and may need points; set, points are decoded where there may be no sample.
    fn pixel_costs(&self, pixels: &SheetPixels, runs: &[Run], at: TileSquare) -> PixelCosts {
        let side = 1_usize << at.doublings;
        let mut costs = PixelCosts { set: [0.0; AREA], unset: [0.0; AREA] };
        for run in runs {
            let pixel = side as f32;
            costs.unset[at.pixel_of(run)] +=
                run.n * pixel * pixel / 3.0 + self.cost_of_points(run.n);
        }
        for (pixel, cost) in costs.set.iter_mut().enumerate() {
            let u = at.corner[0] + ((pixel % SIDE) << at.doublings);
            let v = at.corner[1] + ((pixel / SIDE) << at.doublings);
            for dv in 0..side {
                for du in 0..side {
                    let squared = pixels.squared_distances[(v + dv) * pixels.width + u + du];
                    *cost += DECODED_WEIGHT * pixels.density * squared;
                }
            }
        }
        costs
    }
}

/// Adds a run of little weight at each pixel of `holes`, as deep as the nearest measured one: where nothing was
/// measured the surface goes on, it does not run away.
pub(super) fn fill_holes(runs: &mut Vec<Run>, holes: u64, at: TileSquare, density: f32) {
    let n_measured = runs.len();
    for hole in (0..AREA).filter(|h| holes >> h & 1 != 0) {
        let middle = |corner: usize, i: usize| {
            (corner + (i << at.doublings) + (1 << at.doublings) / 2).min(255) as u8
        };
        let (u, v) = (middle(at.corner[0], hole % SIDE), middle(at.corner[1], hole / SIDE));
        let squared = |r: &Run| {
            let (du, dv) = (f32::from(r.u) - f32::from(u), f32::from(r.v) - f32::from(v));
            du * du + dv * dv
        };
        let measured = runs[..n_measured].iter();
        let nearest = measured.min_by(|a, b| squared(a).total_cmp(&squared(b)));
        if let Some(&nearest) = nearest {
            let n = HOLE_WEIGHT * density * (1_u32 << (2 * at.doublings)) as f32;
            runs.push(Run { u, v, n, ..nearest });
        }
    }
}

/// Squared in-plane distance of the middle of each pixel of a tile to the nearest run, in squared pixels. Beyond four
/// pixels it counts as four.
pub(super) fn distances_to_runs(runs: &[Run], width: usize) -> Vec<f32> {
    const REACH: usize = 4;
    const ACROSS: usize = 2 * REACH + 1;
    const FAR: f32 = (REACH * REACH) as f32;
    let steps = || (0..ACROSS).map(|i| (i, i.abs_diff(REACH).pow(2) as f32));
    // With a rim as wide as the reach, so that all around a pixel lies within.
    let stride = width + 2 * REACH;
    let mut at_runs = vec![FAR; width * stride];
    for run in runs {
        at_runs[usize::from(run.v) * stride + usize::from(run.u) + REACH] = 0.0;
    }
    // Along rows, then along columns.
    let mut along = vec![FAR; stride * width];
    let rows = along[REACH * width..].chunks_exact_mut(width);
    for (row, of_runs) in rows.zip(at_runs.chunks_exact(stride)) {
        for (i, off) in steps() {
            row.iter_mut().zip(&of_runs[i..]).for_each(|(d, run)| *d = d.min(run + off));
        }
    }
    let mut squared = vec![FAR; width * width];
    for (v, row) in squared.chunks_exact_mut(width).enumerate() {
        for (i, off) in steps() {
            let of_row = &along[(v + i) * width..][..width];
            row.iter_mut().zip(of_row).for_each(|(d, along)| *d = d.min(along + off));
        }
    }
    // Samples of the other pixel lie about its middle, some of them closer.
    let nearest = |d: &mut f32| {
        *d = if *d > 0.0 { (d.sqrt() - NEAREST_SAMPLE).powi(2) } else { 0.0 };
    };
    squared.iter_mut().for_each(nearest);
    squared
}
