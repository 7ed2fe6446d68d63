//! The whole way from a cloud to a lattice model.

use rayon::prelude::*;
use surfabet_entropy::Price;
use surfabet_geom::{KdTree, PointCloud, Progress};

use super::axes::Orientation;
use super::choice::Choice;
use super::coding::{GeometryModels, Said, code_geometry};
use super::color::cells::nodes;
use super::color::targets::targets;
use super::color::{ColorModels, ColorSteps, Source, code_colors};
use super::model::{ColorField, Lattice, LevelSize, Node, PatchModel, Root, extra_key};
use super::options::PatchesOptions;
use super::samples::cells::LIMIT;
use super::samples::{SAMPLE_SIZE, Samples};
use super::sheets::{Sheet, grow};
use super::surface::basis::Basis;
use crate::contract::DecodeOptions;
use crate::error::{Error, Result};
use crate::extent::{check_extent, reach};
use crate::options::Options;
use crate::report::{Report, lost};

/// Side of the cells that vote for the scene's axes, in pixels.
const AXES_CELL: f64 = 6.0;

/// Diagonal of a cube over its side, turned round: cells of this side keep their points within half the bound.
const WITHIN: f64 = 1.15;

/// Learns a lattice model from a cloud.
///
/// The result depends on cloud and options alone, not on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain, [`Error::EmptyCloud`], [`Error::TooLarge`] when
/// the scene does not fit the lattice, [`Error::Cancelled`] when the caller asks to stop.
pub fn learn(
    cloud: &PointCloud,
    options: &PatchesOptions,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    options.check()?;
    // Turned to its axes, the scene may reach as far along one as its corner is from the origin.
    let extent = reach(cloud)?.map(|c| c * c).iter().sum::<f64>().sqrt();
    check_extent(extent, options.resolution, SAMPLE_SIZE * f64::from(LIMIT - 2))?;
    let mut report = Report::default();
    progress.update("merging points", 0.0);
    let cell = (AXES_CELL * options.resolution) as f32;
    let orientation = report.time("finding axes", || Orientation::of(cloud, cell));
    let samples = report.time("merging points", || {
        Samples::merge(cloud, orientation, options.resolution, options.sensor, progress)
    })?;
    let lattice = Lattice {
        origin: cloud.origin(),
        orientation,
        pixel_size: options.resolution,
        levels: options.levels,
        depth_step: options.depth_sixteenths(),
    };
    progress.update("growing sheets", 0.3);
    let sheets = report.time("growing sheets", || {
        grow(&samples, options.resolution as f32, lattice.tile_pixels())
    })?;
    progress.check()?;
    progress.update("choosing patches", 0.4);
    let chosen = choose(lattice, &sheets, options, &mut report, progress)?;
    progress.update("colouring", 0.8);
    let start = std::time::Instant::now();
    // A learned model has no more cells than its samples call for; the bound is for files.
    let keys = if samples.has_color {
        nodes(lattice, &chosen.leaves, u64::MAX).unwrap_or_default()
    } else {
        Vec::new()
    };
    let color = samples.has_color.then(|| {
        let colors = targets(&samples, &keys, options.resolution as f32);
        let steps = ColorSteps {
            luma: options.color_step,
            chroma: (f64::from(options.color_step) * options.chroma_ratio).round().max(1.0) as u32,
        };
        let lambda = options.color_rate * f64::from(options.color_step).powi(2);
        let source = Source::Targets { colors: &colors, lambda: lambda as f32 };
        let Ok(said) =
            code_colors(&mut Price::default(), &mut ColorModels::default(), &keys, steps, source);
        (ColorField { steps, coefficients: said.coefficients }, said.colors)
    });
    report.add_time("colouring", start.elapsed().as_secs_f64());
    progress.check()?;
    report.figures.extend([
        ("points", cloud.len() as f64),
        ("samples", samples.samples.len() as f64),
        ("sheets", sheets.len() as f64),
        ("cells of colour", keys.len() as f64),
    ]);
    report.not_kept = lost(cloud, &["colors"]);
    report.stop_reason = "every sheet has the hierarchy of least cost";
    let mut model = PatchModel::new(cloud.len() as u64, lattice, chosen, color, keys, report)?;
    if let Some(bound) = options.max_error {
        let start = std::time::Instant::now();
        model = keep_far_points(model, cloud, bound, progress)?;
        let seconds = start.elapsed().as_secs_f64();
        model.report_mut().add_time("checking the bound", seconds);
    }
    describe(&mut model);
    Ok(model)
}

/// Chooses the hierarchies of all sheets, a few rounds over, each with the prices that the round before taught.
fn choose(
    lattice: Lattice,
    sheets: &[Sheet],
    options: &PatchesOptions,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<Said> {
    let start = std::time::Instant::now();
    let bases = Basis::of_levels(options.levels);
    // Errors are summed over samples; what a bit must save is said per pixel, so that dense and sparse scans
    // are treated alike.
    let large = || sheets.iter().filter(|s| !s.small).flat_map(|s| &s.runs);
    let density = if large().next().is_some() {
        large().map(|r| f64::from(r.n)).sum::<f64>() / large().count() as f64
    } else {
        1.0
    };
    report.figures.push(("samples per pixel", density));
    let mut models = GeometryModels::default();
    let mut bits = Vec::new();
    let mut chosen = Said::default();
    for _ in 0..options.rounds {
        let choice = Choice {
            models: &models,
            bases: &bases,
            lambda: (options.rate * density) as f32,
            step: options.depth_step as f32,
            levels: options.levels,
        };
        let roots: Vec<Root> = sheets
            .par_iter()
            .map(|sheet| {
                progress.check()?;
                let node = choice.root(sheet);
                let root = Root { side: sheet.side, tile: sheet.tile, node };
                Ok((root.node != Node::Empty).then_some(root))
            })
            .collect::<Result<Vec<Option<Root>>>>()?
            .into_iter()
            .flatten()
            .collect();
        let mut price = Price::default();
        models = GeometryModels::default();
        let Ok(said) = code_geometry(&mut price, &mut models, lattice, &roots, usize::MAX);
        chosen = said;
        bits.push(price.bits / 8.0);
    }
    report.add_time("choosing patches", start.elapsed().as_secs_f64());
    report.iterations = bits.len();
    report.objectives.push(("bytes of geometry".into(), bits));
    Ok(chosen)
}

/// Adds a point for every cell that holds input points further than `bound` from the decoded cloud.
fn keep_far_points(
    model: PatchModel,
    cloud: &PointCloud,
    bound: f64,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    let decoded =
        model.decode(DecodeOptions { as_measured: true, ..DecodeOptions::default() }, progress)?;
    let rows = model.lattice().orientation.rotation();
    let extent =
        cloud.positions().iter().flat_map(|p| p.map(|c| f64::from(c.abs()))).fold(0.0, f64::max);
    // What rounding of coordinates to single precision may add.
    let limit = bound - 4.0 * extent * f64::from(f32::EPSILON);
    let largest = f64::from(LIMIT) * 0.5 * bound;
    if limit < 0.5 * bound || extent > largest {
        return Err(Error::TooLarge { extent, limit: largest, resolution: bound });
    }
    let far: Vec<[f32; 3]> = if decoded.is_empty() {
        cloud.positions().to_vec()
    } else {
        let tree = KdTree::new(decoded.positions())?;
        let nearest = tree.nearest_batch(cloud.positions(), progress)?;
        let is_far = |n: &surfabet_geom::Neighbor| f64::from(n.squared_distance()).sqrt() > limit;
        let pairs = cloud.positions().iter().zip(&nearest);
        pairs.filter(|(_, n)| is_far(n)).map(|(&p, _)| p).collect()
    };
    let size = WITHIN * limit;
    let to_lattice = |p: [f32; 3]| -> [f32; 3] {
        std::array::from_fn(|a| (0..3).map(|k| rows[k][a] * f64::from(p[k])).sum::<f64>() as f32)
    };
    let mut keys: Vec<u64> = far.par_iter().map(|&p| extra_key(to_lattice(p), size)).collect();
    keys.par_sort_unstable();
    keys.dedup();
    Ok(model.with_extra(keys, size, bound))
}

fn describe(model: &mut PatchModel) {
    let lattice = model.lattice();
    let level = |(l, of): (u32, LevelSize)| {
        let pixel = lattice.pixel_of(l);
        let area = of.set_pixels as f64 * pixel * pixel;
        vec![("pixel size", pixel), ("patches", of.patches as f64), ("area", area)]
    };
    let levels = (0..lattice.levels).zip(model.level_sizes()).rev().map(level).collect();
    let (n, extra) = (model.len() as f64, model.header().n_extra as f64);
    let report = model.report_mut();
    report.figures.extend([("patches", n), ("extra points", extra)]);
    report.levels = levels;
}
