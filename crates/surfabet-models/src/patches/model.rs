//! The lattice model in the integers that a file stores.

use surfabet_base::rounding::floor_f64;
use surfabet_entropy::Coder;

use super::attributes::borders::{Border, BorderBlocks, FieldCells};
use super::attributes::cells::{attribute_cells, cell_key, cell_of_key};
use super::attributes::color::{ColorField, ColorSteps};
use super::attributes::{
    AttributeField, AttributeHeader, FieldCoding, INTENSITIES, MAX_ATTRIBUTES, check,
};
use super::axes::Orientation;
use super::coding::near_points::{NearPointModels, code_near_points};
use super::coding::point_patterns::{PatternModels, code_point_patterns};
use super::coding::points::{PointModels, code_points};
use super::coding::{Geometry, GeometryModels, PointCoding, code_geometry};
use super::instances::coding::code_instances;
use super::instances::{Blocks, Instances, MAX_INSTANCES};
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
    /// One patch; boxed, since most squares of a scattered cloud are empty.
    Patch(Box<LatticePatch>),
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
    ///
    /// # Errors
    /// [`Error::Inconsistent`].
    pub fn check(&self) -> Result<()> {
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

/// The header of a model in the file, before the streams.
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
    /// How those points are coded.
    pub point_coding: PointCoding,
    /// Largest distance of any input point to the decoded cloud, metres, where it was asked for: decoded as
    /// measured, at half a pixel.
    pub max_error: Option<f64>,
    /// Largest distance of any decoded point to the input, metres, where it was asked for: as measured or as a surface, at half
    /// a pixel.
    pub max_error_forward: Option<f64>,
    /// Intensities and other attributes beside colour.
    pub attributes: Vec<AttributeHeader>,
    /// A point has the attributes of the cell that it lies in, instead of a mean of those around it: where surfaces lie close
    /// behind one another, the mean would be of both.
    pub unblended: bool,
    /// Number of instances.
    pub n_instances: u64,
    /// How colours and scalars are coded.
    pub coding: FieldCoding,
    /// The cube of a tile whose colours and scalars are corrected at its borders; in the header of a map in tiles any, where those
    /// of all are.
    pub border: Option<Border>,
}

/// Attributes on the cells around the surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Attributes {
    /// Sorted keys of the cells; none without attributes.
    pub cells: Vec<u64>,
    pub color: Option<ColorField>,
    /// Those beside colour.
    pub others: Vec<AttributeField>,
    /// See [`PatchesHeader::unblended`].
    pub unblended: bool,
    /// How colours and scalars are coded.
    pub coding: FieldCoding,
    /// The blocks of cells at the borders, where values are corrected there; boxed, since most models have none.
    pub border: Option<Box<BorderBlocks>>,
}

/// The streams of a model.
#[derive(Debug)]
pub(super) struct Streams<'a, C> {
    pub geometry: &'a mut C,
    pub color: &'a mut C,
    /// Points that no patch holds.
    pub extra: &'a mut C,
    /// What is given once more at other places.
    pub instances: &'a mut C,
    /// One for each attribute beside colour that there may be.
    pub attributes: [&'a mut C; MAX_ATTRIBUTES],
}

/// A cloud as patches on a lattice, with attributes on the cells around them; immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchModel {
    n_points: u64,
    lattice: Lattice,
    sheets: Vec<SheetTree>,
    leaves: Vec<Leaf>,
    attributes: Attributes,
    extra: Vec<u64>,
    extra_size: f64,
    point_coding: PointCoding,
    max_error: Option<f64>,
    max_error_forward: Option<f64>,
    instances: Instances,
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
        attributes: Attributes,
    ) -> Result<Self> {
        lattice.check()?;
        check_sheets(&sheets, lattice.levels)?;
        Ok(Self {
            n_points,
            lattice,
            sheets,
            leaves,
            attributes,
            extra: Vec::new(),
            extra_size: lattice.pixel_size,
            point_coding: PointCoding::Patterns,
            max_error: None,
            max_error_forward: None,
            instances: Instances::default(),
            report: Beside::default(),
        })
    }

    /// With points that no patch is near enough to, as cells of side `size`, and the bound that they keep, if any.
    pub(super) fn with_extra(mut self, extra: Vec<u64>, size: f64, max_error: Option<f64>) -> Self {
        (self.extra, self.extra_size, self.max_error) = (extra, size, max_error);
        self
    }

    /// With the bound that the surface keeps, if any.
    pub(super) fn with_max_error_forward(self, max_error_forward: Option<f64>) -> Self {
        Self { max_error_forward, ..self }
    }

    /// With points that no patch holds in the place of those that there are, some of them given again by each instance.
    pub(super) fn with_shared_extra(
        mut self,
        extra: Vec<u64>,
        of_instances: Vec<Vec<u32>>,
    ) -> Self {
        self.extra = extra;
        for (instance, points) in self.instances.all.iter_mut().zip(of_instances) {
            instance.points = points;
        }
        self
    }

    /// With patches and points that are given once more; the numbers are those of the model.
    pub(super) fn with_instances(self, instances: Instances) -> Self {
        Self { instances, ..self }
    }

    pub(super) fn with_report(self, report: PatchesReport) -> Self {
        Self { report: Beside(report), ..self }
    }

    /// The header in the file, before the streams.
    pub fn header(&self) -> PatchesHeader {
        PatchesHeader {
            n_points: self.n_points,
            lattice: self.lattice,
            n_patches: self.leaves.len() as u64,
            color: self.attributes.color.as_ref().map(|c| c.steps),
            n_extra: self.extra.len() as u64,
            extra_size: self.extra_size,
            point_coding: self.point_coding,
            max_error: self.max_error,
            max_error_forward: self.max_error_forward,
            attributes: self.attributes.others.iter().map(AttributeField::header).collect(),
            unblended: self.attributes.unblended,
            n_instances: self.instances.all.len() as u64,
            coding: self.attributes.coding,
            border: self.attributes.border.as_ref().map(|blocks| blocks.border),
        }
    }

    /// Writes the streams.
    ///
    /// # Errors
    /// Those of the coders.
    pub(super) fn write<C: Coder>(&self, streams: Streams<'_, C>) -> Result<(), C::Error> {
        let mut models = GeometryModels::default();
        code_geometry(streams.geometry, &mut models, self.lattice, &self.sheets, usize::MAX)?;
        let Attributes { color, others, .. } = &self.attributes;
        let cells = self.attributes.cells();
        if let Some(field) = color {
            field.write(streams.color, cells)?;
        }
        for (field, coder) in others.iter().zip(streams.attributes) {
            field.write(coder, cells)?;
        }
        code_extra(streams.extra, self.point_coding, &self.extra, usize::MAX)?;
        let n = self.instances.all.len();
        let blocks = match n {
            0 => Blocks::default(),
            _ => Blocks::of(&self.lattice, &self.leaves, &self.extra, self.extra_size),
        };
        code_instances(streams.instances, &self.instances, &blocks, n, u64::MAX)?;
        Ok(())
    }

    /// Reads the streams that [`PatchModel::write`] wrote, of at most so many cells of attributes and
    /// decisions about patches of instances.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(super) fn read<C: Coder>(
        header: &PatchesHeader,
        [max_cells, max_copies]: [u64; 2],
        streams: Streams<'_, C>,
    ) -> Result<Self, C::Error> {
        let Streams { geometry, color, extra, instances, attributes } = streams;
        let lattice = header.lattice;
        lattice.check().map_err(|e| geometry.corrupt(e.to_string()))?;
        check(&header.attributes).map_err(|what| geometry.corrupt(what))?;
        let n_patches = usize::try_from(header.n_patches).unwrap_or(usize::MAX);
        let models = &mut GeometryModels::default();
        let Geometry { sheets, leaves } = code_geometry(geometry, models, lattice, &[], n_patches)?;
        check_sheets(&sheets, lattice.levels).map_err(|e| geometry.corrupt(e.to_string()))?;
        if leaves.len() != n_patches {
            let found = leaves.len();
            return Err(geometry.corrupt(format!("{found} patches instead of {n_patches}")));
        }
        let cells = match header.color.is_some() || !header.attributes.is_empty() {
            true => attribute_cells(&lattice, &leaves, max_cells).ok_or_else(|| {
                geometry.corrupt(format!("more than {max_cells} cells of attributes"))
            })?,
            false => Vec::new(),
        };
        if header.border.is_some_and(|border| border.side < 1) {
            return Err(geometry.corrupt("corrections at borders without tiles".into()));
        }
        let attributes = Attributes::read(header, cells, color, attributes)?;
        let extra = read_extra(header, extra)?;
        let instances = read_instances(header, (&leaves, &extra), max_copies, instances)?;
        Ok(Self {
            n_points: header.n_points,
            lattice,
            sheets,
            leaves,
            attributes,
            extra,
            extra_size: header.extra_size,
            // Without points either would do, and a file does not say which.
            point_coding: if header.n_extra == 0 {
                PointCoding::Patterns
            } else {
                header.point_coding
            },
            max_error: header.max_error,
            max_error_forward: header.max_error_forward,
            instances,
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

    /// Attributes on the cells around the surface.
    pub(super) fn attributes(&self) -> &Attributes {
        &self.attributes
    }

    /// Patches and points beside them that the model gives once more, at other places.
    pub fn instances(&self) -> &Instances {
        &self.instances
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
        self.attributes.color.is_some()
    }

    /// True when the model carries intensities.
    pub fn has_intensity(&self) -> bool {
        self.attributes.others.iter().any(|field| field.name == INTENSITIES)
    }

    /// Names of the attributes that the model carries beside colour.
    pub fn attribute_names(&self) -> Vec<&str> {
        self.attributes.others.iter().map(|field| field.name.as_str()).collect()
    }

    /// Largest distance of any input point to the cloud decoded as measured at half a pixel, metres, where
    /// learning was asked to keep one.
    pub fn max_error(&self) -> Option<f64> {
        self.max_error
    }

    /// Largest distance of any decoded point to the input, as measured or as a surface at half a pixel, metres, where
    /// learning was asked to keep one.
    pub fn max_error_forward(&self) -> Option<f64> {
        self.max_error_forward
    }

    /// How the model was learned; empty for a model read from a file.
    pub fn report(&self) -> &PatchesReport {
        &self.report.0
    }
}

impl Attributes {
    /// The cells as fields are coded on them.
    fn cells(&self) -> FieldCells<'_> {
        FieldCells { keys: &self.cells, border: self.border.as_deref(), coding: self.coding }
    }

    /// Reads the attributes of these cells; what `header` has of those beside colour was checked.
    fn read<C: Coder>(
        header: &PatchesHeader,
        cells: Vec<u64>,
        color: &mut C,
        others: [&mut C; MAX_ATTRIBUTES],
    ) -> Result<Self, C::Error> {
        let coding = header.coding;
        let border = header.border.map(|border| Box::new(BorderBlocks::new(border, &cells)));
        let of = FieldCells { keys: &cells, border: border.as_deref(), coding };
        let color = match header.color {
            Some(steps) => Some(ColorField::read(color, of, steps)?),
            None => None,
        };
        let fields = header.attributes.iter().zip(others);
        let others = fields.map(|(header, coder)| AttributeField::read(coder, of, header));
        let others = others.collect::<Result<_, _>>()?;
        Ok(Self { cells, color, others, unblended: header.unblended, coding, border })
    }
}

/// Writes, reads or prices the points beside the patches.
fn code_extra<C: Coder>(
    coder: &mut C,
    coding: PointCoding,
    keys: &[u64],
    most: usize,
) -> Result<Vec<u64>, C::Error> {
    match coding {
        PointCoding::Alone => code_points(coder, &mut PointModels::default(), keys, most),
        PointCoding::Around => code_near_points(coder, &mut NearPointModels::default(), keys, most),
        PointCoding::Patterns => {
            code_point_patterns(coder, &mut PatternModels::default(), keys, most)
        }
    }
}

/// Reads the points beside the patches.
fn read_extra<C: Coder>(header: &PatchesHeader, coder: &mut C) -> Result<Vec<u64>, C::Error> {
    let n = usize::try_from(header.n_extra).unwrap_or(usize::MAX);
    let points = code_extra(coder, header.point_coding, &[], n)?;
    if points.len() != n || !(1e-9..1e6).contains(&header.extra_size) {
        let (found, size) = (points.len(), header.extra_size);
        return Err(coder.corrupt(format!("{found} points of size {size} instead of {n}")));
    }
    for bound in [header.max_error, header.max_error_forward].into_iter().flatten() {
        if !(bound.is_finite() && bound > 0.0) {
            return Err(coder.corrupt(format!("a largest error of {bound} m")));
        }
    }
    Ok(points)
}

/// Reads the instances of patches and points beside them, deciding about at most `most`.
fn read_instances<C: Coder>(
    header: &PatchesHeader,
    (leaves, points): (&[Leaf], &[u64]),
    most: u64,
    coder: &mut C,
) -> Result<Instances, C::Error> {
    let n = header.n_instances;
    if n > MAX_INSTANCES {
        return Err(coder.corrupt(format!("{n} instances, more than {MAX_INSTANCES}")));
    }
    if n == 0 {
        return Ok(Instances::default());
    }
    let blocks = Blocks::of(&header.lattice, leaves, points, header.extra_size);
    code_instances(coder, &Instances::default(), &blocks, n as usize, most)
}

/// Key of the cell of side `size` that a position lies in.
pub(super) fn extra_key(p: [f32; 3], size: f64) -> u64 {
    cell_key(p.map(|c| floor_f64(f64::from(c) / size) as i32))
}
