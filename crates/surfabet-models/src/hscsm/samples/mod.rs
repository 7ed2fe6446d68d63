//! Points merged into samples of half a pixel: the sub-sampled cloud P' of section III-A.
//!
//! A sample keeps what pixels need: the weighted mean of position and colour, the total weight, the mean
//! direction to the sensors that saw it, and second moments, so that the standard deviation of a pixel is that
//! of the points and not that of their means. Cells are the nodes of one octree: those of a coarser level of
//! the hierarchy are made of those of the finest.

pub(in crate::hscsm) mod cells;

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f64;
use surfabet_geom::morton::{self, BITS};
use surfabet_geom::{PointCloud, Progress};

use crate::error::Result;
use crate::groups::Groups;
use crate::hscsm::constants::SAMPLE_SIZE;
use crate::hscsm::intensity::Shades;
use crate::hscsm::options::HscsmOptions;
use crate::sensor::to_sensor;
use crate::vector::{dot, minus, unit};

/// Cells that one task merges.
const BLOCK: usize = 1 << 12;

/// Merged points.
#[derive(Debug, Clone, Copy)]
pub(in crate::hscsm) struct Sample {
    /// Morton code of the cell.
    pub key: u64,
    /// Weighted mean position relative to the cloud's origin, metres.
    pub position: [f32; 3],
    /// Weighted covariance of the points' positions: xx, xy, xz, yy, yz, zz, square metres.
    pub covariance: [f32; 6],
    /// Sum of the points' weights.
    pub weight: f32,
    /// Weighted mean colour, 0 to 255, or grey of the intensities; zero without both.
    pub color: [f32; 3],
    /// Weighted variance of the points' colours, mean of the three channels.
    pub color_variance: f32,
    /// Unit direction towards the sensors, weighted mean; zero where unknown or where they cancel out.
    pub view: [f32; 3],
}

/// Samples in the Morton order of their cells.
#[derive(Debug, Clone, Default)]
pub(in crate::hscsm) struct Samples {
    pub all: Vec<Sample>,
    /// Side of a cell, metres.
    pub cell: f32,
    /// Halvings from the finest cells to these, so that keys have `3 * (21 - halvings)` bits.
    pub halvings: u32,
    /// True with colours, or grey of intensities.
    pub has_color: bool,
    pub has_views: bool,
}

/// The lattice that cells of one side lie on, and its Morton codes.
#[derive(Debug, Clone, Copy)]
pub(in crate::hscsm) struct CellLattice {
    cell: f32,
    halvings: u32,
}

impl CellLattice {
    /// Coordinates of the cell of `point`, never negative: half the range is added. Outside of the lattice they
    /// are those of its rim; [`learn`](super::learn) checks a cloud's extent before.
    pub fn coordinates(self, point: [f32; 3]) -> [u64; 3] {
        point.map(|c| {
            let index = floor_f64(f64::from(c / self.cell)) + ((1 << (BITS - 1)) >> self.halvings);
            index.clamp(0, ((1 << BITS) - 1) >> self.halvings) as u64
        })
    }

    /// Morton code of the cell of `point`.
    pub fn key(self, point: [f32; 3]) -> u64 {
        morton::encode(self.coordinates(point))
    }
}

/// CellSums over the points of a cell, positions about the first of them.
#[derive(Default)]
struct CellSums {
    base: Option<[f32; 3]>,
    weight: f64,
    offset: [f64; 3],
    product: [f64; 6],
    color: [f64; 3],
    /// Mean over the channels of the squared colour.
    color_square: f64,
    view: [f64; 3],
}

/// Products of the coordinates: xx, xy, xz, yy, yz, zz.
fn outer([x, y, z]: [f64; 3]) -> [f64; 6] {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

/// Mean of the squared coordinates.
fn mean_square(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / 3.0
}

impl CellSums {
    /// Adds a point or a sample of smaller cells, whose own variances count.
    fn add(&mut self, s: &Sample) {
        let base = *self.base.get_or_insert(s.position);
        let w = f64::from(s.weight);
        let offset: [f64; 3] =
            std::array::from_fn(|a| f64::from(s.position[a]) - f64::from(base[a]));
        let color = s.color.map(f64::from);
        let square = outer(offset);
        self.weight += w;
        for a in 0..3 {
            self.offset[a] += w * offset[a];
            self.color[a] += w * color[a];
            self.view[a] += w * f64::from(s.view[a]);
        }
        for (i, p) in self.product.iter_mut().enumerate() {
            *p += w * (square[i] + f64::from(s.covariance[i]));
        }
        self.color_square += w * (mean_square(color) + f64::from(s.color_variance));
    }

    /// The sample of the sums: means, and variances as mean squares less squared means.
    fn sample(&self, key: u64) -> Sample {
        let mean = |sum: [f64; 3]| sum.map(|s| s / self.weight);
        let (offset, color) = (mean(self.offset), mean(self.color));
        let base = self.base.unwrap_or_default();
        let square = outer(offset);
        Sample {
            key,
            position: std::array::from_fn(|a| (f64::from(base[a]) + offset[a]) as f32),
            covariance: std::array::from_fn(|i| (self.product[i] / self.weight - square[i]) as f32),
            weight: self.weight as f32,
            color: color.map(|c| c as f32),
            color_variance: (self.color_square / self.weight - mean_square(color)).max(0.0) as f32,
            view: unit(mean(self.view).map(|c| c as f32)),
        }
    }
}

/// Merges the samples of a cell: those seen from one side, and those seen from the other side if there are any,
/// so that the faces of a wall thinner than a cell stay apart. `mark` is called with true for each sample that joined the second, with false for the others.
fn merge_cell(
    key: u64,
    samples: impl Iterator<Item = Sample>,
    mut mark: impl FnMut(bool),
) -> [Option<Sample>; 2] {
    let mut sides = [CellSums::default(), CellSums::default()];
    let mut reference = [0.0; 3];
    for s in samples {
        if reference == [0.0; 3] {
            reference = s.view;
        }
        let behind = dot(reference, s.view) < 0.0;
        mark(behind);
        sides[usize::from(behind)].add(&s);
    }
    sides.map(|side| side.base.is_some().then(|| side.sample(key)))
}

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// The lattice of cells whose side is that of these samples' times two to the power of `doublings`.
    pub fn lattice(&self, doublings: u32) -> CellLattice {
        CellLattice {
            cell: self.cell * (1_u32 << doublings) as f32,
            halvings: self.halvings + doublings,
        }
    }

    /// Merges the points of `cloud`, whose colours are `shades`, each weighted by what its sensor's depth error makes of its range.
    ///
    /// The cloud must span less than 2^21 cells; [`learn`](super::learn) checks its extent before.
    pub fn merge(
        cloud: &PointCloud,
        shades: &Shades<'_>,
        options: &HscsmOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut merged = Self {
            all: Vec::new(),
            cell: (SAMPLE_SIZE * options.resolution()) as f32,
            halvings: 0,
            has_color: shades.are_there(),
            has_views: cloud.viewpoints().is_some(),
        };
        let lattice = merged.lattice(0);
        let positions = cloud.positions();
        let mut order: Vec<(u64, u32)> =
            parallel::map_range(positions.len(), |i| (lattice.key(positions[i]), i as u32));
        progress.check()?;
        parallel::sort_keyed(&mut order);
        progress.check()?;
        let point = |i: u32| {
            let i = i as usize;
            Sample {
                key: 0,
                position: positions[i],
                covariance: [0.0; 6],
                weight: weight(cloud, options, i),
                color: shades.of_point(i),
                color_variance: 0.0,
                view: to_sensor(cloud, i),
            }
        };
        let starts = starts(order.len(), |i| order[i].0);
        let blocks = for_blocks(&starts, |cells| {
            let mut out = Vec::with_capacity(cells.len());
            for cell in cells.windows(2) {
                let members = &order[cell[0] as usize..cell[1] as usize];
                let points = members.iter().map(|&(_, i)| point(i));
                out.extend(merge_cell(members[0].0, points, |_| ()).into_iter().flatten());
            }
            out
        });
        progress.check()?;
        merged.all = blocks.concat();
        Ok(merged)
    }

    /// Samples of cells whose side is that of these times two to the power of `doublings`, and which of these
    /// each was made of.
    pub fn coarser(&self, doublings: u32) -> (Self, Groups) {
        let key = |i: usize| self.all[i].key >> (3 * doublings);
        let starts = starts(self.len(), key);
        let blocks = for_blocks(&starts, |cells| {
            let (mut out, mut sizes, mut members) = (Vec::new(), Vec::new(), Vec::new());
            let mut behind = Vec::new();
            for cell in cells.windows(2) {
                let (from, to) = (cell[0], cell[1]);
                let samples = self.all[from as usize..to as usize].iter().copied();
                behind.clear();
                let sides = merge_cell(key(from as usize), samples, |b| behind.push(b));
                for (side, sample) in [false, true].into_iter().zip(sides) {
                    let Some(sample) = sample else { continue };
                    let before = members.len();
                    members.extend((from..to).zip(&behind).filter(|m| *m.1 == side).map(|m| m.0));
                    sizes.push(members.len() - before);
                    out.push(sample);
                }
            }
            (out, sizes, members)
        });
        let n_samples = blocks.iter().map(|(samples, ..)| samples.len()).sum();
        let mut groups = Groups::with_capacity(n_samples, self.len());
        let mut all = Vec::with_capacity(n_samples);
        for (samples, sizes, members) in blocks {
            all.extend(samples);
            groups.extend(sizes, members);
        }
        let CellLattice { cell, halvings } = self.lattice(doublings);
        (Self { all, cell, halvings, ..*self }, groups)
    }
}

/// Weight of point `i` of `cloud`, from its range or else from its distance to where it was seen from; 1 where both are
/// unknown.
fn weight(cloud: &PointCloud, options: &HscsmOptions, i: usize) -> f32 {
    match cloud.local_viewpoint(i) {
        Some(seen_from) if cloud.ranges().is_none() => {
            let ray = minus(seen_from, cloud.positions()[i]);
            options.sensor.weight(dot(ray, ray).sqrt())
        }
        _ => options.sensor.weight_of(cloud, i),
    }
}

/// What `f` gives of each [`BLOCK`] of the runs that begin at `starts`, in order; it gets where they start and, last, end.
fn for_blocks<R: Send>(starts: &[u32], f: impl Fn(&[u32]) -> R + Sync) -> Vec<R> {
    let n_runs = starts.len().saturating_sub(1);
    parallel::map_range(n_runs.div_ceil(BLOCK), |block| {
        f(&starts[block * BLOCK..=n_runs.min((block + 1) * BLOCK)])
    })
}

/// Where runs of equal keys start, and the end of the last.
fn starts(count: usize, key: impl Fn(usize) -> u64 + Sync) -> Vec<u32> {
    let mut starts: Vec<u32> = parallel::gather(count, |i, starts| {
        if i == 0 || key(i - 1) != key(i) {
            starts.push(i as u32);
        }
    });
    starts.push(count as u32);
    starts
}
