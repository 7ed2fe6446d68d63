//! The whole way from a cloud to a model.

use rayon::prelude::*;
use surfabet_geom::{PointCloud, Progress};

use super::decode::to_ycocg;
use super::dictionary::{ChannelOptions, learn_channel};
use super::images::{Images, project};
use super::model::{Channel, Level, MAX_POSITION, PatchModel, PatchModelParts, Steps};
use super::options::PatchOptions;
use super::order::{steps_per_cell, storing_order};
use super::placement::{Grid, Placed, place};
use super::samples::Samples;
use crate::error::{Error, Result};
use crate::report::Report;

/// Position lattice, in pixels: a quarter of a pixel moves no sample visibly, since depth and colour are measured
/// after the pose is rounded.
const POSITION_STEP: f64 = 0.25;

/// Learns surface patches from a cloud (SCSM).
///
/// The result depends on cloud, options and seed alone, not on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain, [`Error::EmptyCloud`], [`Error::TooLarge`] when
/// the scene does not fit the position lattice, [`Error::Cancelled`] when the caller asks to stop.
pub fn learn(
    cloud: &PointCloud,
    options: &PatchOptions,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    options.check()?;
    check_extent(cloud, options)?;
    let grid = Grid {
        pixel: options.resolution as f32,
        n: options.patch_pixels as usize,
        position_step: (POSITION_STEP * options.resolution) as f32,
    };
    let mut report = Report::default();

    progress.update("merging points", 0.0);
    let samples = report.time("merging points", || Samples::merge(cloud, options, progress))?;
    let placed = report.time("placing patches", || place(&samples, grid, progress))?;
    let placed = in_storing_order(placed, options);
    let images = report.time("projecting patches", || project(&samples, &placed, grid));
    progress.check()?;
    describe(&mut report, cloud, &samples, &placed, &images);

    let steps = steps(options);
    let depth = learn_depth(&images, grid, options, steps, &mut report, progress)?;
    let color = learn_color(&images, grid, options, steps, &mut report, progress)?;
    report.figures.push(("depth dictionary entries", depth.dictionary.n_atoms() as f64));
    if let Some(color) = &color {
        report.figures.push(("colour dictionary entries", color.dictionary.n_atoms() as f64));
    }
    report.stop_reason = "every point is covered and the dictionaries are learned";
    let level = Level {
        pixel_size: options.resolution,
        pixels: options.patch_pixels,
        steps,
        poses: placed.iter().map(|p| p.pose).collect(),
        masks: images.mask,
        depth,
        color,
    };
    let parts = PatchModelParts {
        origin: cloud.origin(),
        n_points: cloud.len() as u64,
        levels: vec![level],
    };
    Ok(PatchModel::from_parts(parts)?.with_report(report))
}

fn check_extent(cloud: &PointCloud, options: &PatchOptions) -> Result<()> {
    let Some((low, high)) = cloud.bounds() else { return Err(Error::EmptyCloud) };
    let origin = cloud.origin();
    let extent = (0..3)
        .map(|a| (low[a] - origin[a]).abs().max((high[a] - origin[a]).abs()))
        .fold(0.0, f64::max);
    // Single precision must still resolve a twentieth of a pixel at the far end, which also bounds the number of
    // half-pixel cells along an axis by 2^21.
    let precise = options.resolution * 0.05 * f64::from(1 << 23);
    let limit = precise.min(POSITION_STEP * options.resolution * f64::from(MAX_POSITION));
    if extent > limit {
        return Err(Error::TooLarge { extent, limit, resolution: options.resolution });
    }
    Ok(())
}

fn in_storing_order(placed: Vec<Placed>, options: &PatchOptions) -> Vec<Placed> {
    let poses: Vec<_> = placed.iter().map(|p| p.pose).collect();
    let position_step = POSITION_STEP * options.resolution;
    let side = steps_per_cell(options.resolution, options.patch_pixels, position_step);
    let mut placed: Vec<Option<Placed>> = placed.into_iter().map(Some).collect();
    storing_order(&poses, side).into_iter().filter_map(|i| placed[i].take()).collect()
}

/// Quantiser steps at which rounding all coefficients of a full code costs about half of the tolerance.
fn steps(options: &PatchOptions) -> Steps {
    let code_step = |tolerance: f64, n_features: f64, sparsity: u32| {
        tolerance * (3.0 * n_features / f64::from(sparsity)).sqrt()
    };
    let area = f64::from(options.patch_pixels * options.patch_pixels);
    let depth_tolerance = options.depth_tolerance();
    Steps {
        position: POSITION_STEP * options.resolution,
        depth_mean: depth_tolerance,
        depth_code: code_step(depth_tolerance, area, options.depth_sparsity),
        color_mean: 0.5 * options.color_tolerance,
        color_code: code_step(options.color_tolerance, 3.0 * area, options.color_sparsity),
    }
}

fn describe(
    report: &mut Report,
    cloud: &PointCloud,
    samples: &Samples,
    placed: &[Placed],
    images: &Images,
) {
    let set = images.mask.iter().map(|&m| usize::from(m)).sum::<usize>();
    let covered: usize = placed.iter().map(|p| p.members.len()).sum();
    report.figures.extend([
        ("points", cloud.len() as f64),
        ("samples", samples.len() as f64),
        ("samples covered", covered as f64),
        ("patches", placed.len() as f64),
        ("set pixels", set as f64),
        ("set pixels per patch", set as f64 / placed.len().max(1) as f64),
    ]);
    report.not_kept = [
        ("intensities", cloud.intensities().is_some()),
        ("normals", cloud.normals().is_some()),
        ("ranges", cloud.ranges().is_some()),
        ("viewpoints", cloud.viewpoints().is_some()),
    ]
    .into_iter()
    .filter_map(|(name, present)| present.then_some(name))
    .collect();
}

/// Means in steps and what remains of `images` without them, plane by plane of `area` pixels.
struct Centred {
    means: Vec<i32>,
    rest: Vec<f32>,
}

fn learn_depth(
    images: &Images,
    grid: Grid,
    options: &PatchOptions,
    steps: Steps,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Channel> {
    let area = grid.n * grid.n;
    let weights: Vec<f32> = images.mask.iter().map(|&m| f32::from(m)).collect();
    let mut rest = images.depth.clone();
    let means = (rest.par_chunks_mut(area).zip(images.mask.par_chunks(area)))
        .map(|(values, mask)| {
            let mean = masked_mean(values, mask) / steps.depth_mean;
            let stored = mean.round() as i32;
            subtract(values, mask, (f64::from(stored) * steps.depth_mean) as f32);
            stored
        })
        .collect();
    let centred = Centred { means, rest };
    let channel = ChannelOptions {
        name: "learning depth",
        cropped: "depth dictionary entries cropped",
        n_atoms: options.depth_atoms as usize,
        sparsity: options.depth_sparsity as usize,
        tolerance: options.depth_tolerance() as f32,
        code_step: steps.depth_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    finish(area, centred, &weights, channel, report, progress)
}

fn learn_color(
    images: &Images,
    grid: Grid,
    options: &PatchOptions,
    steps: Steps,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Option<Channel>> {
    let Some(color) = &images.color else { return Ok(None) };
    let area = grid.n * grid.n;
    let weights: Vec<f32> = images
        .mask
        .chunks(area)
        .flat_map(|mask| mask.iter().chain(mask).chain(mask))
        .map(|&m| f32::from(m))
        .collect();
    let mut rest = color.clone();
    let means: Vec<[i32; 3]> = (rest.par_chunks_mut(3 * area).zip(images.mask.par_chunks(area)))
        .map(|(values, mask)| {
            let rgb: [f32; 3] = std::array::from_fn(|c| {
                masked_mean(&values[c * area..(c + 1) * area], mask) as f32
            });
            let stored = to_ycocg(rgb).map(|c| (f64::from(c) / steps.color_mean).round() as i32);
            let decoded = stored.map(|c| (f64::from(c) * steps.color_mean) as f32);
            for (c, mean) in super::decode::to_rgb(decoded).into_iter().enumerate() {
                subtract(&mut values[c * area..(c + 1) * area], mask, mean);
            }
            stored
        })
        .collect();
    let centred = Centred { means: means.into_flattened(), rest };
    let channel = ChannelOptions {
        name: "learning colour",
        cropped: "colour dictionary entries cropped",
        n_atoms: options.color_atoms as usize,
        sparsity: options.color_sparsity as usize,
        tolerance: options.color_tolerance as f32,
        code_step: steps.color_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    finish(3 * area, centred, &weights, channel, report, progress).map(Some)
}

fn finish(
    n_features: usize,
    centred: Centred,
    weights: &[f32],
    options: ChannelOptions,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Channel> {
    let start = std::time::Instant::now();
    let (dictionary, codes) =
        learn_channel(n_features, &centred.rest, weights, options, report, progress)?;
    report
        .stages
        .push(crate::report::Stage { name: options.name, seconds: start.elapsed().as_secs_f64() });
    Ok(Channel { dictionary, means: centred.means, codes })
}

fn masked_mean(values: &[f32], mask: &[u8]) -> f64 {
    let set = mask.iter().filter(|&&m| m != 0).count();
    let sum: f64 =
        values.iter().zip(mask).filter(|(_, m)| **m != 0).map(|(v, _)| f64::from(*v)).sum();
    sum / set.max(1) as f64
}

fn subtract(values: &mut [f32], mask: &[u8], mean: f32) {
    for (value, _) in values.iter_mut().zip(mask).filter(|(_, m)| **m != 0) {
        *value -= mean;
    }
}
