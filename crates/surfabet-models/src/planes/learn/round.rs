//! The end of learning: patches in the integers of a file, points on patches, colours of tiles.

use rayon::prelude::*;
use surfabet_geom::{PointCloud, Progress};

use super::e_step::NONE;
use super::fit::Fit;
use crate::color;
use crate::error::{Error, Result};
use crate::planes::coding::{MAX_COORDINATE, StoredPatch};
use crate::planes::constants::STEPS_PER_GRID_SIZE;
use crate::planes::model::{
    MAX_EXPONENT, MAX_MODEL_TILES, PlaneModel, PlanesHeader, labels, n_tiles,
};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// The model of a fit, the patches that most points support first. Colours are those of `cloud`, by the patches that its
/// points support after rounding.
pub(super) fn rounded(
    cloud: &PointCloud,
    points: &Points,
    fit: &Fit<'_>,
    color_step: u32,
    progress: &dyn Progress,
) -> Result<PlaneModel> {
    let exponent = exponent(points, fit.grid_size())?;
    // A point or two have no resolution, and their grid size may be below any step.
    let grid_size = fit.grid_size().max(f64::from(exponent).exp2());
    let mut header = PlanesHeader {
        n_points: cloud.len() as u64,
        n_outliers: 0,
        origin: points.origin,
        exponent,
        grid_size,
        color_step: cloud.colors().is_some().then_some(color_step),
        n_patches: fit.patches().len() as u64,
    };
    let mut order: Vec<&Patch> = fit.patches().iter().collect();
    order.sort_by_key(|p| std::cmp::Reverse(p.n_supporting()));
    let mut stored: Vec<StoredPatch> =
        order.par_iter().map(|patch| StoredPatch::rounded(patch, &header)).collect();
    let patches: Vec<Patch> = stored.par_iter().map(|patch| patch.restored(&header)).collect();
    let labels = labels(points, &patches, grid_size, progress)?;
    header.n_outliers = labels.iter().filter(|&&l| l == NONE).count() as u64;
    if let (Some(step), Some(colors)) = (header.color_step, cloud.colors()) {
        let means = tile_colors(points, &patches, &labels, colors);
        for (patch, means) in stored.iter_mut().zip(means) {
            patch.colors = means.into_iter().map(|c| color::code(c, step)).collect();
        }
    }
    header.check()?;
    if n_tiles(&stored) > MAX_MODEL_TILES {
        let requirement = "larger: the patches would have more than 2^25 tiles";
        return Err(Error::invalid("min_grid_size", grid_size, requirement));
    }
    Ok(PlaneModel::learned(header, stored, patches, labels))
}

/// Position step as a power of two, at most a 32nd of the grid size.
fn exponent(points: &Points, grid_size: f64) -> Result<i32> {
    let step = (grid_size / STEPS_PER_GRID_SIZE).log2().floor();
    let limit = f64::from(MAX_EXPONENT);
    let exponent = step.clamp(-limit, limit) as i32;
    let largest = f64::from(exponent).exp2() * (f64::from(MAX_COORDINATE) - 1.0);
    // Rectangles reach beyond the points by a tile at most.
    let extent = points.extent() + 2.0 * grid_size;
    if extent > largest {
        return Err(Error::TooLarge {
            extent,
            limit: largest,
            resolution: f64::from(exponent).exp2(),
        });
    }
    Ok(exponent)
}

/// Mean colour of the points on each supported tile; a tile without points gets the patch's mean.
fn tile_colors(
    points: &Points,
    patches: &[Patch],
    labels: &[u32],
    colors: &[[u8; 3]],
) -> Vec<Vec<[f64; 3]>> {
    let mut sums: Vec<Vec<[f64; 4]>> =
        patches.iter().map(|p| vec![[0.0; 4]; p.tiles.supported().len()]).collect();
    for (i, &label) in labels.iter().enumerate() {
        let Some(patch) = patches.get(label as usize) else { continue };
        let [x, y, _] = patch.frame.local(points.positions[points.place[i] as usize]);
        if let Some(tile) = patch.tiles.tile_at([x, y]) {
            let sum = &mut sums[label as usize][tile];
            (0..3).for_each(|c| sum[c] += f64::from(colors[i][c]));
            sum[3] += 1.0;
        }
    }
    let mean = |s: &[f64; 4]| [s[0], s[1], s[2]].map(|c| c / s[3]);
    patches
        .iter()
        .zip(&sums)
        .map(|(patch, sums)| {
            let all = sums.iter().fold([0.0; 4], |t, s| std::array::from_fn(|k| t[k] + s[k]));
            let whole = if all[3] > 0.0 { mean(&all) } else { [127.0; 3] };
            let supported = sums.iter().zip(patch.tiles.supported()).filter(|(_, s)| **s);
            supported.map(|(sum, _)| if sum[3] > 0.0 { mean(sum) } else { whole }).collect()
        })
        .collect()
}
