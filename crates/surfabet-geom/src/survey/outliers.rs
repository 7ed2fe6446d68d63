//! Points that are far from all others: dust, birds, reflections, numbers that went wrong.

use std::collections::HashSet;

use rayon::prelude::*;
use surfabet_base::parallel;

use crate::cells::{around, cell_of, key, of_key};
use crate::cloud::PointCloud;
use crate::disjoint::root;
use crate::error::Result;

/// Side of the cells that points are grouped in, spacings: groups are at least this far apart. Rings of a lidar are up
/// to about twenty spacings apart.
const CELL: f64 = 50.0;

/// Most points of a group of outliers: a bird or a few reflections. Of what is larger nobody knows that it is none of the
/// scene.
const MOST_OF_GROUP: usize = 20;

/// Most outliers, one in this many points: where more are far apart, the scan is sparse.
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
        let is_all: HashSet<u32> = all.iter().copied().collect();
        let others = (0..cloud.len()).filter(|&i| !is_all.contains(&(i as u32)));
        let bounds = box_of(others.map(|i| cloud.world(i)));
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

/// Lower and upper corner of the box around some points.
fn box_of(mut points: impl Iterator<Item = [f64; 3]>) -> Option<([f64; 3], [f64; 3])> {
    let first = points.next()?;
    Some(points.fold((first, first), |(low, high), p| {
        (std::array::from_fn(|a| low[a].min(p[a])), std::array::from_fn(|a| high[a].max(p[a])))
    }))
}

/// Points of groups of at most [`MOST_OF_GROUP`], groups being cells of this side that touch; none where they were more
/// than one in [`ONE_OF`].
fn far_points(positions: &[[f32; 3]], side: f32) -> Vec<u32> {
    let cell_key = |p: &[f32; 3]| key(cell_of(*p, side));
    let cells = occupied(positions, cell_key);
    let sizes = group_sizes(&cells);
    let small: HashSet<u64> = (cells.iter().zip(sizes))
        .filter(|(_, size)| *size <= MOST_OF_GROUP)
        .map(|(cell, _)| cell.0)
        .collect();
    let n: usize = cells.iter().filter(|cell| small.contains(&cell.0)).map(|cell| cell.1).sum();
    if n == 0 || n * ONE_OF > positions.len() {
        return Vec::new();
    }
    let far = |i: usize| small.contains(&cell_key(&positions[i])).then_some(i as u32);
    parallel::gather(positions.len(), |i, found| found.extend(far(i)))
}

/// Keys of the cells that hold points, ascending, with the number of points in each.
fn occupied(
    positions: &[[f32; 3]],
    cell_key: impl Fn(&[f32; 3]) -> u64 + Sync,
) -> Vec<(u64, usize)> {
    let mut cells: Vec<(u64, usize)> = parallel::map_chunks(positions, BATCH, |points| {
        let mut keys: Vec<u64> = points.iter().map(&cell_key).collect();
        keys.sort_unstable();
        keys.chunk_by(|a, b| a == b).map(|run| (run[0], run.len())).collect::<Vec<_>>()
    })
    .concat();
    cells.par_sort_unstable();
    cells
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| (run[0].0, run.iter().map(|cell| cell.1).sum()))
        .collect()
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
