//! The model: patches as integers and as numbers, and points of any cloud on them.

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress, has_facings};

use super::coding::{MAX_COORDINATE, StoredPatch};
use super::fit::{NONE, supports, supports_everywhere};
use super::learn::PlanesReport;
use super::options::MAX_PATCHES;
use super::patch::Patch;
use super::points::Points;
use crate::color::{self, rounded};
use crate::error::{Error, Result};
use crate::report::Report;
use crate::scalar::ScalarScale;
use crate::size_code::size_of_code;

/// Largest power of two of a position step, and the smallest's negative.
pub const MAX_EXPONENT: i32 = 60;

/// Most tiles of all patches together, so that a small file cannot ask for much memory.
pub const MAX_MODEL_TILES: u64 = 1 << 25;

/// What the file of a model holds before its streams.
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
    /// How intensities are stored, where there are any.
    pub intensity: Option<ScalarScale>,
    /// Number of patches.
    pub n_patches: u64,
}

impl PlanesHeader {
    /// Position step, metres.
    pub(super) fn position_step(&self) -> f64 {
        f64::from(self.exponent).exp2()
    }

    /// Checks that all numbers are in their domains.
    ///
    /// # Errors
    /// [`Error::Inconsistent`].
    pub(super) fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::Inconsistent(what));
        if self.origin.iter().any(|c| !c.is_finite()) {
            return fail(format!("origin {:?} is not finite", self.origin));
        }
        if !(-MAX_EXPONENT..=MAX_EXPONENT).contains(&self.exponent) {
            return fail(format!("a position step of 2^{} m", self.exponent));
        }
        let step = self.position_step();
        let largest = step * f64::from(MAX_COORDINATE);
        if !(self.grid_size >= step && self.grid_size <= largest) {
            return fail(format!("a grid size of {} m, not {step} to {largest}", self.grid_size));
        }
        if self.color_step.is_some_and(|step| !(1..=64).contains(&step)) {
            return fail(format!("a colour step of {:?}, not 1 to 64", self.color_step));
        }
        if let Some(Err(what)) = self.intensity.map(|scale| scale.check()) {
            return fail(what);
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
    /// True of a model of the printed method that was just learned: points belong to patches by reduced support sets.
    reduced: bool,
    report: PlanesReport,
}

/// Two models are equal when their files are: labels and report do not count.
impl PartialEq for PlaneModel {
    fn eq(&self, other: &Self) -> bool {
        self.header == other.header && self.stored == other.stored
    }
}

impl PlaneModel {
    /// A model that was just learned, of patches that are stored as `stored` and back.
    pub(super) fn learned(
        header: PlanesHeader,
        stored: Vec<StoredPatch>,
        patches: Vec<Patch>,
        labels: Vec<u32>,
        reduced: bool,
    ) -> Self {
        Self { header, stored, patches, labels: Some(labels), reduced, report: Report::default() }
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
            let checked = patch.check(&header);
            checked.map_err(|e| Error::Inconsistent(format!("patch {i}: {e}")))?;
        }
        if n_tiles(&stored) > MAX_MODEL_TILES {
            let what = format!("{} tiles, more than {MAX_MODEL_TILES}", n_tiles(&stored));
            return Err(Error::Inconsistent(what));
        }
        let patches = parallel::map(&stored, |patch| patch.restored(&header));
        Ok(Self {
            header,
            stored,
            patches,
            labels: None,
            reduced: false,
            report: Report::default(),
        })
    }

    /// The model of a cloud of `n_points` of which some, by number and ascending, were left out: they are outliers.
    pub(super) fn with_points_left_out(mut self, left_out: &[u32], n_points: usize) -> Self {
        self.header.n_points = n_points as u64;
        self.header.n_outliers += left_out.len() as u64;
        if let Some(labels) = self.labels.take().map(Vec::into_iter) {
            let (mut labels, mut out) = (labels, left_out.iter().peekable());
            let label = |i: u32| match out.next_if_eq(&&i) {
                Some(_) => NONE,
                None => labels.next().unwrap_or(NONE),
            };
            self.labels = Some((0..n_points as u32).map(label).collect());
        }
        self
    }

    /// What the file holds before its streams.
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
    /// there is none. A model that was just learned by the printed method gives reduced support sets.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`], [`Error::Cancelled`].
    pub fn segment(&self, cloud: &PointCloud, progress: &dyn Progress) -> Result<Vec<u32>> {
        let points = Points::about(cloud, self.header.origin)?;
        let points = if has_facings(cloud)? { points.facing_as(cloud) } else { points };
        let of = if self.reduced { reduced_labels } else { labels };
        of(&points, &self.patches, self.header.grid_size, progress)
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

    /// World position of a point of the model, metres.
    pub(super) fn world(&self, p: [f64; 3]) -> [f64; 3] {
        let origin = self.origin();
        std::array::from_fn(|a| origin[a] + p[a])
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

    /// True when the tiles carry intensities.
    pub fn has_intensity(&self) -> bool {
        self.header.intensity.is_some()
    }

    /// Mean intensities of the supported tiles of a patch; empty without intensities.
    pub fn intensities(&self, patch: usize) -> Vec<f32> {
        let scale = self.header.intensity.unwrap_or_default();
        let stored = self.stored[patch].intensities.iter();
        stored.map(|&q| scale.value(f64::from(q)) as f32).collect()
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

/// For each input point the patch that it supports, [`NONE`] for outliers.
pub(super) fn labels(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    // Which patch a point supports does not depend on S.
    let supports = supports(points, patches, grid_size, grid_size, None, progress)?;
    Ok(points.place.iter().map(|&i| supports[i as usize]).collect())
}

/// For each input point the patch of whose reduced support set (S^r) it is: the closest of all, if the point lies in the
/// cube of a supported tile; [`NONE`] for outliers.
pub(super) fn reduced_labels(
    points: &Points,
    patches: &[Patch],
    grid_size: f64,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let supports = supports_everywhere(points, patches, grid_size, progress)?;
    let label = |&i: &u32| {
        let closest = supports[i as usize];
        let patch = patches.get(closest as usize)?;
        let [x, y, z] = patch.frame.local(points.positions[i as usize]);
        let tile = patch.tiles.tile_at([x, y]).filter(|&t| patch.tiles.supported()[t]);
        (tile.is_some() && z.abs() <= 0.5 * grid_size).then_some(closest)
    };
    Ok(points.place.iter().map(|i| label(i).unwrap_or(NONE)).collect())
}

/// Tiles of all patches, supported or not.
pub(super) fn n_tiles(stored: &[StoredPatch]) -> u64 {
    stored.iter().map(|patch| patch.supported.len() as u64).sum()
}
