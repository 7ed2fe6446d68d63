//! Points that are far from all others: dust, birds, reflections, numbers that went wrong.

use surfabet_base::parallel;

use crate::cells::{around, cell_of, key, of_key};
use crate::cloud::PointCloud;
use crate::disjoint::root;
use crate::error::Result;

/// Side of the cells that points are grouped in, spacings: groups are at least this far apart. Rings of a lidar are up
/// to about twenty spacings apart. With 25 a street has 733 outliers in place of 58, with 100 it has 13.
const CELL: f64 = 50.0;

/// Most points of a group of outliers: a bird or a few reflections. What is larger may belong to the
/// scene.
const MOST_OF_GROUP: usize = 20;

/// Most outliers, one in this many points: where more are far apart, the scan is sparse. Half and double find the same on 40
/// clouds: it guards against thin clouds that have no surface.
const ONE_OF: usize = 100;

/// Points per unit of parallel work, some milliseconds; results do not depend on it.
const BATCH: usize = 1 << 16;

/// The outliers of a cloud.
pub(super) struct Outliers {
    pub all: Vec<u32>,
    /// Those that make the scene larger than it is.
    pub strays: Vec<u32>,
    /// Box of the others, world coordinates.
    pub bounds: Option<([f64; 3], [f64; 3])>,
}

impl Outliers {
    /// The outliers of a cloud of this spacing, metres.
    pub fn of(cloud: &PointCloud, spacing: f64) -> Result<Self> {
        let side = (CELL * spacing) as f32;
        let all = if side > 0.0 { far_points(cloud.positions(), side) } else { Vec::new() };
        let origin = cloud.origin();
        let world = |p: [f32; 3]| std::array::from_fn(|a| origin[a] + f64::from(p[a]));
        let bounds =
            box_without(cloud.positions(), &all).map(|(low, high)| (world(low), world(high)));
        let strays = match bounds {
            Some((low, high)) => {
                let size: f64 = (0..3).map(|a| (high[a] - low[a]).powi(2)).sum();
                let away = |p: [f64; 3]| -> f64 {
                    (0..3).map(|a| (low[a] - p[a]).max(p[a] - high[a]).max(0.0).powi(2)).sum()
                };
                all.iter().copied().filter(|&i| away(cloud.world(i as usize)) > size).collect()
            }
            None => Vec::new(),
        };
        Ok(Self { all, strays, bounds })
    }
}

/// Lower and upper corner of the box around all positions but those numbered `out`, ascending.
fn box_without(positions: &[[f32; 3]], out: &[u32]) -> Option<([f32; 3], [f32; 3])> {
    let starts = std::iter::once(0).chain(out.iter().map(|&i| i as usize + 1));
    let ends = out.iter().map(|&i| i as usize).chain(std::iter::once(positions.len()));
    let of_run = |(start, end)| box_of(&positions[start..end]);
    starts.zip(ends).filter_map(of_run).reduce(around_both)
}

/// Lower and upper corner of the box around some positions.
fn box_of(positions: &[[f32; 3]]) -> Option<([f32; 3], [f32; 3])> {
    let of_batch = |batch: &[[f32; 3]]| batch.iter().map(|&p| (p, p)).reduce(around_both);
    parallel::map_chunks(positions, BATCH, of_batch).into_iter().flatten().reduce(around_both)
}

/// The box around two boxes.
fn around_both(a: ([f32; 3], [f32; 3]), b: ([f32; 3], [f32; 3])) -> ([f32; 3], [f32; 3]) {
    (
        std::array::from_fn(|axis| a.0[axis].min(b.0[axis])),
        std::array::from_fn(|axis| a.1[axis].max(b.1[axis])),
    )
}

/// Points of groups of at most [`MOST_OF_GROUP`], groups being cells of this side that touch; none where they were more
/// than one in [`ONE_OF`].
fn far_points(positions: &[[f32; 3]], side: f32) -> Vec<u32> {
    let cell_key = |p: &[f32; 3]| key(cell_of(*p, side));
    let cells = occupied(positions, cell_key);
    let sizes = group_sizes(&cells);
    let is_small = |(_, size): &(&(u64, usize), usize)| *size <= MOST_OF_GROUP;
    // Ascending, as the cells are.
    let small: Vec<(u64, usize)> =
        cells.iter().zip(sizes).filter(is_small).map(|(cell, _)| *cell).collect();
    let n: usize = small.iter().map(|cell| cell.1).sum();
    if n == 0 || n * ONE_OF > positions.len() {
        return Vec::new();
    }
    let is_far = |p: &[f32; 3]| small.binary_search_by_key(&cell_key(p), |cell| cell.0).is_ok();
    let far = |i: usize| is_far(&positions[i]).then_some(i as u32);
    parallel::gather(positions.len(), |i, found| found.extend(far(i)))
}

/// Keys of the cells that hold points, ascending, with the number of points in each.
fn occupied(
    positions: &[[f32; 3]],
    cell_key: impl Fn(&[f32; 3]) -> u64 + Sync,
) -> Vec<(u64, usize)> {
    let cells = parallel::map_chunks(positions, BATCH, |points| {
        // Points that follow each other are mostly in one cell.
        let mut runs: Vec<(u64, usize)> = Vec::new();
        for key in points.iter().map(&cell_key) {
            match runs.last_mut() {
                Some(run) if run.0 == key => run.1 += 1,
                _ => runs.push((key, 1)),
            }
        }
        merged(runs)
    });
    merged(cells.concat())
}

/// Cells with the number of points of all of each key, ascending.
fn merged(mut cells: Vec<(u64, usize)>) -> Vec<(u64, usize)> {
    cells.sort_unstable();
    cells.dedup_by(|later, kept| {
        let is_same = later.0 == kept.0;
        kept.1 += if is_same { later.1 } else { 0 };
        is_same
    });
    cells
}

/// For each cell the number of points of its group: of all cells that one gets to by steps to cells that touch.
fn group_sizes(cells: &[(u64, usize)]) -> Vec<usize> {
    let mut parent: Vec<u32> = (0..cells.len() as u32).collect();
    for (i, &(code, _)) in (0..).zip(cells) {
        for neighbour in around(of_key(code)).map(key).filter(|&other| other > code) {
            if let Ok(j) = cells.binary_search_by_key(&neighbour, |cell| cell.0) {
                let (a, b) = (root(&mut parent, i), root(&mut parent, j as u32));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
    }
    let mut sizes = vec![0; cells.len()];
    for (i, &(_, n)) in (0..).zip(cells) {
        sizes[root(&mut parent, i) as usize] += n;
    }
    (0..cells.len() as u32).map(|i| sizes[root(&mut parent, i) as usize]).collect()
}
