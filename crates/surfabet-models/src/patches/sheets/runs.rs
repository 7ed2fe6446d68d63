//! Runs: stretches of depth in the columns of a tile's pixels.

use std::ops::Range;

use crate::patches::constants::{MAX_RUN, THINNEST};
use crate::patches::samples::cells::KEY_BITS;

/// A sample as growing sheets needs it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelSample {
    /// Side, tile and pixel, see [`pixel_key`].
    pub key: u64,
    /// Depth along the axis of the side, pixels.
    pub depth: f32,
    pub weight: f32,
}

/// Bits of a tile's coordinate: pixels are at least two cells of samples wide, whose coordinates take as many.
const TILE_BITS: u32 = KEY_BITS;

/// Bits of a pixel within its tile: a byte along each axis.
const PIXEL_BITS: u32 = 16;

/// What is added to a tile's coordinate so that it is not negative.
const MIDDLE: i32 = 1 << (TILE_BITS - 1);

/// Side, tile and pixel of a sample as one number, which sorts by them in this order; pixels go row by row.
pub(super) fn pixel_key(side: u8, tile: [i32; 2], pixel: [i32; 2]) -> u64 {
    let shifted = |t: i32| (t + MIDDLE) as u64;
    let tiles = (u64::from(side) << TILE_BITS | shifted(tile[0])) << TILE_BITS | shifted(tile[1]);
    tiles << PIXEL_BITS | (pixel[1] as u64) << 8 | pixel[0] as u64
}

/// The part of a [`pixel_key`] that the pixels of one tile share.
pub(super) fn tile_part(key: u64) -> u64 {
    key >> PIXEL_BITS
}

/// Side and tile of a [`pixel_key`].
pub(super) fn side_and_tile(key: u64) -> (u8, [i32; 2]) {
    let tile = |part: u64| (part & ((1 << TILE_BITS) - 1)) as i32 - MIDDLE;
    let part = tile_part(key);
    ((part >> (2 * TILE_BITS)) as u8, [tile(part >> TILE_BITS), tile(part)])
}

/// A stretch of depth in the column of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::patches) struct Run {
    /// Pixel within the tile.
    pub u: u8,
    pub v: u8,
    /// Number of samples.
    pub n: f32,
    /// Mean depth.
    pub depth: f32,
    /// Half thickness: sqrt(3) standard deviations, the half width of a slab of that variance.
    pub half: f32,
    /// Distance to the nearest run of any large sheet; zero and not used in large sheets.
    pub stray: f32,
}

/// The runs of a tile, pixel by pixel.
pub(super) struct TileRuns {
    pub runs: Vec<Run>,
    /// Runs of each pixel.
    by_pixel: Vec<Range<u32>>,
    /// Pixels per side of the tile.
    width: usize,
}

impl TileRuns {
    /// The runs of sorted samples of a tile that is `width` pixels wide, cut at gaps of more than `max_gap` pixels.
    pub fn new(samples: &[PixelSample], width: usize, max_gap: f32) -> Self {
        let mut runs = Vec::new();
        for column in samples.chunk_by(|a, b| a.key == b.key) {
            add_runs(column, max_gap, &mut runs);
        }
        let mut by_pixel = vec![0_u32..0; width * width];
        for (i, run) in (0..).zip(&runs) {
            let range = &mut by_pixel[usize::from(run.v) * width + usize::from(run.u)];
            if range.start == range.end {
                range.start = i;
            }
            range.end = i + 1;
        }
        Self { runs, by_pixel, width }
    }

    /// Number of pixels.
    pub fn n_pixels(&self) -> usize {
        self.by_pixel.len()
    }

    /// Number of a run's pixel.
    pub fn pixel_of(&self, run: &Run) -> usize {
        usize::from(run.v) * self.width + usize::from(run.u)
    }

    /// Number of the pixel that lies `du` columns and `dv` rows from a run's, if the tile has it.
    pub fn pixel_beside(&self, run: &Run, du: i32, dv: i32) -> Option<usize> {
        let (u, v) = (i32::from(run.u) + du, i32::from(run.v) + dv);
        let inside = |c: i32| (0..self.width as i32).contains(&c);
        (inside(u) && inside(v)).then(|| v as usize * self.width + u as usize)
    }

    /// Runs of a pixel.
    pub fn at(&self, pixel: usize) -> impl Iterator<Item = usize> {
        self.by_pixel[pixel].clone().map(|i| i as usize)
    }

    /// Number of samples of all `members`.
    pub fn n_samples(&self, members: &[usize]) -> f32 {
        members.iter().map(|&i| self.runs[i].n).sum()
    }
}

/// Cuts the samples of a pixel, sorted by depth, into runs at gaps of more than `max_gap` pixels and at the greatest length.
fn add_runs(column: &[PixelSample], max_gap: f32, runs: &mut Vec<Run>) {
    let key = column[0].key;
    let (u, v) = ((key & 0xff) as u8, (key >> 8 & 0xff) as u8);
    let mut rest = column;
    while let Some(first) = rest.first() {
        let mut end = 1;
        while end < rest.len()
            && rest[end].depth - rest[end - 1].depth <= max_gap
            && rest[end].depth - first.depth <= MAX_RUN
        {
            end += 1;
        }
        let (run, behind) = rest.split_at(end);
        rest = behind;

        let n = run.len() as f64;
        let weight: f64 = run.iter().map(|s| f64::from(s.weight)).sum();
        let depth =
            run.iter().map(|s| f64::from(s.weight) * f64::from(s.depth)).sum::<f64>() / weight;
        let variance = run.iter().map(|s| (f64::from(s.depth) - depth).powi(2)).sum::<f64>() / n;
        runs.push(Run {
            u,
            v,
            n: n as f32,
            depth: depth as f32,
            half: ((3.0 * variance).sqrt() as f32).max(THINNEST),
            stray: 0.0,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::samples::cells::LIMIT;
    use proptest::prelude::*;

    fn column(depths: &[f32]) -> Vec<PixelSample> {
        let key = pixel_key(0, [0; 2], [3, 5]);
        depths.iter().map(|&depth| PixelSample { key, depth, weight: 1.0 }).collect()
    }

    /// Tiles about the middle, and the furthest ones.
    fn tiles() -> impl Strategy<Value = i32> {
        prop_oneof![-9_i32..9, Just(LIMIT / 2), Just(-LIMIT / 2)]
    }

    proptest! {
        #[test]
        fn keys_sort_by_side_tile_and_row(
            a in (0_u8..6, prop::array::uniform2(tiles()), prop::array::uniform2(0_i32..64)),
            b in (0_u8..6, prop::array::uniform2(tiles()), prop::array::uniform2(0_i32..64)),
        ) {
            let key = |(side, tile, pixel)| pixel_key(side, tile, pixel);
            let order = |(side, tile, [u, v]): (u8, [i32; 2], [i32; 2])| (side, tile, v, u);
            prop_assert_eq!(key(a).cmp(&key(b)), order(a).cmp(&order(b)));
            prop_assert_eq!(side_and_tile(key(a)), (a.0, a.1));
            prop_assert_eq!(tile_part(key(a)) == tile_part(key(b)), (a.0, a.1) == (b.0, b.1));
        }
    }

    #[test]
    fn a_gap_starts_another_run() {
        let depths = |gap: f32| TileRuns::new(&column(&[0.0, 1.0, 1.0 + gap]), 8, 2.5).runs;
        assert_eq!(depths(2.5).len(), 1);
        let runs = depths(2.525);
        assert_eq!(
            runs.iter().map(|r| (r.u, r.v, r.n)).collect::<Vec<_>>(),
            [(3, 5, 2.0), (3, 5, 1.0)]
        );
        assert_eq!((runs[0].depth, runs[1].half), (0.5, THINNEST));
        // Two samples at 0 and 1: a standard deviation of a half.
        assert!((runs[0].half - 0.75_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn no_run_is_longer_than_the_longest() {
        let depths: Vec<f32> = (0..100).map(|i| i as f32).collect();
        let runs = TileRuns::new(&column(&depths), 8, 2.5).runs;
        assert_eq!(runs[0].n, MAX_RUN + 1.0);
    }
}
