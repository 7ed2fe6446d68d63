//! The whole way from a cloud to a model: steps 1 to 4 of `docs/hscsm.md`. Step 5, the bytes, is `coding`.

use surfabet_geom::{KdTree, PointCloud, Progress};

use super::channels::dictionary::{HscsmDictionary, LevelDictionary};
use super::channels::images::{Images, project};
use super::channels::means::{LevelTask, color_images, depth_images, learn_color, learn_depth};
use super::constants::{GATE_DEVIATIONS, LEFT_PIXELS, POSITION_STEP, SPACINGS_PER_PIXEL};
use super::intensity::{IntensityLimits, Shades};
use super::model::{HscsmModel, HscsmModelParts, Level, MAX_POSITION, Steps};
use super::options::HscsmOptions;
use super::order::{steps_per_cell, storing_order};
use super::placement::{OwnedPatch, PixelGrid, Rules, place};
use super::report::{HscsmReport, LearnedLevel, LevelFigures, report};
use super::samples::Samples;
use crate::attribute_error::measured;
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
/// [`Error::InvalidParameter`] for options outside their domain and a resolution too small for the scene,
/// [`Error::EmptyCloud`], [`Error::Cancelled`] when the caller asks to stop.
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
    let options = &options.in_force();
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
    let area = (options.patch_pixels * options.patch_pixels) as usize;
    if cloud.colors().is_some() && dictionary.color_planes(area) == Some(1) {
        return Err(Error::Inconsistent(
            "the cloud has colours, the dictionary was learned from intensities; learn it from a cloud with colours"
                .to_owned(),
        ));
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
    let options = &options.in_force();
    let mut stages = Stages::new(STAGES, progress);
    // Options that are not given follow from the data.
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(cloud, quality, Leave::Strays, keep, &mut stages)?;
    let resolution = start.pixel(options.resolution, SPACINGS_PER_PIXEL, None);
    HscsmOptions::check_found("resolution", resolution)?;
    let tolerance = start.tolerance(options.resolution);
    let options = &HscsmOptions { resolution: Some(resolution), ..options.clone() };
    let cloud: &PointCloud = &start.cloud;
    let extent = reach(cloud)?.into_iter().fold(0.0, f64::max);
    check_extent(extent, resolution, POSITION_STEP * f64::from(MAX_POSITION))?;

    // 1. Samples: the sub-sampled cloud P' (III-A).
    let limits = IntensityLimits::in_place_of_colors(cloud);
    let samples = stages.run("merging points", |progress| {
        let shades = Shades::of(cloud, limits);
        Samples::merge(cloud, &shades, options, progress)
    })?;
    // 2. and 3. The hierarchy H, coarsest level first: each describes what it can of the samples that are left.
    let mut owned = vec![false; samples.len()];
    // Grey of intensities has one plane, unless it is to be coded in dictionaries of colours.
    let area = (options.patch_pixels * options.patch_pixels) as usize;
    let grey = usize::from(limits.is_some());
    let planes = frozen.and_then(|d| d.color_planes(area)).unwrap_or(3 - 2 * grey);
    let mut placed = Vec::with_capacity(options.levels as usize);
    for j in 0..options.levels {
        let frozen = frozen.and_then(|d| d.levels.get(j as usize));
        let task = level_task(options, j, planes, frozen);
        placed.push(place_level(&samples, &mut owned, task, &mut stages)?);
    }
    // 4. Dictionaries and sparse codes c of both channels (III-B), of all levels together or one by one.
    let one_dictionary =
        frozen.map_or(options.levels > 1 && options.one_dictionary, HscsmDictionary::is_one);
    let levels = if one_dictionary {
        learn_levels(placed, options, 1, &mut stages)?
    } else {
        learn_one_by_one(placed, options, &mut stages)?
    };

    let mut report = HscsmReport {
        stop_reason: match frozen {
            None => "every point is covered and the dictionaries are learned",
            Some(_) => "every point is covered",
        },
        not_kept: lost(cloud, &[limits.map_or("colors", |_| "intensities")]),
        ..report(cloud.len(), samples.len(), &levels, one_dictionary)
    };
    let parts = HscsmModelParts {
        origin: cloud.origin(),
        n_points: cloud.len() as u64,
        levels: levels.into_iter().map(|l| l.level).collect(),
        intensity: limits,
        shares_vocabulary: frozen.is_some(),
        one_dictionary,
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
    let mut spacing = 0.5 * model.levels().last().map_or(1.0, Level::mask_pixel);
    while model.points_at(spacing) > most {
        spacing *= 2.0;
    }
    let bytes = model.price().last().copied().unwrap_or_default();
    let figures = vec![AttributeFigures { name: name.to_owned(), bytes, rmse: None, equal: None }];
    let options = DecodeOptions {
        resolution: Some(spacing),
        max_points: u64::MAX,
        ..DecodeOptions::default()
    };
    measured(model, figures, options, cloud, stages)
}

fn level_task<'a>(
    options: &'a HscsmOptions,
    level: u32,
    planes: usize,
    frozen: Option<&'a LevelDictionary>,
) -> LevelTask<'a> {
    let area = (options.patch_pixels * options.patch_pixels) as usize;
    LevelTask { options, level, area, planes, steps: steps(options, level, planes), frozen }
}

/// Patches of a level, and their images.
struct PlacedLevel<'a> {
    task: LevelTask<'a>,
    patches: Vec<OwnedPatch>,
    images: Images,
    mask_scale: u32,
    /// Mean distance of neighbouring patches, metres.
    distance: Option<f64>,
}

/// Places what a level can describe of the samples that are not `owned` yet; the others go down.
fn place_level<'a>(
    samples: &Samples,
    owned: &mut Vec<bool>,
    task: LevelTask<'a>,
    stages: &mut Stages<'_>,
) -> Result<PlacedLevel<'a>> {
    let LevelTask { options, level: j, .. } = task;
    let n_levels = options.levels as usize;
    let pixel_size = options.pixel_size(j);
    let grid = PixelGrid {
        pixel: pixel_size as f32,
        n: options.patch_pixels as usize,
        position_step: (POSITION_STEP * pixel_size) as f32,
    };
    // 2. Placement: poses T, and which patch owns which samples (III-A).
    let (patches, distance) = stages.run_round("placing patches", n_levels, |progress| {
        let (doublings, rules) = (options.doublings(j), rules(options, j));
        let patches = place(samples, owned, doublings, grid, rules, options, progress)?;
        let patches = in_storing_order(patches, pixel_size, options.patch_pixels);
        let distance = neighbour_distance(&patches, grid, progress)?;
        Ok((patches, distance))
    })?;
    // 3. Images: depth and colour, bitmasks b (III, figure 2).
    let mask_scale = options.mask_scale(j);
    let images = stages.run_round("projecting patches", n_levels, |_| {
        Ok(project(samples, &patches, grid, mask_scale, task.planes))
    })?;
    Ok(PlacedLevel { task, patches, images, mask_scale, distance })
}

/// Learns dictionaries of its own for each level.
fn learn_one_by_one(
    placed: Vec<PlacedLevel<'_>>,
    options: &HscsmOptions,
    stages: &mut Stages<'_>,
) -> Result<Vec<LearnedLevel>> {
    let rounds = placed.len();
    let mut levels = Vec::with_capacity(rounds);
    for level in placed {
        levels.extend(learn_levels(vec![level], options, rounds, stages)?);
    }
    Ok(levels)
}

/// Learns dictionaries for these levels together, and codes their patches in them.
fn learn_levels(
    placed: Vec<PlacedLevel<'_>>,
    options: &HscsmOptions,
    rounds: usize,
    stages: &mut Stages<'_>,
) -> Result<Vec<LearnedLevel>> {
    let (depths, mut depth_learning) = stages.run_round("learning depth", rounds, |progress| {
        let images = placed.iter().map(|p| depth_images(&p.images, &p.task)).collect();
        learn_depth(images, options, progress)
    })?;
    let color_images: Vec<_> = (placed.iter())
        .filter_map(|p| Some(color_images(p.images.color.as_ref()?, &p.images, &p.task)))
        .collect();
    let (mut colors, mut color_learning) = (vec![None; placed.len()], None);
    if !color_images.is_empty() {
        let (learned, learning) = stages.run_round("learning colour", rounds, |progress| {
            learn_color(color_images, options, progress)
        })?;
        // A cloud has colours or not, and with it all levels.
        colors = learned.into_iter().map(Some).collect();
        color_learning = learning;
    }
    let levels = placed.into_iter().zip(depths).zip(colors).map(|((placed, depth), color)| {
        let level = Level {
            pixel_size: options.pixel_size(placed.task.level),
            pixels: options.patch_pixels,
            steps: placed.task.steps,
            mask_scale: placed.mask_scale,
            poses: placed.patches.iter().map(|p| p.pose).collect(),
            masks: placed.images.bitmask,
            depth,
            color,
        };
        let figures = LevelFigures::new(&level, &placed.patches, placed.distance);
        // The first of several levels has how all were learned.
        let (depth, color) = (depth_learning.take(), color_learning.take());
        LearnedLevel { level, figures, depth, color }
    });
    Ok(levels.collect())
}

/// What level `j` accepts; the lowest takes all.
fn rules(options: &HscsmOptions, j: u32) -> Rules {
    let pixel = options.pixel_size(j);
    // All of a cube is within its side.
    let whole = options.patch_size(j);
    let gate = |gate: f64| if options.growth_gate { gate as f32 } else { whole as f32 };
    if options.doublings(j) == 0 {
        return Rules {
            gate: gate(pixel),
            min_covered: 0,
            min_pixels: 0,
            max_depth_variance: f64::INFINITY,
            max_color_variance: f64::INFINITY,
            max_pixel_offset: f64::INFINITY,
        };
    }
    let area = f64::from(options.patch_pixels * options.patch_pixels);
    let pixels = |share: f64| ((share * area).ceil() as usize).max(1);
    let rho = options.max_depth_deviation();
    Rules {
        gate: gate(GATE_DEVIATIONS * rho),
        min_covered: pixels(options.min_coverage),
        min_pixels: pixels(LEFT_PIXELS.min(options.min_coverage)),
        max_depth_variance: rho * rho,
        max_color_variance: options.max_color_deviation * options.max_color_deviation,
        max_pixel_offset: if options.fine_masks { f64::INFINITY } else { options.max_pixel_offset },
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
fn steps(options: &HscsmOptions, j: u32, planes: usize) -> Steps {
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
        color_code: code_step(color_tolerance, planes as f64 * area, options.color_sparsity),
    }
}
