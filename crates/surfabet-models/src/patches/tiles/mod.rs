//! A scene in tiles: cubes of the lattice, each learned from the points around it alone, which decode together as one model.
//!
//! What tiles share is fixed before ([`TilePlan`]): the lattice, what was measured of the scene, and what follows from both.
//! A tile is learned from its own points and those within [`TilePlan::margin`] of it. Everything that the surface of a
//! place follows from lies within that margin, so that two tiles see the same sheets at their border, to the bit. A sheet
//! belongs to one tile: along its columns and rows to that which its square lies in, along its depth to that in which the
//! depth of its middle run lies. So a surface goes on across a border as it does between two squares inside of a tile.
//!
//! | file | what |
//! |---|---|
//! | `plan` | what all tiles share, from a sample of the scene |
//! | `bounds` | the box that a tile decodes to |
//! | `kept` | sheets that stay as they are when a tile is learned again |
//! | `details` | coarser models of the same tiles |
//! | `recipe` | what a map remembers, so that a tile can be learned again |
//! | `views` | how the sides of surfaces are known, and points that carry it |

mod bounds;
mod details;
mod kept;
mod plan;
mod recipe;
mod views;

use crate::patches::constants::{MARGIN_PIXELS, MARGIN_SQUARES};
use std::borrow::Cow;
use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, PointCloud, Progress, cells};

use super::attributes::borders::Border;
use super::learn::{Ground, STAGES, check_size, on_lattice};
use super::model::{Lattice, PatchModel};
use super::options::PatchesOptions;
use super::samples::{rotate, rows_of};
use super::sheets::{Run, Sheet, axes_of};
use crate::error::{Error, Result};
use crate::extent::reach;
use crate::options::Options;
use crate::stages::Stages;
pub(super) use bounds::ROUNDING;
pub use details::{MAX_DETAILS, learn_details};
pub use kept::{KeptSheets, Known};
pub use plan::{AttributeRange, TilePlan, plan};
pub use recipe::Recipe;
pub use views::Views;

/// Points that one task sorts by cubes.
const BLOCK: usize = 1 << 14;

/// Cubes of a lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cubes {
    /// Side, finest pixels; a whole number of squares of the coarsest level.
    pub side: i32,
    /// Lowest corner of cube (0, 0, 0), finest pixels; also whole squares.
    pub offset: [i32; 3],
}

impl Cubes {
    /// The cube that a finest pixel lies in.
    pub fn of(self, pixel: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|a| (pixel[a] - self.offset[a]).div_euclid(self.side))
    }

    /// Lowest corner of a cube, finest pixels.
    pub fn corner(self, cube: [i32; 3]) -> [i64; 3] {
        let at = |a: usize| i64::from(cube[a]) * i64::from(self.side) + i64::from(self.offset[a]);
        std::array::from_fn(at)
    }

    /// A cube as cells of attributes, each a finest pixel.
    pub fn border(self, cube: [i32; 3]) -> Border {
        Border { low: self.corner(cube), side: i64::from(self.side) }
    }
}

/// One of the cubes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    pub cubes: Cubes,
    pub cube: [i32; 3],
    /// Whether colours and scalars are corrected at its borders.
    pub corrected: bool,
    /// Whether they are coded with estimates.
    pub estimated: bool,
}

impl Tile {
    /// The cube, where colours and scalars are corrected at its borders.
    pub fn border(self) -> Option<Border> {
        self.corrected.then(|| self.cubes.border(self.cube))
    }

    /// Finest pixels from the tile to a pixel, along the axis where these are most; 0 inside.
    fn distance(self, pixel: [i32; 3]) -> i64 {
        let corner = self.cubes.corner(self.cube);
        let along = |a: usize| {
            let from = i64::from(pixel[a]) - corner[a];
            (-from).max(from - i64::from(self.cubes.side) + 1).max(0)
        };
        (0..3).map(along).fold(0, i64::max)
    }

    /// Positions of the points that lie in the tile.
    pub fn own(self, cloud: &PointCloud, lattice: &Lattice) -> Vec<[f32; 3]> {
        let pixel = PixelOf::new(lattice);
        let of_blocks = parallel::map_chunks(cloud.positions(), BLOCK, |points| {
            let own = points.iter().filter(|&&p| self.cubes.of(pixel.of(p)) == self.cube);
            own.copied().collect::<Vec<_>>()
        });
        of_blocks.concat()
    }

    /// Numbers of the points within `margin` finest pixels of the tile.
    fn around(self, cloud: &PointCloud, lattice: &Lattice, margin: i32) -> Vec<usize> {
        let pixel = PixelOf::new(lattice);
        let positions = cloud.positions();
        parallel::gather(positions.len(), |i, near| {
            if self.distance(pixel.of(positions[i])) <= i64::from(margin) {
                near.push(i);
            }
        })
    }

    /// True where any point lies in the tile.
    fn holds_any(self, cloud: &PointCloud, lattice: &Lattice) -> bool {
        let pixel = PixelOf::new(lattice);
        cloud.positions().iter().any(|&p| self.cubes.of(pixel.of(p)) == self.cube)
    }
}

/// Finest pixels of points, in the arithmetic by which these are merged.
struct PixelOf {
    rows: [[f32; 3]; 3],
    /// Side of the cells that points are merged in, metres: half a pixel.
    cell: f32,
}

impl PixelOf {
    fn new(lattice: &Lattice) -> Self {
        Self { rows: rows_of(lattice), cell: (0.5 * lattice.pixel_size) as f32 }
    }

    fn of(&self, position: [f32; 3]) -> [i32; 3] {
        cells::cell_of(rotate(&self.rows, position), self.cell).map(|c| c >> 1)
    }
}

impl TilePlan {
    /// The cubes that points of a cloud about the origin of the lattice lie in, each with their number.
    pub fn cubes_of(&self, cloud: &PointCloud) -> BTreeMap<[i32; 3], u64> {
        let pixel = PixelOf::new(&self.lattice);
        let of_blocks = parallel::map_chunks(cloud.positions(), BLOCK, |points| {
            let mut counts = BTreeMap::new();
            for &p in points {
                *counts.entry(self.cubes.of(pixel.of(p))).or_insert(0) += 1;
            }
            counts
        });
        let mut all = BTreeMap::new();
        for (cube, n) in of_blocks.into_iter().flatten() {
            *all.entry(cube).or_insert(0) += n;
        }
        all
    }

    /// A cloud as tiles are learned from it when their scans are no longer there: about the origin of the lattice, with what
    /// gives the sides of surfaces and without ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a cloud that does not fit the lattice, and for one that does not know the sides of its
    /// surfaces where the map does.
    pub fn prepared(&self, cloud: &PointCloud) -> Result<PointCloud> {
        let mut parts = about(cloud, self.lattice.origin)?.into_parts();
        parts.ranges = None;
        let cloud = PointCloud::from_parts(parts).map_err(Error::from)?.0;
        check_size(reach(&cloud)?, self.lattice.pixel_size)?;
        self.views.unified(&cloud)
    }
}

/// Sheets by what they are to a tile.
pub(super) struct Shares {
    /// Those that belong to it.
    pub own: Vec<Sheet>,
    /// Those next to it, which may be what its points lie on.
    pub near: Vec<Sheet>,
}

impl Shares {
    /// All sheets, of which those of `tile` are its own; without one all are.
    pub fn of(sheets: Vec<Sheet>, tile: Option<Tile>, lattice: &Lattice) -> Self {
        let Some(tile) = tile else { return Self { own: sheets, near: Vec::new() } };
        let (mut own, mut near) = (Vec::new(), Vec::new());
        for sheet in sheets {
            let place = place(&sheet, lattice.tile_pixels());
            if tile.cubes.of(place) == tile.cube {
                own.push(sheet);
            } else if tile.distance(place) <= i64::from(lattice.tile_pixels()) {
                near.push(sheet);
            }
        }
        Self { own, near }
    }
}

/// The finest pixel that decides which tile a sheet belongs to: the first one of its square, at the depth of that run which is
/// nearest to the mean depth.
fn place(sheet: &Sheet, tile_pixels: i32) -> [i32; 3] {
    let [d, u, v] = axes_of(sheet.side);
    let depths = || sheet.runs.iter().map(|run: &Run| f64::from(run.depth));
    let mean = depths().sum::<f64>() / sheet.runs.len().max(1) as f64;
    let nearest = depths().min_by(|a, b| (a - mean).abs().total_cmp(&(b - mean).abs()));
    let mut place = [0; 3];
    place[d] = nearest.unwrap_or(mean).floor() as i32;
    place[u] = sheet.tile[0] * tile_pixels;
    place[v] = sheet.tile[1] * tile_pixels;
    place
}

/// A tile to learn: all that it depends on.
#[derive(Debug, Clone, Copy)]
pub struct TileTask<'a> {
    /// Points among which are all within [`TilePlan::margin`] of the cube, in their order. Those further away make no difference.
    pub cloud: &'a PointCloud,
    /// What is known beside the points.
    pub known: Known<'a>,
    /// The cube of the plan.
    pub cube: [i32; 3],
    /// What all tiles share.
    pub plan: &'a TilePlan,
    /// How tiles are learned.
    pub options: &'a PatchesOptions,
}

/// Learns a tile; `None` where no point lies in its cube.
///
/// # Errors
/// As [`super::learn`]; [`Error::Inconsistent`] for a plan that no scene has, and for weights of other points.
pub fn learn_tile(task: &TileTask<'_>, progress: &dyn Progress) -> Result<Option<PatchModel>> {
    let TileTask { cloud, known, cube, plan, options } = *task;
    options.check()?;
    plan.check()?;
    for weights in [known.weights, known.n_measured].into_iter().flatten() {
        if weights.len() != cloud.len() {
            let what = format!("{} weights of {} points", weights.len(), cloud.len());
            return Err(Error::Inconsistent(what));
        }
    }
    let (corrected, estimated) = (plan.corrected, plan.estimated);
    let tile = Tile { cubes: plan.cubes, cube, corrected, estimated };
    let mut cloud = match cloud.origin() == plan.lattice.origin {
        true => Cow::Borrowed(cloud),
        false => Cow::Owned(about(cloud, plan.lattice.origin)?),
    };
    let near = tile.around(&cloud, &plan.lattice, plan.margin_pixels());
    let of_near = |all: &[f32]| near.iter().map(|&i| all[i]).collect::<Vec<f32>>();
    let (weights, n_measured) = (known.weights.map(of_near), known.n_measured.map(of_near));
    let n_kept = near.partition_point(|&i| i < known.n_kept);
    if near.len() < cloud.len() {
        cloud = Cow::Owned(cloud.select(&near)?);
    }
    drop(near);
    progress.check()?;
    if !tile.holds_any(&cloud, &plan.lattice) {
        return Ok(None);
    }
    let ground = Ground {
        lattice: plan.lattice,
        survey: &plan.survey,
        tolerance: plan.tolerance,
        density: Some(plan.density),
        attributes: &plan.attributes,
        tile: Some(tile),
        weights: weights.as_deref(),
        n_measured: n_measured.as_deref(),
        kept: (known.sheets, n_kept),
    };
    let mut stages = Stages::new(STAGES, progress);
    let (model, mut report) = on_lattice(&ground, &cloud, options, &mut stages)?;
    report.stages = stages.finish();
    report.survey = plan.survey.clone();
    report.tolerance = plan.tolerance;
    Ok(Some(model.with_report(report)))
}

/// The cloud with positions about `origin`.
fn about(cloud: &PointCloud, origin: [f64; 3]) -> Result<PointCloud> {
    if cloud.origin() == origin {
        return Ok(cloud.clone());
    }
    let positions = cloud.positions_about(origin);
    let parts = CloudParts { origin, positions, ..cloud.clone().into_parts() };
    Ok(PointCloud::from_parts(parts).map_err(Error::from)?.0)
}
