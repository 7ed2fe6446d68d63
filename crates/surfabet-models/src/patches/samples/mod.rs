//! Points merged into samples of half a pixel in the frame of the lattice, each with the side it faces.

pub(in crate::patches) mod cells;
mod sides;

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress, Survey};

use crate::error::Result;
use crate::groups::Groups;
use crate::patches::constants::{
    NORMAL_CELL, NORMAL_CELL_IN_GAPS, NORMAL_CELL_IN_SPACINGS, SAMPLE_SIZE,
};
use crate::patches::model::Lattice;
use crate::sensor::{Sensor, to_sensor};
use cells::{CellGroups, cell_of, key};
use sides::{Neighbours, sides_of};

/// A merged sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::patches) struct Sample {
    /// Position in the frame of the lattice, metres.
    pub position: [f32; 3],
    /// Sum of the weights of its points.
    pub weight: f32,
}

/// A merged sample as it is until its side is known.
struct SeenSample {
    sample: Sample,
    /// Mean direction to the sensors, or normal; zero where unknown.
    view: [f32; 3],
}

/// Samples in the order of their cells, with the sides that they face.
pub(in crate::patches) struct SidedSamples<'a> {
    pub all: Vec<Sample>,
    /// Twice the axis that the surface is closest to being orthogonal to, plus one where it faces down that axis.
    pub sides: Vec<u8>,
    /// How many measured points each point stands for; 1 without.
    n_measured: Option<&'a [f32]>,
    /// Points of each sample.
    groups: Groups,
    /// So many of the first points lie on surface that is kept as it was.
    n_kept: usize,
}

/// How much points count.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct Weights<'a> {
    pub sensor: Sensor,
    /// What they count beside what their ranges give; 1 without.
    pub of_points: Option<&'a [f32]>,
    /// How many measured points each stands for; 1 without.
    pub n_measured: Option<&'a [f32]>,
}

impl Weights<'_> {
    /// What the ranges give alone.
    pub fn of(sensor: Sensor) -> Self {
        Self { sensor, of_points: None, n_measured: None }
    }

    /// Weight of point `i` of `cloud`.
    fn at(&self, cloud: &PointCloud, i: usize) -> f32 {
        let own = self.of_points.map_or(1.0, |weights| weights[i]);
        own * self.sensor.weight_of(cloud, i)
    }
}

/// Rows of the rotation from the world to the lattice.
pub(in crate::patches) fn rows_of(lattice: &Lattice) -> [[f32; 3]; 3] {
    let to_world = lattice.orientation.rotation();
    std::array::from_fn(|a| std::array::from_fn(|k| to_world[k][a] as f32))
}

/// A direction or position in the frame of the lattice: `rows` are the rows of the rotation from the world.
pub(in crate::patches) fn rotate(rows: &[[f32; 3]; 3], p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|a| rows[a][0] * p[0] + rows[a][1] * p[1] + rows[a][2] * p[2])
}

impl<'a> SidedSamples<'a> {
    /// Merges the points of `cloud`, of which the survey is known.
    pub fn merge(
        cloud: &PointCloud,
        lattice: &Lattice,
        weights: Weights<'a>,
        survey: &Survey,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let resolution = lattice.pixel_size;
        let rows = rows_of(lattice);
        let cell = (SAMPLE_SIZE * resolution) as f32;
        let positions = cloud.positions();
        let cells =
            CellGroups::new(cloud.len(), |i| key(cell_of(rotate(&rows, positions[i]), cell)));
        progress.check()?;
        let layer_gap = survey.layer_gap;
        let of_cloud = cloud.normals().filter(|_| survey.has_facings && layer_gap.is_some());
        let normals = of_cloud.filter(|_| cloud.viewpoints().is_none());
        let view = |i: usize| normals.map_or_else(|| to_sensor(cloud, i), |n| n[i]);
        let groups = cells.into_groups();
        let samples: Vec<SeenSample> = parallel::map_range(groups.len(), |g| {
            merge_cell(cloud, &rows, weights, &view, groups.of(g))
        });
        progress.check()?;
        let neighbours = match (layer_gap, normals) {
            (Some(_), Some(_)) => Neighbours::Normals,
            (gap, _) => {
                let of_gap = NORMAL_CELL_IN_GAPS * gap.unwrap_or(0.0) as f32;
                let of_spacing = NORMAL_CELL_IN_SPACINGS * survey.spacing as f32;
                Neighbours::Cells((NORMAL_CELL * resolution as f32).max(of_gap).max(of_spacing))
            }
        };
        let has_views = cloud.viewpoints().is_some() || normals.is_some();
        let sides = sides_of(&samples, neighbours, has_views, progress)?;
        progress.check()?;
        // Into memory of its own: that of the views is to be free.
        let all = samples.iter().map(|seen| seen.sample).collect();
        Ok(Self { all, sides, n_measured: weights.n_measured, groups, n_kept: 0 })
    }

    /// With so many of the first points on surface that is kept as it was, and is not to be found again.
    pub fn with_kept(self, n_kept: usize) -> Self {
        Self { n_kept, ..self }
    }

    /// Those that are kept, without their points.
    pub fn only(&self, kept: &[bool]) -> Self {
        let of = |i: &usize| kept[*i];
        let all = (0..kept.len()).filter(of).map(|i| self.all[i]).collect();
        let sides = (0..kept.len()).filter(of).map(|i| self.sides[i]).collect();
        let groups = Groups::with_capacity(0, 0);
        Self { all, sides, n_measured: self.n_measured, groups, n_kept: 0 }
    }

    /// True for a sample of such points alone.
    pub fn is_kept(&self, sample: usize) -> bool {
        self.n_kept > 0 && self.groups.of(sample).iter().all(|&i| (i as usize) < self.n_kept)
    }

    /// The points of each sample.
    pub fn points(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.groups.len()).map(|sample| self.points_of(sample))
    }

    /// The points of one sample.
    pub fn points_of(&self, sample: usize) -> &[u32] {
        self.groups.of(sample)
    }

    /// Mean of `value` over the points that were measured in each sample; points without finite values are left out, samples without
    /// any other have none. Ranges do not count: a colour that is seen from afar is no less certain, and all points are to be met alike.
    pub fn means<const N: usize>(
        &self,
        value: impl Fn(usize) -> [f64; N] + Sync,
    ) -> Vec<Option<[f32; N]>> {
        let mean = |sample: usize| {
            let (mut sum, mut weights) = ([0.0_f64; N], 0.0_f64);
            for i in self.groups.of(sample).iter().map(|&i| i as usize) {
                let value = value(i);
                if value.iter().all(|c| c.is_finite()) {
                    let weight = self.n_measured.map_or(1.0, |all| f64::from(all[i]));
                    weights += weight;
                    (0..N).for_each(|c| sum[c] += weight * value[c]);
                }
            }
            (weights > 0.0).then(|| sum.map(|s| (s / weights) as f32))
        };
        parallel::map_range(self.groups.len(), mean)
    }
}

/// The sample of the `points` of one cell: weighted means of position and direction to the sensors.
fn merge_cell(
    cloud: &PointCloud,
    rows: &[[f32; 3]; 3],
    weights_of: Weights<'_>,
    view_of: &(impl Fn(usize) -> [f32; 3] + Sync),
    points: &[u32],
) -> SeenSample {
    let mut weights = 0.0_f64;
    let (mut position, mut view) = ([0.0_f64; 3], [0.0_f64; 3]);
    for &i in points {
        let i = i as usize;
        let weight = f64::from(weights_of.at(cloud, i));
        weights += weight;
        let rotated = rotate(rows, cloud.positions()[i]);
        (0..3).for_each(|a| position[a] += weight * f64::from(rotated[a]));
        let direction = view_of(i);
        (0..3).for_each(|a| view[a] += weight * f64::from(direction[a]));
    }
    let mean = |sum: [f64; 3]| sum.map(|s| (s / weights) as f32);
    let sample = Sample { position: mean(position), weight: weights as f32 };
    SeenSample { sample, view: rotate(rows, mean(view)) }
}
