//! The lattice model in the integers that a file stores.

use surfabet_entropy::Coder;

use super::axes::Orientation;
use super::coding::points::{PointModels, code_points};
use super::coding::{Geometry, GeometryModels, code_geometry};
use super::color::cells::{cell_key, cell_of_key, color_cells};
use super::color::{CellColors, ColorModels, ColorSource, ColorSteps, code_colors};
use super::learn::PatchesReport;
use super::surface::basis::N_SHAPES;
use super::surface::leaf::Leaf;
use crate::error::{Error, Result};
use crate::report::Beside;

/// Pixels per side of a patch at every level.
pub const PATCH_PIXELS: i32 = 8;

/// Most levels.
pub const MAX_LEVELS: u32 = 4;

/// Largest tile coordinate.
pub const MAX_TILE: i32 = 1 << 20;

/// Largest stored depth or coefficient, in steps.
pub const MAX_DEPTH: i32 = 1 << 24;

/// Steps of thickness per finest pixel.
pub(super) const THICKNESS_STEPS: u8 = 4;

/// Largest half thickness, in steps.
pub const MAX_THICKNESS: u8 = 63;

/// A patch: a height field of 8 x 8 pixels over its square.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LatticePatch {
    /// Bit `8 * row + column` is set where the pixel belongs to the surface.
    pub mask: u64,
    /// Coefficients of the shapes of `basis`, in depth steps; the first is the depth of the middle.
    pub coefficients: [i32; N_SHAPES],
    /// Half thickness of the measured surface, in steps of a quarter of the finest pixel.
    pub thickness: u8,
}

impl LatticePatch {
    /// Half thickness of the measured surface, finest pixels.
    pub fn half_thickness(&self) -> f32 {
        f32::from(self.thickness) / f32::from(THICKNESS_STEPS)
    }

    /// Standard deviation of the scan about the surface, finest pixels: that of a slab of its thickness.
    pub fn sigma(&self) -> f64 {
        f64::from(self.half_thickness()) / 3.0_f64.sqrt()
    }
}

/// What stands at a square of the hierarchy.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Square {
    /// No surface.
    #[default]
    Empty,
    /// One patch.
    Patch(LatticePatch),
    /// Four squares of the next level: left to right, then the next row.
    Split(Box<[Square; 4]>),
}

/// A sheet of surface over a tile of the coarsest level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SheetTree {
    /// Twice the depth axis, plus one where the surface faces down that axis.
    pub side: u8,
    /// Tile coordinates along the two axes that follow the depth axis.
    pub tile: [i32; 2],
    /// What stands at the tile; never empty.
    pub root: Square,
}

/// The pixel lattice that all patches share.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lattice {
    /// World position of the lattice's zero, metres.
    pub origin: [f64; 3],
    /// Directions of the lattice's axes.
    pub orientation: Orientation,
    /// Side of the finest pixel, metres.
    pub pixel_size: f64,
    /// Number of levels, 1 to 4; pixels of the last, the finest, have side `pixel_size`, those of each level above
    /// twice the side of the next.
    pub levels: u32,
    /// Depth step, in sixteenths of the finest pixel.
    pub depth_step: u32,
}

impl Lattice {
    /// Finest pixels per side of a tile.
    pub fn tile_pixels(&self) -> i32 {
        self.patch_width(0)
    }

    /// Side of a pixel of a level below `levels`, 0 the coarsest, metres.
    pub fn pixel_of(&self, level: u32) -> f64 {
        self.pixel_size * f64::from(1_u32 << self.doublings(level))
    }

    /// Doublings from the side of a finest pixel to that of a pixel of `level`.
    pub(super) fn doublings(&self, level: u32) -> u32 {
        self.levels - 1 - level
    }

    /// Finest pixels per side of a patch of `level`.
    pub(super) fn patch_width(&self, level: u32) -> i32 {
        PATCH_PIXELS << self.doublings(level)
    }

    /// Checks that all numbers are in their domains.
    pub(super) fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::Inconsistent(what));
        if self.origin.iter().any(|c| !c.is_finite()) {
            return fail(format!("origin {:?} is not finite", self.origin));
        }
        if !self.orientation.is_valid() {
            return fail(format!("{:?} is no rotation", self.orientation));
        }
        if !(self.pixel_size.is_finite() && self.pixel_size > 0.0) {
            return fail(format!("pixel size is {}, but must be positive", self.pixel_size));
        }
        if !(1..=MAX_LEVELS).contains(&self.levels) {
            return fail(format!("{} levels, not 1 to {MAX_LEVELS}", self.levels));
        }
        if !(1..=256).contains(&self.depth_step) {
            return fail(format!("depth step of {} sixteenths, not 1 to 256", self.depth_step));
        }
        Ok(())
    }
}

/// Checks that all sheets fit the lattice.
fn check_sheets(sheets: &[SheetTree], levels: u32) -> Result<()> {
    for sheet in sheets {
        if sheet.side >= 6 || sheet.tile.iter().any(|t| t.unsigned_abs() > MAX_TILE as u32) {
            let what = format!("side {} at tile {:?} is out of range", sheet.side, sheet.tile);
            return Err(Error::Inconsistent(what));
        }
        check_square(&sheet.root, levels - 1)?;
    }
    Ok(())
}

/// Checks what stands at a square with `levels_below` finer levels.
fn check_square(square: &Square, levels_below: u32) -> Result<()> {
    match square {
        Square::Empty => Ok(()),
        Square::Patch(patch) => {
            let large = patch.coefficients.iter().find(|c| c.unsigned_abs() > MAX_DEPTH as u32);
            if let Some(c) = large {
                return Err(Error::Inconsistent(format!("a depth of {c} steps is out of range")));
            }
            if patch.mask == 0 {
                return Err(Error::Inconsistent("a patch without pixels".into()));
            }
            if patch.thickness > MAX_THICKNESS {
                let what = format!("a thickness of {}, above {MAX_THICKNESS}", patch.thickness);
                return Err(Error::Inconsistent(what));
            }
            Ok(())
        }
        Square::Split(_) if levels_below == 0 => {
            Err(Error::Inconsistent("a split below the finest level".into()))
        }
        Square::Split(children) => {
            children.iter().try_for_each(|c| check_square(c, levels_below - 1))
        }
    }
}

/// What a lattice model says of itself before its streams.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchesHeader {
    /// Points of the cloud that the model was learned from.
    pub n_points: u64,
    /// The lattice of the patches.
    pub lattice: Lattice,
    /// Number of patches.
    pub n_patches: u64,
    /// Rounding of the colours' coefficients, where there are colours.
    pub color: Option<ColorSteps>,
    /// Number of points that no patch holds.
    pub n_extra: u64,
    /// Side of the cells that those points are rounded to, metres.
    pub extra_size: f64,
    /// Largest distance of any input point to the decoded cloud, metres, where it was asked for: decoded as
    /// measured, at half a pixel.
    pub max_error: Option<f64>,
}

/// Colours of the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColorField {
    pub steps: ColorSteps,
    /// Sorted keys of the cells.
    pub cells: Vec<u64>,
    /// Coefficients of the transform, as a file stores them.
    pub coefficients: Vec<i32>,
    /// Colour of each cell.
    pub colors: Vec<[u8; 3]>,
}

/// A cloud as patches on a lattice, with colour on the cells around them; immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchModel {
    n_points: u64,
    lattice: Lattice,
    sheets: Vec<SheetTree>,
    leaves: Vec<Leaf>,
    color: Option<ColorField>,
    extra: Vec<u64>,
    extra_size: f64,
    max_error: Option<f64>,
    report: Beside<PatchesReport>,
}

/// What there is of a level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LevelSize {
    /// Number of patches.
    pub patches: u64,
    /// Set pixels of all patches.
    pub set_pixels: u64,
}

impl PatchModel {
    /// Puts the learned parts together, with an empty report.
    pub(super) fn new(
        n_points: u64,
        lattice: Lattice,
        Geometry { sheets, leaves }: Geometry,
        color: Option<ColorField>,
    ) -> Result<Self> {
        lattice.check()?;
        check_sheets(&sheets, lattice.levels)?;
        Ok(Self {
            n_points,
            lattice,
            sheets,
            leaves,
            color,
            extra: Vec::new(),
            extra_size: lattice.pixel_size,
            max_error: None,
            report: Beside::default(),
        })
    }

    /// With points that no patch is near enough to, as cells of side `size`, and the bound that they keep, if any.
    pub(super) fn with_extra(mut self, extra: Vec<u64>, size: f64, max_error: Option<f64>) -> Self {
        (self.extra, self.extra_size, self.max_error) = (extra, size, max_error);
        self
    }

    pub(super) fn with_report(self, report: PatchesReport) -> Self {
        Self { report: Beside(report), ..self }
    }

    /// What the file says before its streams.
    pub fn header(&self) -> PatchesHeader {
        PatchesHeader {
            n_points: self.n_points,
            lattice: self.lattice,
            n_patches: self.leaves.len() as u64,
            color: self.color.as_ref().map(|c| c.steps),
            n_extra: self.extra.len() as u64,
            extra_size: self.extra_size,
            max_error: self.max_error,
        }
    }

    /// Writes the streams of geometry, colour and extra points.
    ///
    /// # Errors
    /// Those of the coders.
    pub(super) fn write<C: Coder>(
        &self,
        geometry: &mut C,
        color: &mut C,
        extra: &mut C,
    ) -> Result<(), C::Error> {
        let mut models = GeometryModels::default();
        code_geometry(geometry, &mut models, self.lattice, &self.sheets, usize::MAX)?;
        if let Some(field) = &self.color {
            let source = ColorSource::Model(&field.coefficients);
            code_colors(color, &mut ColorModels::default(), &field.cells, field.steps, source)?;
        }
        code_points(extra, &mut PointModels::default(), &self.extra, usize::MAX)?;
        Ok(())
    }

    /// Reads the streams that [`PatchModel::write`] wrote.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(super) fn read<C: Coder>(
        header: &PatchesHeader,
        max_cells: u64,
        geometry: &mut C,
        color: &mut C,
        extra: &mut C,
    ) -> Result<Self, C::Error> {
        let lattice = header.lattice;
        lattice.check().map_err(|e| geometry.corrupt(e.to_string()))?;
        let n_patches = usize::try_from(header.n_patches).unwrap_or(usize::MAX);
        let models = &mut GeometryModels::default();
        let Geometry { sheets, leaves } = code_geometry(geometry, models, lattice, &[], n_patches)?;
        check_sheets(&sheets, lattice.levels).map_err(|e| geometry.corrupt(e.to_string()))?;
        if leaves.len() != n_patches {
            let found = leaves.len();
            return Err(geometry.corrupt(format!("{found} patches instead of {n_patches}")));
        }
        let color = match header.color {
            None => None,
            Some(steps) if steps.is_valid() => {
                let cells = color_cells(&lattice, &leaves, max_cells).ok_or_else(|| {
                    geometry.corrupt(format!("more than {max_cells} cells of colour"))
                })?;
                let models = &mut ColorModels::default();
                let CellColors { colors, coefficients } =
                    code_colors(color, models, &cells, steps, ColorSource::Stream)?;
                Some(ColorField { steps, cells, coefficients, colors })
            }
            Some(steps) => return Err(color.corrupt(format!("{steps:?} are not 1 to 4096"))),
        };
        let n_extra = usize::try_from(header.n_extra).unwrap_or(usize::MAX);
        let points = code_points(extra, &mut PointModels::default(), &[], n_extra)?;
        if points.len() != n_extra || !(1e-9..1e6).contains(&header.extra_size) {
            let what = format!(
                "{} points of size {} instead of {n_extra}",
                points.len(),
                header.extra_size
            );
            return Err(extra.corrupt(what));
        }
        if header.max_error.is_some_and(|e| !(e.is_finite() && e > 0.0)) {
            return Err(extra.corrupt(format!("a largest error of {:?} m", header.max_error)));
        }
        Ok(Self {
            n_points: header.n_points,
            lattice,
            sheets,
            leaves,
            color,
            extra: points,
            extra_size: header.extra_size,
            max_error: header.max_error,
            report: Beside::default(),
        })
    }

    /// The lattice that all patches share.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// The hierarchies of all sheets, by side, then along a space-filling curve of their tiles.
    pub fn sheets(&self) -> &[SheetTree] {
        &self.sheets
    }

    /// Number of patches and of their set pixels at each level, coarsest first.
    pub fn level_sizes(&self) -> Vec<LevelSize> {
        let mut sizes = vec![LevelSize::default(); self.lattice.levels as usize];
        for leaf in &self.leaves {
            let of = &mut sizes[leaf.level as usize];
            of.patches += 1;
            of.set_pixels += u64::from(leaf.patch.mask.count_ones());
        }
        sizes
    }

    /// All patches, in the order of the file.
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }

    /// Keys and colours of the cells that carry colour.
    pub(super) fn cell_colors(&self) -> Option<(&[u64], &[[u8; 3]])> {
        self.color.as_ref().map(|field| (&field.cells[..], &field.colors[..]))
    }

    /// Points that no patch holds, in the frame of the lattice, metres.
    pub fn points(&self) -> Vec<[f32; 3]> {
        let size = self.extra_size;
        let middle = |c: i32| ((f64::from(c) + 0.5) * size) as f32;
        self.extra.iter().map(|&k| cell_of_key(k).map(middle)).collect()
    }

    /// World position that the model computes about, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.lattice.origin
    }

    /// Points of the cloud that the model was learned from.
    pub fn n_points(&self) -> u64 {
        self.n_points
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }

    /// True without patches.
    pub fn is_empty(&self) -> bool {
        self.leaves.is_empty()
    }

    /// True when the model carries colour.
    pub fn has_color(&self) -> bool {
        self.color.is_some()
    }

    /// Largest distance of any input point to the cloud decoded as measured at half a pixel, metres, where
    /// learning was asked to keep one.
    pub fn max_error(&self) -> Option<f64> {
        self.max_error
    }

    /// How the model was learned; empty for a model read from a file.
    pub fn report(&self) -> &PatchesReport {
        &self.report.0
    }
}

/// Key of the cell of side `size` that a position lies in.
pub(super) fn extra_key(p: [f32; 3], size: f64) -> u64 {
    cell_key(p.map(|c| (f64::from(c) / size).floor() as i32))
}
