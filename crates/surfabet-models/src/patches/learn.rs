//! The whole way from a cloud to a model.

use std::borrow::Cow;

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress, Survey};

use super::attributes::borders::{BorderBlocks, FieldCells};
use super::attributes::cells::{attribute_cells, sides_of_cells};
use super::attributes::chosen::{ChosenAttributes, Fields};
use super::attributes::targets::Targets;
use super::attributes::{AttributeHeader, FieldCoding};
use super::axes::Orientation;
use super::choice::{PointPrice, Rounds, RoundsOutcome};
use super::coding::Geometry;
use super::constants::{
    AXES_CELL, AXES_CELL_IN_GAPS, BOTH_BOUNDS_PER_PIXEL, BOUNDS_PER_PIXEL, DEPTH_STEP,
    DEPTH_STEP_IN_GAPS, SAMPLE_SIZE, SPACINGS_PER_PIXEL, SPACINGS_PER_PIXEL_IN_ROWS,
    TOLERANCE_SHARE,
};
use super::far_points::{Completeness, is_reached, least_bound};
use super::instances::{Instances, Motion};
use super::model::{Attributes, Lattice, LevelSize, PatchModel, SheetTree};
use super::options::{DEPTH_STEPS, PatchesOptions};
use super::recurrence::{Fold, Learned, recurring, support};
use super::samples::cells::LIMIT;
use super::samples::{SidedSamples, Weights};
use super::sheets::{Reach, Sheet, sheets};
use super::supported::with_support;
use super::surface::basis::Basis;
use super::surface::leaf::Leaf;
use super::tiles::{Shares, Tile};
use super::whole::{Described, Wanted, Whole};
use crate::error::Result;
use crate::extent::{check_extent, reach};
use crate::options::Options;
use crate::report::{AttributeFigures, Named, Report, figures, lost};
use crate::sensor::Sensor;
use crate::stages::Stages;
use crate::start::{Leave, OfBound, Start};

/// The stages of learning, with their shares of the progress.
pub(super) const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 0.05),
    ("finding axes", 0.05),
    ("merging points", 0.25),
    ("growing sheets", 0.1),
    ("choosing patches", 0.35),
    ("keeping to the input", 0.05),
    ("adding attributes", 0.1),
    ("finding what recurs", 0.1),
    ("checking the bound", 0.1),
];

/// Why depths are rounded more finely than usual.
const GAP_REASON: &str = "surfaces lie close behind one another";

/// The report of [`learn`].
pub type PatchesReport = Report<Option<PatchesFigures>>;

figures! {
    /// What [`learn`] counts and measures.
    pub struct PatchesFigures {
        /// Points of the cloud.
        pub points: usize = "points",
        /// Places that the points were merged to.
        pub samples: usize = "samples",
        /// Connected surfaces of samples.
        pub sheets: usize = "sheets",
        /// Mean number of samples of the pixels of large sheets.
        pub samples_per_pixel: f64 = "samples per pixel",
        /// Cells that carry attributes.
        pub attribute_cells: usize = "cells of attributes",
        /// Patches of the model.
        pub patches: usize = "patches",
        /// Cells with points beside the patches.
        pub extra_points: u64 = "extra points",
        /// Parts of the model that it gives once more at other places.
        pub instances: u64 = "instances",
        /// Patches of these.
        pub instance_patches: u64 = "patches of instances",
    }
}

/// Learns patches on a lattice from a cloud.
///
/// The result depends on cloud and options alone, not on the number of threads.
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for options outside their domain and a resolution or bound too small for
/// the scene, [`crate::Error::EmptyCloud`], [`crate::Error::Cancelled`] when the caller asks to
/// stop.
pub fn learn(
    cloud: &PointCloud,
    options: &PatchesOptions,
    progress: &dyn Progress,
) -> Result<PatchModel> {
    options.check()?;
    let mut stages = Stages::new(STAGES, progress);
    // Options that are not given follow from the data.
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(cloud, quality, Leave::Strays, keep, &mut stages)?;
    let resolution = pixel(&mut start, options);
    let tolerance = tolerance(&start, options, reach(&start.cloud)?, resolution);
    let depth_step = depth_step(&mut start, options.depth_step, resolution);
    let (cloud, survey): (&PointCloud, _) = (&start.cloud, &start.survey);
    check_size(reach(cloud)?, resolution)?;
    PatchesOptions::check_found("resolution", resolution)?;
    // 1. Axes of the scene.
    let lattice = stages.run("finding axes", |_| {
        Ok(lattice_of(cloud, resolution, depth_step, survey.layer_gap, options))
    })?;
    let ground = Ground {
        lattice,
        survey,
        tolerance,
        density: None,
        attributes: &[],
        tile: None,
        weights: None,
        n_measured: None,
        kept: (&[], 0),
    };
    let (model, mut report) = on_lattice(&ground, cloud, options, &mut stages)?;
    report.stages = stages.finish();
    start.report(tolerance, &mut report);
    Ok(model.with_report(report))
}

/// What the steps on the lattice start from.
pub(super) struct Ground<'a> {
    pub lattice: Lattice,
    pub survey: &'a Survey,
    /// How far from a point its surface may be decoded, metres.
    pub tolerance: f64,
    /// Samples of a pixel where it is known before; else those of this cloud.
    pub density: Option<f64>,
    /// What attributes beside colour are stored as where that is known before.
    pub attributes: &'a [AttributeHeader],
    /// The part of the scene that is described; all of it without.
    pub tile: Option<Tile>,
    /// Weights of the points, beside what their ranges give; all are 1 without.
    pub weights: Option<&'a [f32]>,
    /// How many measured points each of the points stands for; all are 1 without.
    pub n_measured: Option<&'a [f32]>,
    /// Sheets that stay as they were, and the number of the first points, which are of them.
    pub kept: (&'a [SheetTree], usize),
}

impl Ground<'_> {
    /// How much the points count.
    fn weights(&self, sensor: Sensor) -> Weights<'_> {
        Weights { sensor, of_points: self.weights, n_measured: self.n_measured }
    }

    /// The points that the model has to be near to: those of the tile.
    fn positions<'a>(&self, cloud: &'a PointCloud) -> Cow<'a, [[f32; 3]]> {
        match self.tile {
            Some(tile) => Cow::Owned(tile.own(cloud, &self.lattice)),
            None => Cow::Borrowed(cloud.positions()),
        }
    }

    /// How many of them, and how near; `near` are the patches just beyond the tile.
    fn wanted<'a>(
        &self,
        positions: &'a [[f32; 3]],
        near: &'a [Leaf],
        options: &PatchesOptions,
    ) -> Wanted<'a> {
        let (lattice, max_error) = (self.lattice, options.max_error);
        let completeness = self.completeness(options);
        Wanted { lattice, positions, near, max_error, completeness }
    }

    fn completeness(&self, options: &PatchesOptions) -> Completeness {
        Completeness {
            share: options.completeness,
            tolerance: self.tolerance,
            layer_gap: self.survey.layer_gap,
            forward: options.max_error_forward,
        }
    }

    /// How near the decoded cloud is to be, metres, to at least which share of the points; none where nothing is asked for.
    fn asked(&self, options: &PatchesOptions) -> Option<(f64, f64)> {
        let of_bound = options.max_error.map(|bound| (bound, 1.0));
        let completeness = || Some((self.completeness(options).bound()?, options.completeness));
        of_bound.or_else(completeness)
    }

    /// True when patches alone, with those `near` the tile, are as near to the positions as options ask for.
    fn is_near_enough(
        &self,
        chosen: &RoundsOutcome,
        positions: &[[f32; 3]],
        options: &PatchesOptions,
        progress: &dyn Progress,
    ) -> Result<bool> {
        let Some((bound, share)) = self.asked(options) else { return Ok(true) };
        let patches = chosen.geometry.leaves.iter().chain(&chosen.near).map(|leaf| (leaf, None));
        is_reached(self.lattice, patches, positions, bound, share, progress)
    }

    /// The price of points beside the patches, where there will be some. With a bound forward there is none: patches then
    /// lose what is further from the input, so that points stand beside them whatever is chosen. Nor is there where surfaces lie
    /// close behind one another: patches thick enough for all points of one would have colours of the other.
    fn point_price(&self, options: &PatchesOptions) -> Option<PointPrice> {
        if options.max_error_forward.is_some() || self.survey.layer_gap.is_some() {
            return None;
        }
        let (near, _) = self.asked(options)?;
        let of = match options.max_error {
            Some(_) => PointPrice::of_bound,
            None => PointPrice::of_tolerance,
        };
        Some(of(near, self.lattice.pixel_size))
    }
}

/// Steps 2 to 7: the model of a cloud on a lattice that is known, with its report but for the survey and the times.
pub(super) fn on_lattice(
    ground: &Ground<'_>,
    cloud: &PointCloud,
    options: &PatchesOptions,
    stages: &mut Stages<'_>,
) -> Result<(PatchModel, PatchesReport)> {
    let &Ground { lattice, tile, .. } = ground;
    let chosen = ChosenAttributes::of(cloud, options.attributes.as_deref())?;
    // 2. Samples and sides.
    let samples = stages.run("merging points", |progress| {
        let weights = ground.weights(options.sensor);
        let samples = SidedSamples::merge(cloud, &lattice, weights, ground.survey, progress)?;
        Ok(samples.with_kept(ground.kept.1))
    })?;
    // 3. and 4. Sheets; patches of least cost.
    let positions = ground.positions(cloud);
    let ChosenSurface { geometry, near, bytes, n_sheets, density } =
        surface(ground, (cloud, &positions[..]), (&samples, None), options, stages)?;
    // 5. Colour and other attributes.
    let coded = stages.run("adding attributes", |_| {
        let (attributes, figures) =
            attributes(&chosen, &samples, &geometry.leaves, ground, options)?;
        Ok(Described { geometry, attributes, figures, instances: Instances::default() })
    })?;
    // 6. What recurs.
    let n_samples = samples.all.len();
    let fold = stages.run("finding what recurs", |progress| {
        if tile.is_some() || !options.recurrence {
            return Ok(None);
        }
        let learned = Learned {
            lattice,
            coded: &coded,
            samples: &samples,
            chosen: &chosen,
            n_points: cloud.len(),
            geometry_bytes: bytes.last().copied().unwrap_or_default(),
            density,
            tolerance: options.max_error.unwrap_or(TOLERANCE_SHARE * ground.tolerance),
        };
        recurring(&learned, cloud, options, progress)
    })?;
    let recurring = match &fold {
        Some(fold) => Some(refolded(
            &Ground { density: Some(density), ..*ground },
            fold,
            (cloud, &coded.geometry.leaves),
            (samples, &chosen),
            options,
            stages,
        )?),
        None => None,
    };
    // 7. Points beside the patches.
    let wanted = ground.wanted(&positions, &near, options);
    let Whole { model, attribute_cells, attributes } =
        stages.run("checking the bound", |progress| wanted.smaller(coded, recurring, progress))?;

    let figures = PatchesFigures {
        points: positions.len(),
        samples: n_samples,
        sheets: n_sheets,
        samples_per_pixel: density,
        attribute_cells,
        patches: model.len(),
        extra_points: model.header().n_extra,
        instances: model.header().n_instances,
        instance_patches: model.instances().n_patches(),
    };
    let report = PatchesReport {
        figures: Some(figures),
        attributes,
        not_kept: lost(cloud, &chosen.names()),
        ..choice_report(&model, bytes)
    };
    Ok((model, report))
}

/// What is described of a scene whose copies are moved onto the first; `before` are the patches that it had without.
fn refolded(
    ground: &Ground<'_>,
    fold: &Fold,
    (cloud, before): (&PointCloud, &[Leaf]),
    (samples, chosen): (SidedSamples<'_>, &ChosenAttributes<'_>),
    options: &PatchesOptions,
    stages: &mut Stages<'_>,
) -> Result<(Described, Vec<u16>)> {
    let &Ground { lattice, .. } = ground;
    let samples = fold.moved(samples);
    let of_one = fold.as_of_one(&samples);
    let positions = fold.positions_of_one(&samples, cloud);
    let ChosenSurface { geometry, density, .. } =
        surface(ground, (cloud, &positions), (&of_one, Some(fold)), options, stages)?;
    drop((of_one, positions));
    let support = support(lattice, &geometry.leaves, cloud, options)?;
    let allowed = |leaf: &Leaf, motion: &Motion| {
        support.as_ref().is_none_or(|support| support.holds(leaf, motion))
    };
    let prices = [density, options.rate * density];
    let instances = fold.instances((&samples, &geometry), before, prices, allowed)?;
    let (attributes, figures) = attributes(chosen, &samples, &geometry.leaves, ground, options)?;
    let of_points = fold.of_points(&instances);
    Ok((Described { geometry, attributes, figures, instances }, of_points))
}

/// What steps 3 and 4 give.
struct ChosenSurface {
    geometry: Geometry,
    /// Patches just beyond the tile.
    near: Vec<Leaf>,
    /// Of the geometry, after each round of the choice.
    bytes: Vec<f64>,
    n_sheets: usize,
    /// Samples of a pixel.
    density: f64,
}

/// Steps 3 and 4: the patches of least cost, without attributes, of a cloud and the positions that these have to be near to.
fn surface(
    ground: &Ground<'_>,
    (cloud, positions): (&PointCloud, &[[f32; 3]]),
    (samples, fold): (&SidedSamples<'_>, Option<&Fold>),
    options: &PatchesOptions,
    stages: &mut Stages<'_>,
) -> Result<ChosenSurface> {
    let &Ground { lattice, survey, tile, .. } = ground;
    // 3. Sheets.
    let mut sheets = stages.run("growing sheets", |_| sheets_of(samples, &lattice, survey))?;
    if let Some(fold) = fold {
        parallel::for_each_mut(&mut sheets, |_, sheet| sheet.copies = fold.copies_of(sheet));
    }
    let Shares { own: sheets, near } = Shares::of(sheets, tile, &lattice);
    // 4. Patches of least cost: masks, depths, thickness, levels.
    let density = ground.density.unwrap_or_else(|| samples_per_pixel(&sheets));
    let n_sheets = sheets.len();
    let chosen = stages.run("choosing patches", |progress| {
        let (sheets, near, bases) = (&sheets[..], &near[..], &Basis::of_levels(options.levels)[..]);
        let kept = ground.kept.0;
        let rounds = Rounds { lattice, sheets, kept, near, bases, density, options, progress };
        rounds.choose(ground.point_price(options), |chosen| {
            ground.is_near_enough(chosen, positions, options, progress)
        })
    })?;
    let RoundsOutcome { geometry, near, bytes, .. } = chosen;
    // Memory that the next stage needs.
    drop(sheets);
    let geometry =
        stages.run("keeping to the input", |progress| match options.max_error_forward {
            Some(bound) => with_support(geometry, lattice, cloud, bound, progress),
            None => Ok(geometry),
        })?;
    Ok(ChosenSurface { geometry, near, bytes, n_sheets, density })
}

/// Samples of all sides as sheets.
pub(super) fn sheets_of(
    samples: &SidedSamples<'_>,
    lattice: &Lattice,
    survey: &Survey,
) -> Result<Vec<Sheet>> {
    let resolution = lattice.pixel_size;
    let reach = Reach::of(survey.layer_gap, resolution);
    sheets(samples, resolution as f32, lattice.tile_pixels(), reach)
}

/// Figures of the choice of patches for the report; `bytes` are those of the geometry after each round.
fn choice_report(model: &PatchModel, bytes: Vec<f64>) -> PatchesReport {
    PatchesReport {
        levels: of_levels(model),
        iterations: bytes.len(),
        objectives: vec![("bytes of geometry".into(), bytes)],
        stop_reason: "every sheet has the hierarchy of least cost",
        ..PatchesReport::default()
    }
}

/// The lattice along the axes of the scene.
pub(super) fn lattice_of(
    cloud: &PointCloud,
    pixel_size: f64,
    depth_step: u32,
    layer_gap: Option<f64>,
    options: &PatchesOptions,
) -> Lattice {
    let cell = (AXES_CELL * pixel_size).max(AXES_CELL_IN_GAPS * layer_gap.unwrap_or(0.0));
    let orientation = Orientation::of(cloud, cell as f32);
    Lattice { origin: cloud.origin(), orientation, pixel_size, levels: options.levels, depth_step }
}

/// Side of a pixel of the finest level, metres.
pub(super) fn pixel(start: &mut Start<'_>, options: &PatchesOptions) -> f64 {
    let in_rows = start.survey.line_spacing.is_some() || start.survey.rounding > 0.0;
    let spacings = if in_rows { SPACINGS_PER_PIXEL_IN_ROWS } else { SPACINGS_PER_PIXEL };
    let bound = options.max_error.map(|bound| match options.max_error_forward {
        Some(forward) => OfBound { bound: bound.min(forward), share: BOTH_BOUNDS_PER_PIXEL },
        None => OfBound { bound, share: BOUNDS_PER_PIXEL },
    });
    start.pixel(options.resolution, spacings, bound)
}

/// How far a decoded cloud may be from a point and still show it, metres: as far as the data have it, or half a pixel where all
/// points are in one place; and no less than points beside the patches resolve in a scene that reaches this far.
pub(super) fn tolerance(
    start: &Start<'_>,
    options: &PatchesOptions,
    reach: [f64; 3],
    resolution: f64,
) -> f64 {
    let of_data = start.tolerance(options.resolution);
    let of_data = if of_data > 0.0 { of_data } else { 0.5 * resolution };
    let extent = reach.into_iter().fold(0.0, f64::max);
    of_data.max(least_bound(extent) / TOLERANCE_SHARE)
}

/// Rounding of depths as the file has it: the one that was given, or the usual one, unless surfaces that lie close behind one
/// another ask for a finer one.
pub(super) fn depth_step(start: &mut Start<'_>, given: Option<f64>, resolution: f64) -> u32 {
    let steps = |pixels: f64| DEPTH_STEPS * pixels;
    let of_gap = start.survey.layer_gap.map(|gap| steps(DEPTH_STEP_IN_GAPS * gap / resolution));
    match (given, of_gap) {
        (Some(pixels), _) => steps(pixels).round() as u32,
        (None, Some(of_gap)) if of_gap < steps(DEPTH_STEP) => {
            let chosen = of_gap.floor().max(1.0);
            start.note("depth_step", chosen / DEPTH_STEPS, GAP_REASON.to_owned());
            chosen as u32
        }
        (None, _) => steps(DEPTH_STEP) as u32,
    }
}

/// Refuses scenes that are too large for the cells of samples: `reach` is the largest distance from the origin along each axis.
pub(super) fn check_size(reach: [f64; 3], resolution: f64) -> Result<()> {
    // Turned to its axes, the scene may reach as far along one as its corner is from the origin.
    let extent = reach.map(|c| c * c).iter().sum::<f64>().sqrt();
    check_extent(extent, resolution, SAMPLE_SIZE * f64::from(LIMIT - 2))
}

/// Mean number of samples of the pixels of large sheets; 1 without any.
pub(super) fn samples_per_pixel(sheets: &[Sheet]) -> f64 {
    let large = || sheets.iter().filter(|s| !s.small).flat_map(|s| &s.runs);
    if large().next().is_none() {
        return 1.0;
    }
    large().map(|r| f64::from(r.n)).sum::<f64>() / large().count() as f64
}

/// The attributes of least cost on the cells around the patches, with what each takes and misses.
fn attributes(
    chosen: &ChosenAttributes<'_>,
    samples: &SidedSamples<'_>,
    leaves: &[Leaf],
    ground: &Ground<'_>,
    options: &PatchesOptions,
) -> Result<(Attributes, Vec<AttributeFigures>)> {
    if chosen.is_empty() {
        return Ok(Default::default());
    }
    let lattice = &ground.lattice;
    // A learned model has no more cells than its samples call for; the limit is for files.
    let cells = attribute_cells(lattice, leaves, u64::MAX).unwrap_or_default();
    // Where surfaces lie close behind one another, a point has the attributes of the cell that it lies in.
    let unblended = ground.survey.layer_gap.is_some();
    // Elsewhere surfaces of two sides meet, and all cells may share what is known.
    let sides = unblended.then(|| sides_of_cells(lattice, leaves, &cells));
    let targets = Targets::new(samples, &cells, sides, lattice.pixel_size as f32);
    let border = ground.tile.and_then(Tile::border);
    let border = border.map(|border| Box::new(BorderBlocks::new(border, &cells)));
    let coding = match ground.tile.is_none_or(|tile| tile.estimated) {
        true => FieldCoding::Estimated,
        false => FieldCoding::Whole,
    };
    let of = FieldCells { keys: &cells, border: border.as_deref(), coding };
    let Fields { color, others, figures } =
        chosen.fields(of, &targets, options, ground.attributes)?;
    Ok((Attributes { cells, color, others, unblended, coding, border }, figures))
}

/// Figures of each level for the report.
fn of_levels(model: &PatchModel) -> Vec<Named> {
    let lattice = model.lattice();
    let level = |(l, of): (u32, LevelSize)| {
        let pixel = lattice.pixel_of(l);
        let area = of.set_pixels as f64 * pixel * pixel;
        vec![("pixel size", pixel), ("patches", of.patches as f64), ("area", area)]
    };
    (0..lattice.levels).zip(model.level_sizes()).map(level).collect()
}
