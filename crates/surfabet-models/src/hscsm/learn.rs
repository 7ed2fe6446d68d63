//! The whole way from a cloud to a model.

use surfabet_geom::{KdTree, PointCloud, Progress};

use super::channels::dictionary::{HscsmDictionary, LevelDictionary};
use super::channels::images::project;
use super::channels::means::{LevelTask, learn_color, learn_depth};
use super::constants::{GATE_DEVIATIONS, LEFT_PIXELS, POSITION_STEP, SPACINGS_PER_PIXEL};
use super::intensity::{IntensityLimits, Shades};
use super::model::{HscsmModel, HscsmModelParts, Level, MAX_POSITION, Steps};
use super::options::HscsmOptions;
use super::order::{steps_per_cell, storing_order};
use super::placement::{OwnedPatch, PixelGrid, Rules, place};
use super::report::{HscsmReport, LearnedLevel, LevelFigures, report};
use super::samples::Samples;
use crate::attribute_error::measure;
use crate::contract::{DecodeOptions, SurfaceModel};
use crate::error::{Error, Result};
use crate::extent::{check_extent, reach};
use crate::options::Options;
use crate::report::{AttributeFigures, lost};
use crate::stages::Stages;
use crate::start::{Leave, Start};

/// The stages of learning, with their shares of the progress; all but the first come back level after level.
const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 0.05),
    ("merging points", 0.1),
    ("placing patches", 0.4),
    ("projecting patches", 0.05),
    ("learning depth", 0.2),
    ("learning colour", 0.25),
    ("measuring attributes", 0.1),
];

/// Points of a set pixel that are decoded half a pixel apart.
const POINTS_PER_PIXEL: f64 = 4.0;

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
    run(cloud, options, None, progress)
}

/// Describes a cloud as [`learn`] does, in the dictionaries of another model: nothing is learned, and the file
/// refers to that model instead of holding dictionaries of its own.
///
/// # Errors
/// As [`learn`]; [`Error::Inconsistent`] when `options` are of another hierarchy than the dictionary, or the cloud
/// has colours or intensities and the dictionary none.
pub fn describe(
    cloud: &PointCloud,
    options: &HscsmOptions,
    dictionary: &HscsmDictionary,
    progress: &dyn Progress,
) -> Result<HscsmModel> {
    options.check()?;
    let own = dictionary.options().resolution;
    let options = &HscsmOptions { resolution: options.resolution.or(own), ..options.clone() };
    dictionary.check(options)?;
    let what = match (cloud.colors(), IntensityLimits::in_place_of_colors(cloud)) {
        (Some(_), _) => Some("colours"),
        (None, limits) => limits.map(|_| "intensities"),
    };
    if let Some(what) = what
        && dictionary.levels.iter().any(|l| l.color.is_none())
    {
        return Err(Error::Inconsistent(format!(
            "the cloud has {what}, the dictionary has none; learn it from a cloud with {what}"
        )));
    }
    run(cloud, options, Some(dictionary), progress)
}

fn run(
    cloud: &PointCloud,
    options: &HscsmOptions,
    frozen: Option<&HscsmDictionary>,
    progress: &dyn Progress,
) -> Result<HscsmModel> {
    options.check()?;
    let mut stages = Stages::new(STAGES, progress);
    // What the data say of the options that are not given.
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(cloud, quality, Leave::Strays, keep, &mut stages)?;
    let resolution = start.pixel(options.resolution, SPACINGS_PER_PIXEL);
    let tolerance = start.tolerance(options.resolution);
    let options = &HscsmOptions { resolution: Some(resolution), ..options.clone() };
    let cloud: &PointCloud = &start.cloud;
    let extent = reach(cloud)?.into_iter().fold(0.0, f64::max);
    check_extent(extent, resolution, POSITION_STEP * f64::from(MAX_POSITION))?;

    // The sub-sampled cloud P' (III-A).
    let limits = IntensityLimits::in_place_of_colors(cloud);
    let samples = stages.run("merging points", |progress| {
        let shades = Shades::of(cloud, limits);
        Samples::merge(cloud, &shades, options, progress)
    })?;
    // The hierarchy H, coarsest level first: each describes what it can of the samples that are left.
    let mut owned = vec![false; samples.len()];
    let mut levels = Vec::with_capacity(options.levels as usize);
    for j in 0..options.levels {
        let frozen = frozen.and_then(|d| d.levels.get(j as usize));
        let task = level_task(options, j, frozen);
        levels.push(learn_level(&samples, &mut owned, &task, &mut stages)?);
    }

    let mut report = HscsmReport {
        stop_reason: match frozen {
            None => "every point is covered and the dictionaries are learned",
            Some(_) => "every point is covered",
        },
        not_kept: lost(cloud, &[limits.map_or("colors", |_| "intensities")]),
        ..report(cloud.len(), samples.len(), &levels)
    };
    let parts = HscsmModelParts {
        origin: cloud.origin(),
        n_points: cloud.len() as u64,
        levels: levels.into_iter().map(|l| l.level).collect(),
        intensity: limits,
        shares_vocabulary: frozen.is_some(),
    };
    start.report(tolerance, &mut report);
    let model = HscsmModel::from_parts(parts)?;
    report.attributes = attributes(&model, cloud, &mut stages)?;
    report.stages = stages.finish();
    Ok(model.with_report(report))
}

/// What colours or intensities take, and how far they are off where the points of `cloud` are.
fn attributes(
    model: &HscsmModel,
    cloud: &PointCloud,
    stages: &mut Stages<'_>,
) -> Result<Vec<AttributeFigures>> {
    let name = match (model.has_color(), model.has_intensity()) {
        (true, _) => "colors",
        (_, true) => "intensities",
        _ => return Ok(Vec::new()),
    };
    // Half a pixel, but wide pixels of a hierarchy must not become many times as many points as were given.
    let most = POINTS_PER_PIXEL * cloud.len() as f64;
    let mut spacing = 0.5 * model.levels().last().map_or(1.0, |l| l.pixel_size);
    while model.points_at(spacing) > most {
        spacing *= 2.0;
    }
    stages.run("measuring attributes", |progress| {
        let bytes = model.price().last().copied().unwrap_or_default();
        let mut figures =
            vec![AttributeFigures { name: name.to_owned(), bytes, rmse: None, equal: None }];
        let options = DecodeOptions {
            resolution: Some(spacing),
            max_points: u64::MAX,
            ..DecodeOptions::default()
        };
        let decoded = model.decode(options, progress)?;
        measure(&mut figures, cloud, &decoded, progress)?;
        Ok(figures)
    })
}

fn level_task<'a>(
    options: &'a HscsmOptions,
    level: u32,
    frozen: Option<&'a LevelDictionary>,
) -> LevelTask<'a> {
    let area = (options.patch_pixels * options.patch_pixels) as usize;
    LevelTask { options, level, area, steps: steps(options, level), frozen }
}

/// Describes what a level can of the samples that are not `owned` yet; the others go down.
fn learn_level(
    samples: &Samples,
    owned: &mut Vec<bool>,
    task: &LevelTask<'_>,
    stages: &mut Stages<'_>,
) -> Result<LearnedLevel> {
    let LevelTask { options, level: j, .. } = *task;
    let n_levels = options.levels as usize;
    let pixel_size = options.pixel_size(j);
    let grid = PixelGrid {
        pixel: pixel_size as f32,
        n: options.patch_pixels as usize,
        position_step: (POSITION_STEP * pixel_size) as f32,
    };
    // Poses T, and which patch owns which samples (III-A).
    let (patches, distance) = stages.run_round("placing patches", n_levels, |progress| {
        let (doublings, rules) = (options.doublings(j), rules(options, j));
        let patches = place(samples, owned, doublings, grid, rules, options.placement, progress)?;
        let patches = in_storing_order(patches, pixel_size, options.patch_pixels);
        let distance = neighbour_distance(&patches, grid, progress)?;
        Ok((patches, distance))
    })?;
    // Depth and colour images, bitmasks b (III, figure 2).
    let images = stages
        .run_round("projecting patches", n_levels, |_| Ok(project(samples, &patches, grid)))?;
    // Dictionaries and sparse codes c of both channels (III-B).
    let (depth, depth_learning) = stages
        .run_round("learning depth", n_levels, |progress| learn_depth(&images, task, progress))?;
    let (color, color_learning) = match &images.color {
        None => (None, None),
        Some(colors) => {
            let (color, learning) = stages.run_round("learning colour", n_levels, |progress| {
                learn_color(colors, &images, task, progress)
            })?;
            (Some(color), learning)
        }
    };
    let level = Level {
        pixel_size,
        pixels: options.patch_pixels,
        steps: task.steps,
        poses: patches.iter().map(|p| p.pose).collect(),
        masks: images.mask,
        depth,
        color,
    };
    let figures = LevelFigures::new(&level, &patches, distance);
    Ok(LearnedLevel { level, figures, depth: depth_learning, color: color_learning })
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
    patches: &[OwnedPatch],
    grid: PixelGrid,
    progress: &dyn Progress,
) -> Result<Option<f64>> {
    if patches.len() < 2 {
        return Ok(None);
    }
    let centers: Vec<[f32; 3]> =
        patches.iter().map(|p| p.pose.frame(grid.position_step).center).collect();
    let nearest = KdTree::new(&centers)?.k_nearest_batch(&centers, 2, progress)?;
    let sum: f64 = nearest.chunks(2).map(|pair| f64::from(pair[1].squared_distance()).sqrt()).sum();
    Ok(Some(sum / patches.len() as f64))
}

/// The patches in the order in which a file stores them.
fn in_storing_order(patches: Vec<OwnedPatch>, pixel_size: f64, pixels: u32) -> Vec<OwnedPatch> {
    let poses: Vec<_> = patches.iter().map(|p| p.pose).collect();
    let side = steps_per_cell(pixel_size, pixels, POSITION_STEP * pixel_size);
    let mut patches: Vec<Option<OwnedPatch>> = patches.into_iter().map(Some).collect();
    storing_order(&poses, side).into_iter().filter_map(|i| patches[i].take()).collect()
}

/// Quantiser steps of level `j`.
///
/// Rounding to a step q makes a squared error of q^2 / 12 per coefficient, so that k of them, spread over n values, make
/// a mean squared error of k q^2 / (12 n). With `q = tolerance sqrt(3 n / k)` that is a quarter of the squared tolerance:
/// rounding all coefficients of a full code costs half of the tolerance.
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
