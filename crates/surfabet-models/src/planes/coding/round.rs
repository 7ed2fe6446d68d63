//! The end of learning: patches in the integers of a file, points on patches, colours and intensities of tiles.

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress};

use super::stored::{MAX_COORDINATE, StoredPatch};
use crate::color;
use crate::error::{Error, Result};
use crate::extent::too_small;
use crate::options::Options;
use crate::planes::constants::{LEAST_STEPS_PER_GRID_SIZE, STEPS_PER_GRID_SIZE};
use crate::planes::fit::NONE;
use crate::planes::model::{
    MAX_EXPONENT, MAX_MODEL_TILES, PlaneModel, PlanesHeader, labels, n_tiles, reduced_labels,
};
use crate::planes::options::PlanesOptions;
use crate::planes::patch::Patch;
use crate::planes::points::Points;
use crate::scalar::ScalarScale;

/// The model of a fit, the patches that most points support first. Colours and intensities are those of `cloud`, by the
/// patches that its points support after rounding.
pub(in crate::planes) fn rounded(
    cloud: &PointCloud,
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    options: &PlanesOptions,
    progress: &dyn Progress,
) -> Result<PlaneModel> {
    let exponent = exponent(points, grid_size)?;
    // A point or two have no resolution, and their grid size may be below any step.
    let grid_size = grid_size.max(f64::from(exponent).exp2());
    let mut header = PlanesHeader {
        n_points: cloud.len() as u64,
        n_outliers: 0,
        origin: points.origin,
        exponent,
        grid_size,
        color_step: cloud.colors().is_some().then_some(options.color_step),
        intensity: None,
        n_patches: patches.len() as u64,
    };
    let mut order: Vec<&Patch> = patches.iter().collect();
    order.sort_by_key(|p| std::cmp::Reverse(p.n_supporting()));
    let mut stored: Vec<StoredPatch> =
        parallel::map(&order, |patch| StoredPatch::rounded(patch, &header));
    let patches: Vec<Patch> = parallel::map(&stored, |patch| patch.restored(&header));
    let labels = if options.published {
        reduced_labels(points, &patches, grid_size, progress)?
    } else {
        labels(points, &patches, grid_size, progress)?
    };
    header.n_outliers = labels.iter().filter(|&&l| l == NONE).count() as u64;
    if let (Some(step), Some(colors)) = (header.color_step, cloud.colors()) {
        let color = |i: usize| colors[i].map(f64::from);
        let means = tile_means(points, &patches, &labels, 0..labels.len(), color, [127.0; 3]);
        for (patch, means) in stored.iter_mut().zip(means) {
            patch.colors = means.into_iter().map(|c| color::code(c, step)).collect();
        }
    }
    if let Some(values) = cloud.intensities() {
        // The same sums whatever the order of the points.
        let mut order: Vec<u32> = (0..values.len() as u32).collect();
        let key = |i: u32| (points.place[i as usize], values[i as usize].to_bits());
        parallel::sort_numbers_by(&mut order, &|i, j| key(i).cmp(&key(j)));
        let order: Vec<usize> = order.into_iter().map(|i| i as usize).collect();
        let mean = order.iter().map(|&i| f64::from(values[i])).sum::<f64>() / values.len() as f64;
        let value = |i: usize| [f64::from(values[i])];
        let means = tile_means(points, &patches, &labels, order.into_iter(), value, [mean]);
        let all = means.iter().flatten().map(|&[mean]| mean);
        let scale = ScalarScale::of("intensities", all, options.attribute_step)?;
        for (patch, means) in stored.iter_mut().zip(means) {
            patch.intensities = means.into_iter().map(|[mean]| scale.code(mean)).collect();
        }
        header.intensity = Some(scale);
    }
    header.check()?;
    if n_tiles(&stored) > MAX_MODEL_TILES {
        let requirement = "larger: the patches would have more than 2^25 tiles";
        return Err(Error::invalid("min_grid_size", grid_size, requirement));
    }
    Ok(PlaneModel::learned(header, stored, patches, labels, options.published))
}

/// Position step as a power of two: at most a 32nd of the grid size, and more where the scene is too large for that.
fn exponent(points: &Points, grid_size: f64) -> Result<i32> {
    // Points in one place have a grid of any size.
    if points.extent() > 0.0 {
        PlanesOptions::check_found("min_grid_size", grid_size)?;
    }
    // Rectangles reach beyond the points by a tile at most.
    let extent = points.extent() + 2.0 * grid_size;
    let of_extent = (extent / (f64::from(MAX_COORDINATE) - 1.0)).log2().ceil();
    let of_grid_size = (grid_size / STEPS_PER_GRID_SIZE).log2().floor();
    if of_extent > (grid_size / LEAST_STEPS_PER_GRID_SIZE).log2() {
        let least = LEAST_STEPS_PER_GRID_SIZE * of_extent.exp2();
        return Err(too_small("min_grid_size", grid_size, least, extent));
    }
    let limit = f64::from(MAX_EXPONENT);
    Ok(of_extent.max(of_grid_size).clamp(-limit, limit) as i32)
}

/// Mean of `value` over the points on each supported tile, added in this order; a tile without points gets the patch's mean, and where the patch
/// has none `else_`.
fn tile_means<const N: usize>(
    points: &Points,
    patches: &[Patch],
    labels: &[u32],
    order: impl Iterator<Item = usize>,
    value: impl Fn(usize) -> [f64; N],
    else_: [f64; N],
) -> Vec<Vec<[f64; N]>> {
    let mut sums: Vec<Vec<([f64; N], f64)>> =
        patches.iter().map(|p| vec![([0.0; N], 0.0); p.tiles.supported().len()]).collect();
    for i in order {
        let label = labels[i];
        let Some(patch) = patches.get(label as usize) else { continue };
        let [x, y, _] = patch.frame.local(points.positions[points.place[i] as usize]);
        if let Some(tile) = patch.tiles.tile_at([x, y]) {
            let (sum, n) = &mut sums[label as usize][tile];
            let value = value(i);
            (0..N).for_each(|c| sum[c] += value[c]);
            *n += 1.0;
        }
    }
    let mean = |(sum, n): &([f64; N], f64)| (*n > 0.0).then(|| sum.map(|c| c / n));
    patches
        .iter()
        .zip(&sums)
        .map(|(patch, sums)| {
            let all = sums.iter().fold(([0.0; N], 0.0), |(total, n), (sum, of)| {
                (std::array::from_fn(|c| total[c] + sum[c]), n + of)
            });
            let whole = mean(&all).unwrap_or(else_);
            let supported = sums.iter().zip(patch.tiles.supported()).filter(|(_, s)| **s);
            supported.map(|(sum, _)| mean(sum).unwrap_or(whole)).collect()
        })
        .collect()
}
