//! The whole way from a cloud to a model.

use rayon::prelude::*;
use surfabet_geom::{KdTree, PointCloud, Progress};

use super::channels::dictionary::{
    ChannelOptions, HscsmDictionary, LevelDictionary, learn_channel,
};
use super::channels::images::{Images, project};
use super::model::{Channel, HscsmModel, HscsmModelParts, Level, MAX_POSITION, Steps};
use super::options::HscsmOptions;
use super::order::{steps_per_cell, storing_order};
use super::placement::field::{Grid, Rules};
use super::placement::{Placed, place};
use super::samples::Samples;
use crate::color::{to_rgb, to_ycocg};
use crate::error::{Error, Result};
use crate::extent::{check_extent, reach};
use crate::options::Options;
use crate::report::{Report, lost};

/// Position lattice, in pixels: a quarter of a pixel moves no sample visibly, since depth and colour are measured
/// after the pose is rounded.
const POSITION_STEP: f64 = 0.25;

/// Share of a patch's pixels that must be left above the lowest level when those that deviate too much are masked
/// out: below it, the patches of the next level describe the same with fewer poses than would be needed twice.
const LEFT_PIXELS: f64 = 0.5;

/// Above the lowest level growth accepts depths within this many times the largest deviation: a layer of points spread
/// evenly over that deviates just as much as a pixel may. What is thicker becomes several sheets, as at the lowest
/// level, where the gate is a pixel.
const GATE_DEVIATIONS: f64 = 1.732_050_807_568_877_2;

/// Learns surface patches from a cloud: SCSM with one level, HSCSM with several.
///
/// From the coarsest level on, each describes what it can within the thresholds and passes the rest down. The
/// result depends on cloud, options and seed alone, not on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain, [`Error::EmptyCloud`], [`Error::TooLarge`] when
/// the scene does not fit the position lattice, [`Error::Cancelled`] when the caller asks to stop.
pub fn learn(
    cloud: &PointCloud,
    options: &HscsmOptions,
    progress: &dyn Progress,
) -> Result<HscsmModel> {
    describe(cloud, options, None, progress)
}

/// Describes a cloud as [`learn`] does, in the dictionaries of another model: nothing is learned, and the file
/// refers to that model instead of holding dictionaries of its own.
///
/// # Errors
/// As [`learn`]; [`Error::Inconsistent`] when `options` are of another hierarchy than the dictionary, or the cloud
/// has colours and the dictionary none.
pub fn encode(
    cloud: &PointCloud,
    options: &HscsmOptions,
    dictionary: &HscsmDictionary,
    progress: &dyn Progress,
) -> Result<HscsmModel> {
    options.check()?;
    dictionary.check(options)?;
    if cloud.colors().is_some() && dictionary.levels.iter().any(|l| l.color.is_none()) {
        return Err(Error::Inconsistent(
            "the cloud has colours, the dictionary has none; learn it from a cloud with colours"
                .to_owned(),
        ));
    }
    describe(cloud, options, Some(dictionary), progress)
}

fn describe(
    cloud: &PointCloud,
    options: &HscsmOptions,
    frozen: Option<&HscsmDictionary>,
    progress: &dyn Progress,
) -> Result<HscsmModel> {
    options.check()?;
    let extent = reach(cloud)?.into_iter().fold(0.0, f64::max);
    check_extent(extent, options.resolution, POSITION_STEP * f64::from(MAX_POSITION))?;
    let mut report = Report::default();

    progress.update("merging points", 0.0);
    let samples = report.time("merging points", || Samples::merge(cloud, options, progress))?;
    describe_cloud(&mut report, cloud, &samples);
    let mut owned = vec![false; samples.len()];
    let mut levels = Vec::with_capacity(options.levels as usize);
    for j in 0..options.levels {
        let frozen = frozen.and_then(|d| d.levels.get(j as usize));
        levels.push(learn_level(&samples, &mut owned, j, options, frozen, &mut report, progress)?);
    }
    report.stop_reason = match frozen {
        None => "every point is covered and the dictionaries are learned",
        Some(_) => "every point is covered",
    };
    let parts = HscsmModelParts {
        origin: cloud.origin(),
        n_points: cloud.len() as u64,
        levels,
        shared_dictionary: frozen.is_some(),
    };
    Ok(HscsmModel::from_parts(parts)?.with_report(report))
}

/// Describes what level `j` can of the samples that are not `owned` yet; the others go down.
fn learn_level(
    samples: &Samples,
    owned: &mut Vec<bool>,
    j: u32,
    options: &HscsmOptions,
    frozen: Option<&LevelDictionary>,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Level> {
    let pixel_size = options.pixel_size(j);
    let grid = Grid {
        pixel: pixel_size as f32,
        n: options.patch_pixels as usize,
        position_step: (POSITION_STEP * pixel_size) as f32,
    };
    let doublings = options.doublings(j);
    let placed = report.time("placing patches", || {
        place(samples, owned, doublings, grid, rules(options, j), options.placement, progress)
    })?;
    let placed = in_storing_order(placed, pixel_size, options.patch_pixels);
    let images = report.time("projecting patches", || project(samples, &placed, grid));
    progress.check()?;

    let taken = placed.iter().map(|p| p.members.len()).sum::<usize>();
    let distance = neighbour_distance(&placed, grid, progress)?;
    let steps = steps(options, j);
    let scale = Scale { level: j, grid, steps, frozen };
    let depth = learn_depth(&images, scale, options, report, progress)?;
    let color = learn_color(&images, scale, options, report, progress)?;
    let set = images.mask.iter().map(|&m| usize::from(m)).sum::<usize>();
    let entries = |channel: &Channel| channel.dictionary.n_atoms() as f64;
    let figures = [
        ("samples covered", taken as f64),
        ("patches", placed.len() as f64),
        ("set pixels", set as f64),
        ("area", set as f64 * pixel_size * pixel_size),
        ("depth dictionary entries", entries(&depth)),
        ("colour dictionary entries", color.as_ref().map_or(0.0, entries)),
    ];
    for (name, value) in figures {
        report.add_figure(name, value);
    }
    let mut of_level = vec![("pixel size", pixel_size)];
    of_level.extend(figures);
    of_level.push(("set pixels per patch", set as f64 / placed.len().max(1) as f64));
    of_level.extend(distance.map(|d| ("distance of neighbouring patches", d)));
    report.levels.push(of_level);
    Ok(Level {
        pixel_size,
        pixels: options.patch_pixels,
        steps,
        poses: placed.iter().map(|p| p.pose).collect(),
        masks: images.mask,
        depth,
        color,
    })
}

/// What level `j` accepts; the lowest takes all.
fn rules(options: &HscsmOptions, j: u32) -> Rules {
    let pixel = options.pixel_size(j);
    if options.doublings(j) == 0 {
        return Rules {
            gate: pixel as f32,
            min_covered: 0,
            min_pixels: 0,
            max_depth_variance: f64::INFINITY,
            max_color_variance: f64::INFINITY,
        };
    }
    let area = f64::from(options.patch_pixels * options.patch_pixels);
    let pixels = |share: f64| ((share * area).ceil() as usize).max(1);
    let rho = options.max_depth_deviation();
    Rules {
        gate: (GATE_DEVIATIONS * rho) as f32,
        min_covered: pixels(options.min_coverage),
        min_pixels: pixels(LEFT_PIXELS.min(options.min_coverage)),
        max_depth_variance: rho * rho,
        max_color_variance: options.max_color_deviation * options.max_color_deviation,
    }
}

/// Mean distance from a patch of a level to the nearest other, metres; `None` for fewer than two patches.
fn neighbour_distance(
    placed: &[Placed],
    grid: Grid,
    progress: &dyn Progress,
) -> Result<Option<f64>> {
    if placed.len() < 2 {
        return Ok(None);
    }
    let centers: Vec<[f32; 3]> =
        placed.iter().map(|p| p.pose.frame(grid.position_step).center).collect();
    let nearest = KdTree::new(&centers)?.k_nearest_batch(&centers, 2, progress)?;
    let sum: f64 = nearest.chunks(2).map(|pair| f64::from(pair[1].squared_distance()).sqrt()).sum();
    Ok(Some(sum / placed.len() as f64))
}

fn in_storing_order(placed: Vec<Placed>, pixel_size: f64, pixels: u32) -> Vec<Placed> {
    let poses: Vec<_> = placed.iter().map(|p| p.pose).collect();
    let side = steps_per_cell(pixel_size, pixels, POSITION_STEP * pixel_size);
    let mut placed: Vec<Option<Placed>> = placed.into_iter().map(Some).collect();
    storing_order(&poses, side).into_iter().filter_map(|i| placed[i].take()).collect()
}

/// Quantiser steps of level `j` at which rounding all coefficients of a full code costs about half of the
/// tolerance.
fn steps(options: &HscsmOptions, j: u32) -> Steps {
    let code_step = |tolerance: f64, n_features: f64, sparsity: u32| {
        tolerance * (3.0 * n_features / f64::from(sparsity)).sqrt()
    };
    let area = f64::from(options.patch_pixels * options.patch_pixels);
    let depth_tolerance = options.depth_tolerance(j);
    let color_tolerance = options.color_tolerance(j);
    Steps {
        position: POSITION_STEP * options.pixel_size(j),
        depth_mean: depth_tolerance,
        depth_code: code_step(depth_tolerance, area, options.depth_sparsity),
        color_mean: 0.5 * color_tolerance,
        color_code: code_step(color_tolerance, 3.0 * area, options.color_sparsity),
    }
}

fn describe_cloud(report: &mut Report, cloud: &PointCloud, samples: &Samples) {
    report.figures.extend([("points", cloud.len() as f64), ("samples", samples.len() as f64)]);
    report.not_kept = lost(cloud, &["colors"]);
}

/// The level that a channel is learned for.
#[derive(Clone, Copy)]
struct Scale<'a> {
    level: u32,
    grid: Grid,
    steps: Steps,
    frozen: Option<&'a LevelDictionary>,
}

/// How the report calls the objective of `channel` at `level`.
fn objective(channel: &str, level: u32, options: &HscsmOptions) -> String {
    if options.levels == 1 { channel.to_owned() } else { format!("{channel}, level {level}") }
}

/// Means in steps and what remains of `images` without them, plane by plane of `area` pixels.
struct Centred {
    means: Vec<i32>,
    rest: Vec<f32>,
}

fn learn_depth(
    images: &Images,
    scale: Scale<'_>,
    options: &HscsmOptions,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Channel> {
    let Scale { level, grid, steps, frozen } = scale;
    let area = grid.area();
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
        objective: objective("learning depth", level, options),
        frozen: frozen.map(|f| &f.depth),
        cropped: "depth dictionary entries cropped",
        n_atoms: options.depth_atoms as usize,
        sparsity: options.depth_sparsity as usize,
        tolerance: options.depth_tolerance(level) as f32,
        code_step: steps.depth_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    finish(area, centred, &weights, &channel, report, progress)
}

fn learn_color(
    images: &Images,
    scale: Scale<'_>,
    options: &HscsmOptions,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Option<Channel>> {
    let Some(color) = &images.color else { return Ok(None) };
    let Scale { level, grid, steps, frozen } = scale;
    let area = grid.area();
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
            for (c, mean) in to_rgb(decoded).into_iter().enumerate() {
                subtract(&mut values[c * area..(c + 1) * area], mask, mean);
            }
            stored
        })
        .collect();
    let centred = Centred { means: means.into_flattened(), rest };
    let channel = ChannelOptions {
        name: "learning colour",
        objective: objective("learning colour", level, options),
        frozen: frozen.and_then(|f| f.color.as_ref()),
        cropped: "colour dictionary entries cropped",
        n_atoms: options.color_atoms as usize,
        sparsity: options.color_sparsity as usize,
        tolerance: options.color_tolerance(level) as f32,
        code_step: steps.color_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    finish(3 * area, centred, &weights, &channel, report, progress).map(Some)
}

fn finish(
    n_features: usize,
    centred: Centred,
    weights: &[f32],
    options: &ChannelOptions<'_>,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Channel> {
    let start = std::time::Instant::now();
    let (dictionary, codes) =
        learn_channel(n_features, &centred.rest, weights, options, report, progress)?;
    report.add_time(options.name, start.elapsed().as_secs_f64());
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
