//! A lattice model back into a cloud, at any spacing, as a surface or as measured.

mod attributes;
mod columns;
mod fragments;
mod nearest;
mod reach;

use std::borrow::Borrow;
use std::ops::Range;

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f32;
use surfabet_geom::{CloudParts, PointCloud, Progress};

pub(super) use self::attributes::Sampler;
pub use self::columns::ScanColumns;
use self::fragments::fragments;
use self::nearest::NearestPatch;
pub(super) use self::reach::{LastFound, MeasuredReach, PlacedPatch};
use crate::contract::DecodeOptions;
use crate::error::{Result, check_points};
use crate::patches::instances::Motion;
use crate::patches::model::{Lattice, PATCH_PIXELS, PatchModel};
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{DEGREES, N_SHAPES, derivative, value};
use crate::patches::surface::leaf::Leaf;
use crate::patches::tiles::ROUNDING;
use crate::points::Points;
use crate::region::Region;
use crate::vector::dot;

/// Patches that one task decodes.
const BLOCK: usize = 32;

impl PatchModel {
    /// The model as a cloud. Points come patch by patch, then those that no patch holds; their number and order
    /// are not those of the input.
    ///
    /// With `as_measured`, the thickness that the scan had at each patch is filled with layers at the spacing;
    /// otherwise the surface is thin, and nearer to the true one than the scan was; fragments are left out then, at
    /// most 16 finest pixels that stand 1.5 to 10 of them off a larger piece and touch nothing.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for a spacing that is not positive, [`crate::Error::TooManyPoints`] above the
    /// limit, [`crate::Error::Cancelled`] when the caller asks to stop.
    pub fn decode(&self, options: DecodeOptions, progress: &dyn Progress) -> Result<PointCloud> {
        self.decode_part(None, options, progress)
    }

    /// What [`PatchModel::decode`] gives of the points in `region`, or all of it; patches outside are not decoded.
    pub(super) fn decode_part(
        &self,
        region: Option<&Region>,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        self.decode_with(region, options, Filling::default(), progress)
    }

    /// What the model holds of a region, to be learned from again: as measured, with normals, and with the variance of the
    /// thickness about each patch; without the layers that a `scan` of the same place shows not to be there.
    ///
    /// # Errors
    /// As [`PatchModel::decode`].
    pub fn remembered(
        &self,
        region: &Region,
        scan: Option<&ScanColumns>,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let filling = Filling { layers: Layers::OfVariance, scan, ..Filling::default() };
        self.decode_with(Some(region), Self::to_remember(), filling, progress)
    }

    /// The same in two parts: what the patches decode to that are `kept`, and the rest with the points beside the patches.
    ///
    /// # Errors
    /// As [`PatchModel::decode`].
    pub fn remembered_apart(
        &self,
        region: &Region,
        scan: &ScanColumns,
        kept: &[bool],
        progress: &dyn Progress,
    ) -> Result<[PointCloud; 2]> {
        let part = |are_kept: bool| {
            let left_out: Vec<bool> = kept.iter().map(|&kept| kept != are_kept).collect();
            let filling = Filling {
                layers: Layers::OfVariance,
                scan: Some(scan),
                left_out: Some(&left_out),
                without_beside: are_kept,
            };
            self.decode_with(Some(region), Self::to_remember(), filling, progress)
        };
        Ok([part(true)?, part(false)?])
    }

    fn to_remember() -> DecodeOptions {
        DecodeOptions { as_measured: true, normals: true, ..DecodeOptions::default() }
    }

    fn decode_with(
        &self,
        region: Option<&Region>,
        options: DecodeOptions,
        filling: Filling<'_>,
        progress: &dyn Progress,
    ) -> Result<PointCloud> {
        let motions = self.instances().motions();
        let mut surface = self.surface(region, options, (&motions, filling), progress)?;
        let attributes = self.attributes_of(&mut surface, options, progress)?;
        progress.update("decoding", 1.0);
        surface.move_instances();
        let Points { positions, normals, .. } = surface.points;
        let rotation = Rotation::of(self.lattice());
        let rotated = |mut normals: Vec<[f32; 3]>| {
            parallel::for_each_mut(&mut normals, |_, n| *n = rotation.of_direction(*n));
            normals
        };
        let parts = CloudParts {
            origin: self.lattice().origin,
            positions: rotation.of_positions(positions),
            normals: options.normals.then(|| rotated(normals)),
            ..attributes
        };
        let (cloud, _) = PointCloud::from_parts(parts)?;
        match region {
            Some(region) => region.crop(&cloud),
            None => Ok(cloud),
        }
    }

    /// Attributes of decoded points, as parts of a cloud without positions. Adds normals of the points beside the patches,
    /// where these are asked for.
    fn attributes_of(
        &self,
        surface: &mut DecodedSurface<'_>,
        options: DecodeOptions,
        progress: &dyn Progress,
    ) -> Result<CloudParts> {
        let sampler = Sampler::new(self.attributes());
        let DecodedSurface { points, first_beside, placed, .. } = surface;
        let has_motions = placed.iter().any(|(_, motion)| motion.is_some());
        let are_beside = points.positions.len() > *first_beside;
        if !are_beside || !(options.normals || has_motions) {
            return sampler.at(&points.positions, progress);
        }
        let nearest = NearestPatch::new(self.lattice(), placed.iter().copied())?;
        let beside = &points.positions[*first_beside..];
        if options.normals {
            points.normals.extend(beside.iter().map(|&p| nearest.normal(p)));
        }
        if !has_motions {
            return sampler.at(&points.positions, progress);
        }
        let mut sources = points.positions.clone();
        parallel::for_each_mut(&mut sources[*first_beside..], |_, p| *p = nearest.source_of(*p));
        sampler.at(&sources, progress)
    }

    /// Number of points that the model decodes to as measured, at the spacing that it was made for.
    pub fn n_measured(&self) -> f64 {
        let lattice = self.lattice();
        let of_patch = |leaf: &Leaf| {
            let width = lattice.patch_width(leaf.level);
            let per_pixel = samples(width, 0.5) / f64::from(PATCH_PIXELS);
            let pixels = f64::from(leaf.patch.mask.count_ones());
            pixels * per_pixel * per_pixel * layers(leaf, 0.5, true)
        };
        self.leaves().iter().map(of_patch).sum::<f64>() + self.header().n_extra as f64
    }

    /// Points of the patches and those beside them in the frame of the lattice; those of instances where they are coded.
    fn surface<'a>(
        &'a self,
        region: Option<&Region>,
        options: DecodeOptions,
        (motions, filling): (&'a [Motion], Filling<'_>),
        progress: &dyn Progress,
    ) -> Result<DecodedSurface<'a>> {
        options.check()?;
        // What stands off the surface is part of the scan, so it is kept as measured.
        let is_left_out = match filling.left_out {
            Some(left_out) => left_out.to_vec(),
            None if options.as_measured => vec![false; self.len()],
            None => fragments(&self.lattice(), self.leaves())?,
        };
        let parts = self.placed(&is_left_out, motions);
        let lattice = self.lattice();
        let rotation = lattice.orientation.rotation();
        let is_wanted = |leaf: &Leaf, motion: Option<&Motion>| {
            let bounds = || {
                let bounds = leaf.bounds(&lattice);
                let [low, high] = motion.map_or(bounds, |motion| motion.of_bounds(bounds));
                let metres = |c: f64| c * lattice.pixel_size;
                [low.map(|c| metres(c - ROUNDING)), high.map(|c| metres(c + ROUNDING))]
            };
            region.is_none_or(|region| region.meets(lattice.origin, rotation, bounds()))
        };
        let wanted: Vec<Vec<&Leaf>> = parts
            .iter()
            .map(|(leaves, motion)| {
                leaves.iter().copied().filter(|leaf| is_wanted(leaf, *motion)).collect()
            })
            .collect();
        let beside = self.header().n_extra + self.instances().n_points();
        let decoder = Decoder::new(lattice, wanted.iter().flatten().copied(), beside, options)?;
        let decoder = Decoder { filling, ..decoder };
        let mut points = Points::default();
        let mut moved = Vec::new();
        for (leaves, (_, motion)) in wanted.iter().zip(&parts) {
            let from = points.positions.len();
            decoder.add(leaves, &mut points, progress)?;
            moved.extend(motion.map(|motion| (from..points.positions.len(), motion)));
        }
        let pixel = lattice.pixel_size as f32;
        let first_beside = points.positions.len();
        let beside = if filling.without_beside { Vec::new() } else { self.points() };
        let beside: Vec<[f32; 3]> = beside.into_iter().map(|p| p.map(|c| c / pixel)).collect();
        points.positions.extend(&beside);
        for (instance, motion) in self.instances().all.iter().zip(motions) {
            let from = points.positions.len();
            points.positions.extend(instance.points.iter().map(|&i| beside[i as usize]));
            moved.push((from..points.positions.len(), motion));
        }
        let of_part = |(leaves, motion): (Vec<&'a Leaf>, Option<&'a Motion>)| {
            leaves.into_iter().map(move |leaf| (leaf, motion))
        };
        let placed = parts.into_iter().flat_map(of_part).collect();
        Ok(DecodedSurface { points, moved, first_beside, placed })
    }

    /// The patches that are coded, then those of each instance with its motion; without those that are left out.
    fn placed<'a>(
        &'a self,
        is_left_out: &[bool],
        motions: &'a [Motion],
    ) -> Vec<(Vec<&'a Leaf>, Option<&'a Motion>)> {
        let kept = |(i, leaf): (usize, &'a Leaf)| (!is_left_out[i]).then_some(leaf);
        let coded = self.leaves().iter().enumerate().filter_map(kept).collect();
        let of_instances = self.instances().all.iter().zip(motions).map(|(instance, motion)| {
            (self.patches_of(instance).filter_map(kept).collect(), Some(motion))
        });
        std::iter::once((coded, None)).chain(of_instances).collect()
    }
}

/// What the patches give.
struct DecodedSurface<'a> {
    /// Positions, pixels, where they are coded; normals of those that are on patches.
    points: Points,
    /// Ranges of the points of instances, with the motions to where they stand.
    moved: Vec<(Range<usize>, &'a Motion)>,
    /// Number of the first point beside the patches.
    first_beside: usize,
    /// The patches with their motions, without fragments that are left out.
    placed: Vec<(&'a Leaf, Option<&'a Motion>)>,
}

impl DecodedSurface<'_> {
    /// Moves the points of instances to where they stand.
    fn move_instances(&mut self) {
        for (range, motion) in self.moved.drain(..) {
            parallel::for_each_mut(&mut self.points.positions[range.clone()], |_, p| {
                *p = motion.of_position(*p);
            });
            if !self.points.normals.is_empty() {
                parallel::for_each_mut(&mut self.points.normals[range], |_, n| {
                    *n = motion.of_direction(*n);
                });
            }
        }
    }
}

/// From the frame of the lattice to that of the world.
struct Rotation {
    rows: [[f32; 3]; 3],
    pixel: f32,
}

impl Rotation {
    fn of(lattice: Lattice) -> Self {
        let rows = lattice.orientation.rotation().map(|row| row.map(|c| c as f32));
        Self { rows, pixel: lattice.pixel_size as f32 }
    }

    fn of_direction(&self, p: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| dot(self.rows[a], p))
    }

    /// Positions in pixels as metres about the origin.
    fn of_positions(&self, mut positions: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
        parallel::for_each_mut(&mut positions, |_, p| {
            *p = self.of_direction(p.map(|c| c * self.pixel));
        });
        positions
    }
}

/// Decodes single patches at the spacing that a model is made for.
pub(super) struct PatchDecoder {
    measured: Decoder<'static>,
    surface: Decoder<'static>,
    rotation: Rotation,
}

impl PatchDecoder {
    /// For patches of a lattice.
    ///
    /// # Errors
    /// [`crate::Error::TooManyPoints`] where `patches` are more than may be decoded.
    pub fn new(lattice: Lattice, patches: &[Leaf]) -> Result<Self> {
        let decoder = |as_measured| {
            let options = DecodeOptions { as_measured, ..DecodeOptions::default() };
            Decoder::new(lattice, patches, 0, options)
        };
        let rotation = Rotation::of(lattice);
        Ok(Self { measured: decoder(true)?, surface: decoder(false)?, rotation })
    }

    /// Whether all points of a patch hold `what` where a motion takes them, as measured and as a surface; positions are metres
    /// about the origin.
    pub fn holds(&self, leaf: &Leaf, motion: &Motion, what: impl Fn([f32; 3]) -> bool) -> bool {
        [&self.measured, &self.surface].into_iter().all(|decoder| {
            let mut points = Points::default();
            decoder.leaf(leaf, &mut points);
            let moved = points.positions.into_iter().map(|p| motion.of_position(p)).collect();
            self.rotation.of_positions(moved).into_iter().all(&what)
        })
    }

    /// Mask of the pixels of a patch of which all points hold `what`; positions are metres about the origin.
    pub fn pixels_of(
        &self,
        leaf: &Leaf,
        as_measured: bool,
        what: impl Fn([f32; 3]) -> bool,
    ) -> u64 {
        let decoder = if as_measured { &self.measured } else { &self.surface };
        let grid = &decoder.grids[leaf.level as usize];
        let mut mask = leaf.patch.mask;
        let mut points = Points::default();
        for row in 0..grid.at.len() {
            for column in 0..grid.at.len() {
                let pixel = grid.pixel([column, row]);
                if mask >> pixel & 1 != 0 {
                    decoder.sample(leaf, grid, [column, row], &mut points);
                    let positions = std::mem::take(&mut points.positions);
                    if !self.rotation.of_positions(positions).into_iter().all(&what) {
                        mask &= !(1 << pixel);
                    }
                }
            }
        }
        mask
    }
}

/// How the layers that fill a thickness lie in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Layers {
    /// Evenly.
    #[default]
    Even,
    /// So that they have the variance of the slab, `half^2 / 3`: n even layers have `1 - 1 / n^2` of it, and a scan that is
    /// learned again and again from them would become thinner and thinner.
    OfVariance,
}

impl Layers {
    /// Distance of the outer of `n` layers from the middle, as a multiple of what it is for even ones.
    fn stretch(self, n: usize) -> f32 {
        let n = n as f32;
        match self {
            Self::OfVariance if n > 1.0 => 1.0 / (1.0 - 1.0 / (n * n)).sqrt(),
            _ => 1.0,
        }
    }
}

/// How thickness is filled.
#[derive(Clone, Copy, Default)]
struct Filling<'a> {
    layers: Layers,
    /// What another scan shows of the same place.
    scan: Option<&'a ScanColumns>,
    /// Patches that are not decoded, by their numbers.
    left_out: Option<&'a [bool]>,
    /// Whether points beside the patches are left out; of a model without instances.
    without_beside: bool,
}

struct Decoder<'a> {
    lattice: Lattice,
    /// Samples per side of a patch, and the values of all shapes' factors there, per level.
    grids: Vec<Grid>,
    /// Spacing, pixels.
    spacing: f64,
    options: DecodeOptions,
    filling: Filling<'a>,
}

/// Layers that fill the thickness of a patch; spacing in pixels.
fn layers(leaf: &Leaf, spacing: f64, as_measured: bool) -> f64 {
    let thickness = 2.0 * f64::from(leaf.patch.half_thickness());
    if as_measured { (thickness / spacing).round().max(1.0) } else { 1.0 }
}

/// Samples along a side of a patch. The small slack keeps 0.01 / 0.005 at two samples per pixel although neither is
/// exact in binary.
fn samples(patch_width: i32, spacing: f64) -> f64 {
    (f64::from(patch_width) / spacing - 1e-9).ceil().max(1.0)
}

/// The samples along a side of the patches of a level.
struct Grid {
    /// Positions in pixels of the finest level.
    at: Vec<f32>,
    /// Row or column of the mask.
    cell: Vec<usize>,
    /// Factors and their derivatives by position.
    values: Vec<[f32; 6]>,
    slopes: Vec<[f32; 6]>,
}

impl Grid {
    fn new(patch_width: i32, spacing: f64) -> Self {
        let width = f64::from(patch_width);
        let n = samples(patch_width, spacing) as usize;
        let part = |i: usize| (i as f64 + 0.5) / n as f64;
        let x = |i: usize| 2.0 * part(i) - 1.0;
        Self {
            at: (0..n).map(|i| (part(i) * width) as f32).collect(),
            cell: (0..n).map(|i| (part(i) * f64::from(PATCH_PIXELS)) as usize).collect(),
            values: (0..n).map(|i| std::array::from_fn(|k| value(k, x(i)) as f32)).collect(),
            slopes: (0..n)
                .map(|i| std::array::from_fn(|k| (derivative(k, x(i)) * 2.0 / width) as f32))
                .collect(),
        }
    }

    /// The pixel of the mask that a sample lies in.
    fn pixel(&self, [column, row]: [usize; 2]) -> usize {
        PATCH_PIXELS as usize * self.cell[row] + self.cell[column]
    }
}

impl Decoder<'_> {
    /// For some patches and `more` points beside them, unless these are more points than may be decoded: a tiny spacing
    /// makes large grids.
    fn new<'b>(
        lattice: Lattice,
        patches: impl IntoIterator<Item = &'b Leaf>,
        more: u64,
        options: DecodeOptions,
    ) -> Result<Self> {
        let resolution = options.spacing(0.5 * lattice.pixel_size)?;
        let spacing = resolution / lattice.pixel_size;
        let most = |leaf: &Leaf| {
            let width = lattice.patch_width(leaf.level);
            let per_pixel = (samples(width, spacing) / f64::from(PATCH_PIXELS)).ceil();
            let layers = layers(leaf, spacing, options.as_measured);
            f64::from(leaf.patch.mask.count_ones()) * per_pixel * per_pixel * layers
        };
        let n_points = patches.into_iter().map(most).sum::<f64>() + more as f64;
        check_points(resolution, n_points, options.max_points)?;
        let widths = (0..lattice.levels).map(|level| lattice.patch_width(level));
        let grids = widths.map(|width| Grid::new(width, spacing)).collect();
        Ok(Self { lattice, grids, spacing, options, filling: Filling::default() })
    }

    /// Adds what some patches give.
    fn add<L: Borrow<Leaf> + Sync>(
        &self,
        patches: &[L],
        points: &mut Points,
        progress: &dyn Progress,
    ) -> Result<()> {
        points.extend(patches, BLOCK, progress, |patches, points| {
            patches.iter().for_each(|patch| self.leaf(patch.borrow(), points));
        })
    }

    fn layers(&self, leaf: &Leaf) -> usize {
        layers(leaf, self.spacing, self.options.as_measured) as usize
    }

    fn leaf(&self, leaf: &Leaf, points: &mut Points) {
        let grid = &self.grids[leaf.level as usize];
        let n = grid.at.len();
        let before = points.positions.len();
        for row in 0..n {
            for column in 0..n {
                let pixel = grid.pixel([column, row]);
                if leaf.patch.mask >> pixel & 1 != 0 {
                    self.sample(leaf, grid, [column, row], points);
                }
            }
        }
        if points.positions.len() == before {
            // A spacing coarser than the set pixels stepped over them all: the sample nearest to the first one.
            let pixel = leaf.patch.mask.trailing_zeros() as usize % 64;
            let side = PATCH_PIXELS as usize;
            let nearest = |p: usize| ((p * n + n / 2) / side).min(n - 1);
            let at = [nearest(pixel % side), nearest(pixel / side)];
            self.sample(leaf, grid, at, points);
        }
    }

    /// Depth of the surface of a patch at a sample, pixels.
    fn depth(&self, leaf: &Leaf, grid: &Grid, [column, row]: [usize; 2]) -> f32 {
        let (x, y) = (&grid.values[column], &grid.values[row]);
        let mut depth = 0.0;
        for (c, [i, j]) in self.shapes(leaf) {
            depth += c * x[i] * y[j];
        }
        depth
    }

    /// Its slope along columns and rows.
    fn slope(&self, leaf: &Leaf, grid: &Grid, [column, row]: [usize; 2]) -> [f32; 2] {
        let (x, y) = (&grid.values[column], &grid.values[row]);
        let (dx, dy) = (&grid.slopes[column], &grid.slopes[row]);
        let mut slope = [0.0; 2];
        for (c, [i, j]) in self.shapes(leaf) {
            slope[0] += c * dx[i] * y[j];
            slope[1] += c * x[i] * dy[j];
        }
        slope
    }

    /// The shapes of a patch: coefficients in pixels, and the degrees of the factors.
    fn shapes(&self, leaf: &Leaf) -> impl Iterator<Item = (f32, [usize; 2])> {
        let step = self.lattice.depth_step as f32 / 16.0;
        let coefficients = leaf.patch.coefficients;
        (0..N_SHAPES).filter(move |&k| coefficients[k] != 0).map(move |k| {
            let degrees = [DEGREES[k].0, DEGREES[k].1].map(usize::from);
            (coefficients[k] as f32 * step, degrees)
        })
    }

    fn sample(&self, leaf: &Leaf, grid: &Grid, sample: [usize; 2], points: &mut Points) {
        let [d, u, v] = axes_of(leaf.side);
        let depth = self.depth(leaf, grid, sample);
        let layers = self.layers(leaf);
        let half = leaf.patch.half_thickness() * self.filling.layers.stretch(layers);
        let mut position = [0.0; 3];
        position[u] = leaf.corner[0] as f32 + grid.at[sample[0]];
        position[v] = leaf.corner[1] as f32 + grid.at[sample[1]];
        let column = [u, v].map(|axis| floor_f32(position[axis]));
        let shown = self.filling.scan.map(|scan| scan.shown(leaf.side, column, depth, half));
        let before = points.positions.len();
        for layer in 0..layers {
            position[d] = depth + layer_offset(half, layer, layers);
            if shown.as_ref().is_none_or(|shown| shown.has(position[d])) {
                points.positions.push(position);
            }
        }
        if self.options.normals {
            let normal = normal(leaf.side, self.slope(leaf, grid, sample));
            points.normals.extend(std::iter::repeat_n(normal, points.positions.len() - before));
        }
    }
}

/// Where a layer lies about the middle of a thickness, from `-half` to `half`.
fn layer_offset(half: f32, layer: usize, layers: usize) -> f32 {
    if layers > 1 { half * ((2.0 * layer as f32 + 1.0) / layers as f32 - 1.0) } else { 0.0 }
}

/// Unit normal of a surface of a side whose depth has this slope along columns and rows.
fn normal(side: u8, slope: [f32; 2]) -> [f32; 3] {
    let [d, u, v] = axes_of(side);
    let length = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
    let facing = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut normal = [0.0; 3];
    normal[d] = facing / length;
    normal[u] = -facing * slope[0] / length;
    normal[v] = -facing * slope[1] / length;
    normal
}
