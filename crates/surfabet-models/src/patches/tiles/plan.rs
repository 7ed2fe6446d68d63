//! What all tiles of a scene share.

use crate::patches::constants::{BESIDE_BORDER, LEAST_TILE_SQUARES, TILE_SIDE};
use surfabet_geom::{Dtype, PointCloud, Progress, Survey};

use super::details::coarsest_pixel;
use super::{Cubes, MARGIN_PIXELS, MARGIN_SQUARES, MAX_DETAILS, Views, about};
use crate::error::{Error, Result, positive};
use crate::options::Options;
use crate::patches::attributes::chosen::ChosenAttributes;
use crate::patches::attributes::{AttributeContent, AttributeHeader, INTENSITIES, check};
use crate::patches::learn::{
    check_size, depth_step, lattice_of, pixel, samples_per_pixel, sheets_of, tolerance,
};
use crate::patches::model::Lattice;
use crate::patches::options::PatchesOptions;
use crate::patches::samples::{Sample, SidedSamples, Weights};
use crate::scalar::ScalarScale;
use crate::stages::Stages;
use crate::start::{ChosenOption, Leave, Start};

/// Most finest pixels along the side of a tile.
const MOST_PIXELS: i32 = 1 << 20;

/// The stages of planning, with their shares of the progress.
const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 0.4),
    ("finding axes", 0.2),
    ("merging points", 0.3),
    ("growing sheets", 0.1),
];

/// What is known of an attribute over all points of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeRange {
    /// Its name; [`INTENSITIES`] for these.
    pub name: String,
    /// Type of its values.
    pub dtype: Dtype,
    /// Its different values, growing, where it has integers of at most 32 different ones.
    pub labels: Option<Vec<i64>>,
    /// Least and largest value.
    pub range: [f64; 2],
    /// Standard deviation.
    pub deviation: f64,
}

impl AttributeRange {
    /// The header of the attribute in the file, with steps of `share` of its standard deviation.
    fn header(&self, share: f64) -> Result<AttributeHeader> {
        let content = match &self.labels {
            Some(labels) if self.name != INTENSITIES => AttributeContent::Labels(labels.clone()),
            _ => {
                let [low, high] = self.range;
                let scale = ScalarScale::from_range(&self.name, low, high, self.deviation, share)?;
                AttributeContent::Scalar(scale)
            }
        };
        Ok(AttributeHeader { name: self.name.clone(), dtype: self.dtype, content })
    }
}

/// What all tiles of a scene share.
#[derive(Debug, Clone, PartialEq)]
pub struct TilePlan {
    /// The lattice of all patches.
    pub lattice: Lattice,
    /// Its cubes.
    pub cubes: Cubes,
    /// What was measured of the sample. The points that are outliers there are not named.
    pub survey: Survey,
    /// How far from a point its surface may be decoded and still show it, metres.
    pub tolerance: f64,
    /// Samples of a pixel, mean.
    pub density: f64,
    /// How the sides of surfaces are known.
    pub views: Views,
    /// Attributes beside colour, as they are stored.
    pub attributes: Vec<AttributeHeader>,
    /// Whether colours and scalars are corrected at the borders of tiles; those of maps of older versions are not.
    pub corrected: bool,
    /// Whether colours and scalars are coded with estimates; those of maps of older versions are not.
    pub estimated: bool,
    /// Number of levels of detail.
    pub details: u32,
    /// Options that were not given, and what the sample made of them.
    pub chosen: Vec<ChosenOption>,
}

impl TilePlan {
    /// Finest pixels about a tile that its surfaces depend on, at all levels of detail.
    pub(super) fn margin_pixels(&self) -> i32 {
        (MARGIN_SQUARES * self.lattice.tile_pixels() + MARGIN_PIXELS) * coarsest_pixel(self.details)
    }

    /// Finest pixels of which the side of a tile and its corners are multiples: squares of all levels of detail are whole.
    fn square(&self) -> i32 {
        self.lattice.tile_pixels() * coarsest_pixel(self.details)
    }

    /// How far from a tile points still matter to it, metres.
    pub fn margin(&self) -> f64 {
        f64::from(self.margin_pixels()) * self.lattice.pixel_size
    }

    /// Side of a tile, metres.
    pub fn side(&self) -> f64 {
        f64::from(self.cubes.side) * self.lattice.pixel_size
    }

    /// The plan with tiles of about `side` metres, whole squares of the coarsest level.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a side below four squares, or one of the coarsest level of detail, or above a million pixels.
    pub fn with_side(mut self, side: f64) -> Result<Self> {
        let square = self.square();
        self.cubes.side = side_of(&self.lattice, square, Some(side))?;
        self.cubes.offset =
            self.cubes.offset.map(|c| c.rem_euclid(self.cubes.side).div_euclid(square) * square);
        Ok(self)
    }

    /// Checks that a scene may have it.
    ///
    /// # Errors
    /// [`Error::Inconsistent`].
    pub fn check(&self) -> Result<()> {
        self.lattice.check()?;
        check(&self.attributes).map_err(Error::Inconsistent)?;
        if !(1..=MAX_DETAILS).contains(&self.details) {
            let what = format!("{} levels of detail, not 1 to {MAX_DETAILS}", self.details);
            return Err(Error::Inconsistent(what));
        }
        let square = self.square();
        let whole = |c: i32| c % square == 0;
        let Cubes { side, offset } = self.cubes;
        let is_side = (square..=MOST_PIXELS).contains(&side) && whole(side);
        if !is_side || !offset.iter().all(|&c| whole(c) && (0..side).contains(&c)) {
            let what = format!("tiles of {side} pixels from {offset:?} with squares of {square}");
            return Err(Error::Inconsistent(what));
        }
        positive("density", self.density, "a positive number")?;
        let tolerance = self.tolerance.is_finite() && self.tolerance >= 0.0;
        tolerance
            .then_some(())
            .ok_or_else(|| Error::Inconsistent(format!("a tolerance of {} m", self.tolerance)))
    }
}

/// Side of a tile in finest pixels: the nearest multiple of `square` to `side` metres.
fn side_of(lattice: &Lattice, square: i32, side: Option<f64>) -> Result<i32> {
    let Some(side) = side else { return Ok(((TILE_SIDE + square / 2) / square).max(1) * square) };
    let least_pixels = square.max(LEAST_TILE_SQUARES * lattice.tile_pixels());
    let least = f64::from(least_pixels) * lattice.pixel_size;
    let most = f64::from(MOST_PIXELS - square) * lattice.pixel_size;
    if !(least * (1.0 - 1e-9)..=most).contains(&side) {
        let requirement = format!(
            "from {} to {} metres with pixels of {} m",
            // In whole millimetres within the limits, so that what is named is allowed.
            (1e3 * least).ceil() / 1e3,
            (1e3 * most).floor() / 1e3,
            lattice.pixel_size
        );
        return Err(Error::invalid("tile", side, requirement));
    }
    let squares = (side / (f64::from(square) * lattice.pixel_size)).round();
    Ok((squares as i32 * square).max(least_pixels))
}

/// What all tiles of a scene share, from a sample of it in which neighbours are as near as in the scene: some whole blocks,
/// or the scene itself. `bounds` is the box of the scene, and `ranges` what is known of its attributes beside colour; those
/// that the options name, or the intensities, are kept. `side` is that of a tile in metres, `details` the number of levels of
/// detail.
///
/// # Errors
/// As [`super::super::learn`].
pub fn plan(
    sample: &PointCloud,
    bounds: [[f64; 3]; 2],
    ranges: &[AttributeRange],
    side: Option<f64>,
    details: u32,
    options: &PatchesOptions,
    progress: &dyn Progress,
) -> Result<TilePlan> {
    options.check()?;
    if !(1..=MAX_DETAILS).contains(&details) {
        return Err(Error::invalid("details", details, format!("from 1 to {MAX_DETAILS}")));
    }
    let [low, high] = bounds;
    let origin: [f64; 3] = std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round());
    let mut stages = Stages::new(STAGES, progress);
    let sample = about(sample, origin)?;
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(&sample, quality, Leave::Strays, keep, &mut stages)?;
    start.survey.bounds = Some((low, high));
    let resolution = pixel(&mut start, options);
    let reach = std::array::from_fn(|a| 0.5 * (high[a] - low[a]) + 1.0);
    let tolerance = tolerance(&start, options, reach, resolution);
    let depth_step = depth_step(&mut start, options.depth_step, resolution);
    check_size(reach, resolution)?;
    PatchesOptions::check_found("resolution", resolution)?;
    let (cloud, survey): (&PointCloud, _) = (&start.cloud, &start.survey);
    let lattice = stages.run("finding axes", |_| {
        Ok(lattice_of(cloud, resolution, depth_step, survey.layer_gap, options))
    })?;
    let samples = stages.run("merging points", |progress| {
        SidedSamples::merge(cloud, &lattice, Weights::of(options.sensor), survey, progress)
    })?;
    let sheets = stages.run("growing sheets", |_| sheets_of(&samples, &lattice, survey))?;
    let kept = ChosenAttributes::of(cloud, options.attributes.as_deref())?.names();
    let ranges = ranges.iter().filter(|range| kept.contains(&range.name.as_str()));
    let attributes = ranges.map(|range| range.header(options.attribute_step));
    let square = lattice.tile_pixels() * coarsest_pixel(details);
    let side = side_of(&lattice, square, side)?;
    let offset = offset(&samples.all, &lattice, square, side);
    Ok(TilePlan {
        lattice,
        cubes: Cubes { side, offset },
        survey: Survey { outliers: Vec::new(), strays: Vec::new(), ..survey.clone() },
        tolerance,
        density: samples_per_pixel(&sheets),
        views: Views::of(cloud, survey),
        attributes: attributes.collect::<Result<_>>()?,
        corrected: true,
        estimated: true,
        details,
        chosen: start.into_chosen(),
    })
}

/// The corner of the cubes for which fewest samples lie beside a border: a floor or a wall along a border would be in two
/// tiles.
fn offset(samples: &[Sample], lattice: &Lattice, square: i32, side: i32) -> [i32; 3] {
    let pixel = lattice.pixel_size as f32;
    let mut counts = vec![[0_u64; 3]; side as usize];
    for sample in samples {
        for (a, c) in sample.position.iter().enumerate() {
            counts[((c / pixel).floor() as i32).rem_euclid(side) as usize][a] += 1;
        }
    }
    std::array::from_fn(|a| {
        let beside = |border: i32| -> u64 {
            let near = border - BESIDE_BORDER..border + BESIDE_BORDER;
            near.map(|at| counts[at.rem_euclid(side) as usize][a]).sum()
        };
        let borders = (0..side / square).map(|i| i * square);
        borders.min_by_key(|&border| beside(border)).unwrap_or(0)
    })
}
