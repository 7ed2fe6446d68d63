//! The map side: the surfaces of a model as samples, and what is computed from them once.

mod grid;
mod nearest;
mod pyramid;

use surfabet_geom::{PointCloud, Progress, vector};
use surfabet_models::{DecodeOptions, Error, Result, SurfaceModel};

use super::constants::{
    FACES_AXIS, FAR_MARGIN, FAR_SHARE, LEAST_CELL, MAP_DIRECTIONS, MAX_CELLS, REACH,
    SAMPLES_PER_CELL,
};
use super::directions::{Density, Directions, axes_of};
use grid::Lattice;
use nearest::Nearest;
use pyramid::{Pyramid, facing_bits};

/// Most samples of a map.
const MAX_SAMPLES: u64 = 20_000_000;

/// A model made ready to be asked where scans were taken; built once, asked often.
#[derive(Debug, Clone)]
pub struct Localizer {
    /// What positions are relative to, world coordinates, metres.
    pub(super) origin: [f64; 3],
    /// Samples of the surface, metres about the origin.
    pub(super) points: Vec<[f32; 3]>,
    /// Unit normals; zero where unknown.
    pub(super) normals: Vec<[f32; 3]>,
    /// Three orthogonal directions that most surfaces face.
    pub(super) axes: [[f32; 3]; 3],
    /// Directions that surfaces face, and how much of them.
    pub(super) directions: Directions,
    pub(super) density: Density,
    pub(super) pyramid: Pyramid,
    pub(super) nearest: Nearest,
    /// Side of a cell, metres.
    pub(super) cell: f64,
    /// Lowest and highest corner of the samples.
    pub(super) bounds: [[f32; 3]; 2],
}

impl Localizer {
    /// The surfaces of a model, of any method.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`] for a model without surface, [`Error::TooManyPoints`] for one that is too large,
    /// [`Error::Cancelled`].
    pub fn new<M: SurfaceModel>(model: &M, progress: &dyn Progress) -> Result<Self> {
        Self::of_decoded(|options| model.decode(options, progress), progress)
    }

    /// The surfaces that `decode` gives of a model.
    ///
    /// # Errors
    /// As [`Localizer::new`].
    pub fn of_decoded(
        decode: impl Fn(DecodeOptions) -> Result<PointCloud>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let decode = |resolution: f64| {
            decode(DecodeOptions {
                resolution: Some(resolution),
                normals: true,
                max_points: MAX_SAMPLES,
                ..DecodeOptions::default()
            })
        };
        let surface = decode(SAMPLES_PER_CELL * LEAST_CELL)?;
        if surface.is_empty() {
            return Err(Error::EmptyCloud);
        }
        let cell = cell_for(bounds_of(surface.positions()));
        if cell > LEAST_CELL {
            return Self::of_surface(&decode(SAMPLES_PER_CELL * cell)?, progress);
        }
        Self::of_surface(&surface, progress)
    }

    /// A surface as a cloud, sampled at 0.12 m or closer; with normals, of either sign, unless there are none.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`] for an empty cloud, [`Error::Cancelled`].
    pub fn of_surface(surface: &PointCloud, progress: &dyn Progress) -> Result<Self> {
        if surface.is_empty() {
            return Err(Error::EmptyCloud);
        }
        let bounds = bounds_of(surface.positions());
        let cell = cell_for(bounds);
        let is_inside = |p: &[f32; 3]| (0..3).all(|a| bounds[0][a] <= p[a] && p[a] <= bounds[1][a]);
        let kept: Vec<usize> =
            (0..surface.len()).filter(|&i| is_inside(&surface.positions()[i])).collect();
        let points: Vec<[f32; 3]> = kept.iter().map(|&i| surface.positions()[i]).collect();
        let normals = match surface.normals() {
            Some(normals) => kept.iter().map(|&i| normals[i]).collect(),
            None => vec![[0.0; 3]; points.len()],
        };
        let lattice = lattice_about(bounds, cell as f32);
        progress.check()?;
        let weighted: Vec<([f64; 3], f64)> = normals
            .iter()
            .filter(|&&n| n != [0.0; 3])
            .map(|n| (vector::unit(n.map(f64::from)), 1.0))
            .collect();
        let directions = Directions::of(&weighted, MAP_DIRECTIONS);
        let axes = axes_of(&directions).map(|axis| axis.map(|c| c as f32));
        progress.check()?;
        let bits = facing_bits(&normals, &axes, FACES_AXIS);
        let pyramid = Pyramid::new(lattice, &points, &bits);
        progress.check()?;
        let nearest = Nearest::new(lattice, &points);
        Ok(Self {
            origin: surface.origin(),
            points,
            normals,
            density: directions.density(),
            axes,
            directions,
            pyramid,
            nearest,
            cell,
            bounds,
        })
    }

    /// Number of samples of the surface.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Never true: a model without surface is refused.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// The box of nearly all samples: a few far ones, seen through a window or a door, would make it many times as large.
fn bounds_of(points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let mut bounds = [[0.0; 3]; 2];
    let far = (FAR_SHARE * points.len() as f64) as usize;
    for a in 0..3 {
        let mut along: Vec<f32> = points.iter().map(|p| p[a]).collect();
        let last = along.len() - 1;
        let (_, &mut low, _) = along.select_nth_unstable_by(far, f32::total_cmp);
        let (_, &mut high, _) = along.select_nth_unstable_by(last - far, f32::total_cmp);
        [bounds[0][a], bounds[1][a]] = [low - FAR_MARGIN, high + FAR_MARGIN];
        let (least, most) = along.iter().fold((high, low), |(l, h), &c| (l.min(c), h.max(c)));
        bounds[0][a] = bounds[0][a].max(least);
        bounds[1][a] = bounds[1][a].min(most);
    }
    bounds
}

/// Side of a cell: [`LEAST_CELL`], or more where there would be too many.
fn cell_for([low, high]: [[f32; 3]; 2]) -> f64 {
    let around = 2.0 * f64::from(REACH) * LEAST_CELL;
    let volume: f64 = (0..3).map(|a| f64::from(high[a]) - f64::from(low[a]) + around).product();
    (volume / MAX_CELLS).cbrt().max(LEAST_CELL)
}

/// Cells over a box, and [`REACH`] more on all sides.
fn lattice_about([low, high]: [[f32; 3]; 2], cell: f32) -> Lattice {
    let margin = REACH as f32 * cell;
    let low = low.map(|c| c - margin);
    let size = std::array::from_fn(|a| ((high[a] + margin - low[a]) / cell).ceil() as i32 + 1);
    Lattice::new(low, cell, size)
}

/// `n` of all items, evenly taken.
pub(super) fn evenly<T: Copy>(all: &[T], n: usize) -> Vec<T> {
    let n = n.min(all.len());
    (0..n).map(|i| all[(2 * i + 1) * all.len() / (2 * n)]).collect()
}
