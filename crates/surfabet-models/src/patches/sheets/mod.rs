//! Samples of one side as sheets: single-valued height fields over the tiles of the coarsest level.
//!
//! Within a pixel's column, samples without a gap between them are one run: a stretch of depth with a middle and
//! a thickness. Runs of neighbouring pixels whose depths agree grow into a sheet, never two of one pixel, so that
//! what lies behind one another (a table top and its underside, two boxes) becomes several sheets.
//!
//! All lengths here are in pixels of the finest level.
//!
//! | file | step |
//! |---|---|
//! | `runs` | samples of each pixel as runs |
//! | `growth` | runs grow into sheets, small sheets join others |

mod growth;
mod runs;

use surfabet_base::rounding::floor_f32;
use surfabet_base::{Partition, parallel};
use surfabet_geom::KdTree;

use crate::error::Result;
use crate::patches::coding::MAX_SHEETS;
use crate::patches::constants::{LEAST_GAP, MAX_GAP, SHARE_OF_GAP, SMALL_SHEET, STEP_SHARE_OF_GAP};
use crate::patches::samples::SidedSamples;
use growth::grow;
pub(in crate::patches) use runs::Run;
use runs::{PixelSample, TileRuns, pixel_key, side_and_tile, tile_part};

/// A height field over a tile.
#[derive(Debug, Clone)]
pub(in crate::patches) struct Sheet {
    pub side: u8,
    /// Tile of the coarsest level, along the two axes of the side.
    pub tile: [i32; 2],
    pub runs: Vec<Run>,
    /// Whether it may be left out.
    pub small: bool,
    /// How many copies of the surface the scene has, this one counted.
    pub copies: f32,
}

impl Sheet {
    /// Middles of the pixels of its runs, at their depths, finest pixels.
    pub fn positions(&self, tile_pixels: i32) -> impl Iterator<Item = [f32; 3]> {
        let [d, u, v] = axes_of(self.side);
        self.runs.iter().map(move |run| {
            let mut p = [0.0; 3];
            p[d] = run.depth;
            p[u] = (self.tile[0] * tile_pixels + i32::from(run.u)) as f32 + 0.5;
            p[v] = (self.tile[1] * tile_pixels + i32::from(run.v)) as f32 + 0.5;
            p
        })
    }
}

/// Depth axis and the axes of columns and rows of a side.
pub(in crate::patches) fn axes_of(side: u8) -> [usize; 3] {
    let depth = usize::from(side / 2);
    [depth, (depth + 1) % 3, (depth + 2) % 3]
}

/// How far apart what lies on one surface may be, pixels.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct Reach {
    /// Samples next to one another in a column.
    pub gap: f32,
    /// Depths of pixels that touch.
    pub step: f32,
}

impl Reach {
    /// Where surfaces may lie `layer_gap` metres behind one another, with pixels of `resolution` metres.
    pub fn of(layer_gap: Option<f64>, resolution: f64) -> Self {
        match layer_gap {
            Some(gap) => {
                let gap = (gap / resolution) as f32;
                Self {
                    gap: (SHARE_OF_GAP * gap).clamp(LEAST_GAP, MAX_GAP),
                    step: STEP_SHARE_OF_GAP * gap,
                }
            }
            None => Self { gap: MAX_GAP, step: f32::INFINITY },
        }
    }
}

/// Sheets of all sides, by side, tile and depth.
pub(in crate::patches) fn sheets(
    samples: &SidedSamples<'_>,
    pixel: f32,
    tile_pixels: i32,
    reach: Reach,
) -> Result<Vec<Sheet>> {
    let of_sample = |(position, weight, side): ([f32; 3], f32, u8)| {
        let [depth, u, v] = axes_of(side).map(|a| position[a] / pixel);
        let at = [u, v].map(floor_f32);
        let tile = at.map(|c| c.div_euclid(tile_pixels));
        let key = pixel_key(side, tile, at.map(|c| c.rem_euclid(tile_pixels)));
        PixelSample { key, depth, weight }
    };
    let all: Vec<PixelSample> = parallel::gather(samples.all.len(), |i, found| {
        if !samples.is_kept(i) {
            let sample = &samples.all[i];
            found.push(of_sample((sample.position, sample.weight, samples.sides[i])));
        }
    });
    let tiles = Partition::of(&parallel::map(&all, |sample| tile_part(sample.key)));
    let of_tiles: Vec<Vec<Sheet>> = parallel::map(&tiles.parts(), |tile| {
        let mut samples: Vec<PixelSample> = tile.iter().map(|&i| all[i as usize]).collect();
        samples.sort_unstable_by(|a, b| {
            let by_depth = a.depth.total_cmp(&b.depth);
            a.key.cmp(&b.key).then(by_depth).then(a.weight.total_cmp(&b.weight))
        });
        sheets_of_tile(&samples, tile_pixels as usize, reach)
    });
    // Memory that the trees need.
    drop((all, tiles));
    let mut sheets: Vec<Sheet> = of_tiles.into_iter().flatten().collect();
    measure_strays(&mut sheets, tile_pixels)?;
    Ok(sheets)
}

/// Sheets of one tile, by mean depth; of more than a file may hold, those with most samples.
fn sheets_of_tile(samples: &[PixelSample], tile_pixels: usize, reach: Reach) -> Vec<Sheet> {
    let runs = TileRuns::new(samples, tile_pixels, reach.gap);
    let (side, tile) = side_and_tile(samples[0].key);
    let mut sheets: Vec<Sheet> = grow(&runs, reach.step)
        .into_iter()
        .map(|mut members| {
            members.sort_unstable();
            let runs: Vec<Run> = members.iter().map(|&i| runs.runs[i]).collect();
            let small = runs.iter().map(|r| r.n).sum::<f32>() < SMALL_SHEET;
            Sheet { side, tile, runs, small, copies: 1.0 }
        })
        .collect();
    // No tile of a scan holds so many, but noise may: the smallest go.
    let n_samples = |s: &Sheet| s.runs.iter().map(|r| f64::from(r.n)).sum::<f64>();
    sheets.sort_by(|a, b| n_samples(b).total_cmp(&n_samples(a)));
    sheets.truncate(MAX_SHEETS);
    let mean =
        |s: &Sheet| s.runs.iter().map(|r| f64::from(r.depth)).sum::<f64>() / s.runs.len() as f64;
    sheets.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
    sheets
}

/// Measures how far the runs of small sheets are from the nearest run of a large one.
fn measure_strays(sheets: &mut [Sheet], tile_pixels: i32) -> Result<()> {
    let large: Vec<[f32; 3]> =
        sheets.iter().filter(|s| !s.small).flat_map(|s| s.positions(tile_pixels)).collect();
    let tree = if large.is_empty() { None } else { Some(KdTree::new(&large)?) };
    parallel::for_each_mut(sheets, |_, sheet| {
        if !sheet.small {
            return;
        }
        let positions: Vec<[f32; 3]> = sheet.positions(tile_pixels).collect();
        for (run, p) in sheet.runs.iter_mut().zip(positions) {
            let nearest = tree.as_ref().and_then(|t| t.nearest(p));
            run.stray = nearest.map_or(f32::MAX.sqrt(), |n| n.squared_distance().sqrt());
        }
    });
    Ok(())
}
