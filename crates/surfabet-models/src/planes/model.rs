//! The model in the integers that a file stores.

use rayon::prelude::*;
use surfabet_geom::{PointCloud, Progress, octahedral};

use super::learn::{Fit, NONE, PlanesReport, e_step};
use super::options::MAX_PATCHES;
use super::patch::{Frame, Patch};
use super::points::Points;
use super::tiles::{MAX_TILES, Tiles};
use crate::color::{self, rounded};
use crate::error::{Error, Result};
use crate::report::Report;
use crate::size_code::{size_code, size_of_code};
use crate::vector;

/// Largest coordinate in position steps, so that positions are exact in single precision.
pub const MAX_COORDINATE: i32 = 1 << 23;

/// Largest power of two of a position step, and the smallest's negative.
pub const MAX_EXPONENT: i32 = 60;

/// Bits of each of the two numbers of a normal: within 0.0025 degrees.
pub const NORMAL_BITS: u32 = 16;

/// Directions of the first axis in a full turn.
pub const DIRECTIONS: u32 = 4096;

/// Parts of a tile's side in which the last column and row are measured.
pub const PARTS: u8 = 8;

/// Largest power of two that a tile's side is of the grid size.
pub const MAX_DOUBLINGS: u8 = 40;

/// Most tiles of a patch, supported or not: those that learning allows, and what rounding adds.
pub const MAX_PATCH_TILES: u64 = 2 * MAX_TILES as u64;

/// Most tiles of all patches together, so that a small file cannot ask for much memory.
pub const MAX_MODEL_TILES: u64 = 1 << 25;

/// Standard deviations are stored in this share of a position step.
const DEVIATION_UNIT: f64 = 0.125;

/// Position steps per grid size, at least: rounding is a tenth of the noise.
const STEPS_PER_GRID_SIZE: f64 = 32.0;

/// A patch as it is stored.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct StoredPatch {
    /// Middle of the rectangle in position steps from the model's origin.
    pub position: [i32; 3],
    /// Octahedral code of the normal, [`NORMAL_BITS`] each.
    pub normal: [i16; 2],
    /// Direction of the first axis in the plane, in [`DIRECTIONS`] of a turn.
    pub direction: u16,
    /// The side of a tile is the grid size times two to this power.
    pub doublings: u8,
    /// Number of tiles along both axes.
    pub shape: [u32; 2],
    /// Extent of the last column and row in [`PARTS`] of a tile's side, 1 to [`PARTS`].
    pub last: [u8; 2],
    /// Code of the standard deviation of the support: zero for 0, else `2^((code - 1) / 4)` eighths of a position step.
    pub deviation: u8,
    /// Code of the number of points that support it: zero for 0, else `2^((code - 1) / 4)`.
    pub count: u8,
    /// For each tile, along the first axis first, whether it is supported.
    pub supported: Vec<bool>,
    /// Luma and two chromas of each supported tile, in steps; empty without colours.
    pub colors: Vec<[i16; 3]>,
}

/// What a model of planes says of itself before its streams.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanesHeader {
    /// Points of the cloud that the model was learned from.
    pub n_points: u64,
    /// How many of them support no patch.
    pub n_outliers: u64,
    /// World position of the model's zero, metres.
    pub origin: [f64; 3],
    /// Position step as a power of two, metres.
    pub exponent: i32,
    /// Grid size (G), metres.
    pub grid_size: f64,
    /// Rounding of colours, grey levels, where there are colours.
    pub color_step: Option<u32>,
    /// Number of patches.
    pub n_patches: u64,
}

impl PlanesHeader {
    /// Checks that all numbers are in their domains.
    pub(super) fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::Inconsistent(what));
        if self.origin.iter().any(|c| !c.is_finite()) {
            return fail(format!("origin {:?} is not finite", self.origin));
        }
        if self.exponent.abs() > MAX_EXPONENT {
            return fail(format!("a position step of 2^{} m", self.exponent));
        }
        let step = f64::from(self.exponent).exp2();
        let largest = step * f64::from(MAX_COORDINATE);
        if !(self.grid_size >= step && self.grid_size <= largest) {
            return fail(format!("a grid size of {} m, not {step} to {largest}", self.grid_size));
        }
        if self.color_step.is_some_and(|step| !(1..=64).contains(&step)) {
            return fail(format!("a colour step of {:?}, not 1 to 64", self.color_step));
        }
        if self.n_outliers > self.n_points {
            return fail(format!("{} outliers of {} points", self.n_outliers, self.n_points));
        }
        if self.n_patches > MAX_PATCHES as u64 {
            return fail(format!("{} patches, more than {MAX_PATCHES}", self.n_patches));
        }
        Ok(())
    }
}

/// A cloud as planar patches with tiles; immutable. The patches that most points support come first.
#[derive(Debug, Clone)]
pub struct PlaneModel {
    header: PlanesHeader,
    stored: Vec<StoredPatch>,
    patches: Vec<Patch>,
    labels: Option<Vec<u32>>,
    report: PlanesReport,
}

/// Two models are equal when their files are.
impl PartialEq for PlaneModel {
    fn eq(&self, other: &Self) -> bool {
        self.header == other.header && self.stored == other.stored
    }
}

impl PlaneModel {
    /// Rounds fitted patches. Colours are those of `cloud`, by the patches that its points support.
    pub(super) fn new(
        cloud: &PointCloud,
        points: &Points,
        fit: &Fit<'_>,
        color_step: u32,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (patches, grid_size) = (fit.patches(), fit.grid_size());
        let exponent = exponent(points, grid_size)?;
        // A point or two have no resolution, and their grid size may be below any step.
        let grid_size = grid_size.max(f64::from(exponent).exp2());
        let mut header = PlanesHeader {
            n_points: cloud.len() as u64,
            n_outliers: 0,
            origin: points.origin,
            exponent,
            grid_size,
            color_step: cloud.colors().is_some().then_some(color_step),
            n_patches: patches.len() as u64,
        };
        let mut order: Vec<&Patch> = patches.iter().collect();
        order.sort_by_key(|p| std::cmp::Reverse(p.n_supporting()));
        let mut stored: Vec<StoredPatch> =
            order.par_iter().map(|patch| store(patch, &header)).collect();
        let patches: Vec<Patch> = stored.par_iter().map(|patch| restore(patch, &header)).collect();
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
        let report = Report::default();
        Ok(Self { header, stored, patches, labels: Some(labels), report })
    }

    /// Puts together what a file holds.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] for numbers that no model has.
    pub fn from_stored(header: PlanesHeader, stored: Vec<StoredPatch>) -> Result<Self> {
        header.check()?;
        if stored.len() as u64 != header.n_patches {
            let what = format!("{} patches, not {}", stored.len(), header.n_patches);
            return Err(Error::Inconsistent(what));
        }
        for (i, patch) in stored.iter().enumerate() {
            check(patch, &header).map_err(|e| Error::Inconsistent(format!("patch {i}: {e}")))?;
        }
        if n_tiles(&stored) > MAX_MODEL_TILES {
            let what = format!("{} tiles, more than {MAX_MODEL_TILES}", n_tiles(&stored));
            return Err(Error::Inconsistent(what));
        }
        let patches = stored.par_iter().map(|patch| restore(patch, &header)).collect();
        Ok(Self { header, stored, patches, labels: None, report: Report::default() })
    }

    /// What the file says before its streams.
    pub fn header(&self) -> &PlanesHeader {
        &self.header
    }

    /// The patches as they are stored.
    pub fn stored(&self) -> &[StoredPatch] {
        &self.stored
    }

    /// The patches, about the model's origin.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// True when nothing in the cloud was planar.
    pub fn is_empty(&self) -> bool {
        self.patches.is_empty()
    }

    /// For each input point the patch that it supports, `u32::MAX` for outliers; `None` for a model read from a file.
    pub fn labels(&self) -> Option<&[u32]> {
        self.labels.as_deref()
    }

    /// For each point of any cloud the patch that it supports: the closest within the grid size, `u32::MAX` where
    /// there is none.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`], [`Error::Cancelled`].
    pub fn segment(&self, cloud: &PointCloud, progress: &dyn Progress) -> Result<Vec<u32>> {
        let points = Points::about(cloud, self.header.origin)?;
        labels(&points, &self.patches, self.header.grid_size, progress)
    }

    /// The points of `cloud` that support a patch, moved onto it; the others are left out, as outliers are
    /// (section III). Colours and other attributes stay with their points.
    ///
    /// # Errors
    /// As [`PlaneModel::segment`].
    pub fn project(&self, cloud: &PointCloud, progress: &dyn Progress) -> Result<PointCloud> {
        let labels = self.segment(cloud, progress)?;
        let kept: Vec<usize> = (0..cloud.len()).filter(|&i| labels[i] != NONE).collect();
        let local = cloud.positions_about(self.header.origin);
        let positions = kept
            .iter()
            .map(|&i| {
                let frame = &self.patches[labels[i] as usize].frame;
                let [x, y, _] = frame.local(local[i]);
                frame.at([x, y]).map(|c| c as f32)
            })
            .collect();
        let mut parts = cloud.select(&kept)?.into_parts();
        parts.origin = self.header.origin;
        parts.positions = positions;
        Ok(PointCloud::from_parts(parts)?.0)
    }

    /// Points of the cloud that the model was learned from.
    pub fn n_points(&self) -> u64 {
        self.header.n_points
    }

    /// World position that the model computes about, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.header.origin
    }

    /// The grid size G, metres.
    pub fn grid_size(&self) -> f64 {
        self.header.grid_size
    }

    /// True when the tiles carry colours.
    pub fn has_color(&self) -> bool {
        self.header.color_step.is_some()
    }

    /// Number of points that support a patch, rounded to a quarter of a doubling.
    pub fn count(&self, patch: usize) -> f64 {
        size_of_code(self.stored[patch].count)
    }

    /// Colours of the supported tiles of a patch; empty without colours.
    pub fn colors(&self, patch: usize) -> Vec<[u8; 3]> {
        let step = self.header.color_step.unwrap_or(1);
        self.stored[patch].colors.iter().map(|&c| rounded(color::of_code(c, step))).collect()
    }

    /// How the model was learned; empty for a model read from a file.
    pub fn report(&self) -> &PlanesReport {
        &self.report
    }

    /// The same model with the report of how it was learned.
    pub(super) fn with_report(self, report: PlanesReport) -> Self {
        Self { report, ..self }
    }
}

fn labels(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    // Which patch a point supports does not depend on S.
    let supports = e_step(points, patches, grid_size, grid_size, progress)?.supports;
    Ok(points.place.iter().map(|&i| supports[i as usize]).collect())
}

/// Position step as a power of two.
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

/// The frame that a patch's plane has with direction zero.
fn plain_frame(position: [i32; 3], normal: [i16; 2], step: f64) -> Frame {
    let normal = octahedral::integer_direction(normal.map(i32::from), NORMAL_BITS).map(f64::from);
    let length = vector::length(normal);
    Frame::with_normal(position.map(|c| f64::from(c) * step), normal.map(|c| c / length))
}

/// Tiles of all patches, supported or not.
fn n_tiles(stored: &[StoredPatch]) -> u64 {
    stored.iter().map(|patch| patch.supported.len() as u64).sum()
}

fn store(patch: &Patch, header: &PlanesHeader) -> StoredPatch {
    let step = f64::from(header.exponent).exp2();
    let tiles = &patch.tiles;
    let [low, size] = [tiles.low(), tiles.size()];
    let middle = patch.frame.at(std::array::from_fn(|a| low[a] + 0.5 * size[a]));
    let limit = f64::from(MAX_COORDINATE);
    let position = middle.map(|c| (c / step).round().clamp(-limit, limit) as i32);
    let code = octahedral::encode(patch.frame.normal.map(|c| c as f32), NORMAL_BITS);
    let normal = code.map(|c| c as i16);
    let [x, y, _] = {
        let frame = plain_frame([0; 3], normal, step);
        frame.local(patch.frame.u.map(|c| c as f32))
    };
    let turn = y.atan2(x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
    let direction = (turn * f64::from(DIRECTIONS)).round() as u32 % DIRECTIONS;
    let shape = tiles.shape();
    let edge = tiles.edge();
    let last = std::array::from_fn(|a| {
        let left = size[a] / edge - (shape[a] as f64 - 1.0);
        (left * f64::from(PARTS)).ceil().clamp(1.0, f64::from(PARTS)) as u8
    });
    StoredPatch {
        position,
        normal,
        direction: direction as u16,
        doublings: (edge / header.grid_size).log2().round() as u8,
        shape: shape.map(|n| n as u32),
        last,
        deviation: size_code(patch.standard_deviation / (DEVIATION_UNIT * step)),
        count: size_code(patch.n_supporting() as f64),
        supported: tiles.supported().to_vec(),
        colors: Vec::new(),
    }
}

fn restore(stored: &StoredPatch, header: &PlanesHeader) -> Patch {
    let step = f64::from(header.exponent).exp2();
    let turn = std::f64::consts::TAU * f64::from(stored.direction) / f64::from(DIRECTIONS);
    let frame = plain_frame(stored.position, stored.normal, step).turned([turn.cos(), turn.sin()]);
    let edge = header.grid_size * f64::from(stored.doublings).exp2();
    let size: [f64; 2] = std::array::from_fn(|a| {
        let last = f64::from(stored.last[a]) / f64::from(PARTS);
        edge * (f64::from(stored.shape[a]) - 1.0 + last)
    });
    let shape = stored.shape.map(|n| n as usize);
    let mut tiles = Tiles::of_shape(size.map(|s| -0.5 * s), size, edge, shape);
    tiles.support(stored.supported.clone());
    let mut patch = Patch::bare(frame, tiles);
    patch.standard_deviation = DEVIATION_UNIT * step * size_of_code(stored.deviation);
    patch
}

/// What is wrong with a stored patch.
fn check(patch: &StoredPatch, header: &PlanesHeader) -> Result<(), String> {
    if patch.position.iter().any(|c| c.abs() > MAX_COORDINATE) {
        return Err(format!("a position of {:?} steps", patch.position));
    }
    if u32::from(patch.direction) >= DIRECTIONS {
        return Err(format!("direction {} of {DIRECTIONS}", patch.direction));
    }
    if patch.doublings > MAX_DOUBLINGS {
        return Err(format!("tiles of 2^{} grid sizes", patch.doublings));
    }
    let [nx, ny] = patch.shape.map(u64::from);
    if patch.shape.contains(&0) || nx * ny > MAX_PATCH_TILES {
        return Err(format!("{:?} tiles", patch.shape));
    }
    if patch.last.iter().any(|&l| !(1..=PARTS).contains(&l)) {
        return Err(format!("a last tile of {:?} eighths", patch.last));
    }
    if patch.supported.len() as u64 != nx * ny {
        return Err(format!("{} tiles in a mask of {:?}", patch.supported.len(), patch.shape));
    }
    let supported = patch.supported.iter().filter(|s| **s).count();
    if supported == 0 {
        return Err("no supported tile".into());
    }
    let colors = if header.color_step.is_some() { supported } else { 0 };
    if patch.colors.len() != colors {
        return Err(format!("{} colours for {colors} tiles", patch.colors.len()));
    }
    Ok(())
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
