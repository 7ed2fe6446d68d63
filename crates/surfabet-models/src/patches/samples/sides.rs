//! The side that each sample faces: one of three axes, up or down.
//!
//! Planes are fitted in cells. A cell takes the axis that its normal is closest to, with a small pull towards the
//! axes of its neighbours, and its samples the direction that they were seen from.

use surfabet_base::parallel;
use surfabet_geom::{KdTree, Moments, Progress};

use super::SeenSample;
use super::cells::{CellGroups, cell_of, key};
use crate::error::Result;
use crate::groups::Groups;
use crate::patches::constants::{
    LINE_WEIGHT, NEAREST_SAMPLES, NEIGHBOUR_PULL, SIDE_AGREEMENT, SIDE_ROUNDS,
};
use crate::vector::{dot, unit};

/// Cells per unit of parallel work, some milliseconds; results do not depend on it.
const BATCH: usize = 1 << 12;

/// The plane about a cell of samples.
struct CellPlane {
    normal: [f32; 3],
    /// 1 for a plane, towards 0 for a ball: how much the normal counts.
    flatness: f32,
}

/// The planes about all cells of samples.
struct CellPlanes {
    of_cells: Vec<CellPlane>,
    /// Each cell and its neighbours, as far as they hold samples.
    around: Groups,
}

impl CellPlane {
    /// How well the plane is orthogonal to an axis: the squared cosine of its normal, times its flatness.
    fn fit(&self, axis: usize) -> f32 {
        self.normal[axis] * self.normal[axis] * self.flatness
    }
}

/// What the planes are fitted to that sides follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Neighbours {
    /// Cells of this side with the 26 around each, metres.
    Cells(f32),
    /// The few samples nearest to each, for its axis to agree with theirs: the views of the samples are normals.
    Normals,
}

/// Side of every sample, from the plane about it. Without views all face up their axes.
pub(super) fn sides_of(
    samples: &[SeenSample],
    neighbours: Neighbours,
    has_views: bool,
    progress: &dyn Progress,
) -> Result<Vec<u8>> {
    let (cells, planes) = match neighbours {
        Neighbours::Cells(side) => {
            let cells =
                CellGroups::new(samples.len(), |i| key(cell_of(samples[i].sample.position, side)));
            let planes = fit_planes(samples, &cells, side);
            (cells, planes)
        }
        // Each sample is a cell of its own.
        Neighbours::Normals => {
            let cells = CellGroups::new(samples.len(), |i| i as u64);
            (cells, planes_about(samples, progress)?)
        }
    };
    let axes = choose_axes(&planes);
    let planes = planes.of_cells;
    let of_cells: Vec<Vec<u8>> = parallel::map_range(cells.len(), |g| {
        let members = cells.of(g).iter().map(|&i| &samples[i as usize]);
        sides_of_cell(members, axes[g], planes[g].normal, has_views)
    });
    let mut sides = vec![0_u8; samples.len()];
    for (g, of) in of_cells.into_iter().enumerate() {
        for (&i, side) in cells.of(g).iter().zip(of) {
            sides[i as usize] = side;
        }
    }
    Ok(sides)
}

/// The plane about every sample: by its normal, or of the samples nearest to it where it has none.
fn planes_about(samples: &[SeenSample], progress: &dyn Progress) -> Result<CellPlanes> {
    let positions: Vec<[f32; 3]> = samples.iter().map(|s| s.sample.position).collect();
    let tree = KdTree::new(&positions)?;
    let near = tree.k_nearest_batch(&positions, NEAREST_SAMPLES, progress)?;
    let row = NEAREST_SAMPLES.min(samples.len());
    let plane = |i: usize| {
        let sample = &samples[i];
        let (normal, flatness) = if sample.view != [0.0; 3] {
            (unit(sample.view), 1.0)
        } else {
            let points = near[i * row..(i + 1) * row].iter().map(|n| positions[n.index()]);
            normal_of(&Moments::about(sample.sample.position, points))
        };
        CellPlane { normal, flatness }
    };
    let of_cells = parallel::map_range(samples.len(), plane);
    let mut around = Groups::with_capacity(samples.len(), near.len());
    around.extend(samples.iter().map(|_| row), near.iter().map(|n| n.index() as u32));
    Ok(CellPlanes { of_cells, around })
}

/// The least-squares plane of every cell with its 26 neighbours.
fn fit_planes(samples: &[SeenSample], cells: &CellGroups, side: f32) -> CellPlanes {
    let position = |i: u32| samples[i as usize].sample.position;
    let near = neighbours(cells, |g| cell_of(position(cells.of(g)[0]), side));
    let moments: Vec<Moments> = parallel::map_range(cells.len(), |g| {
        let members = cells.of(g);
        Moments::about(position(members[0]), members.iter().map(|&i| position(i)))
    });
    let of_cells = parallel::map_range(cells.len(), |g| {
        let mut sum = Moments::new();
        near.of(g).iter().for_each(|&near| sum.merge(&moments[near as usize]));
        let (normal, flatness) = normal_of(&sum);
        CellPlane { normal, flatness }
    });
    CellPlanes { of_cells, around: near }
}

/// Each cell and its 26 neighbours, as far as they hold samples; `place` gives the coordinates of a cell.
fn neighbours(cells: &CellGroups, place: impl Fn(usize) -> [i32; 3] + Sync) -> Groups {
    let numbers: Vec<u32> = (0..cells.len() as u32).collect();
    let of_batches: Vec<(Vec<usize>, Vec<u32>)> = parallel::map_chunks(&numbers, BATCH, |batch| {
        let (mut sizes, mut near) = (Vec::with_capacity(batch.len()), Vec::new());
        // Keys grow along z first. Where those of the cell before began, in the nine columns about it.
        let mut starts = [0; 9];
        for &g in batch {
            let before = near.len();
            let [x, y, z] = place(g as usize);
            let step = |c: i32, by: i32| c.saturating_add(by);
            for (start, k) in starts.iter_mut().zip(0..) {
                let [x, y] = [step(x, k / 3 - 1), step(y, k % 3 - 1)];
                let range = key([x, y, step(z, -1)])..=key([x, y, step(z, 1)]);
                let column = cells.within(*start, range);
                *start = column.start;
                near.extend(column.map(|g| g as u32));
            }
            sizes.push(near.len() - before);
        }
        (sizes, near)
    });
    let n_near = of_batches.iter().map(|(_, near)| near.len()).sum();
    let mut all = Groups::with_capacity(cells.len(), n_near);
    for (sizes, near) in of_batches {
        all.extend(sizes, near);
    }
    all
}

/// Normal of the plane of these moments, and its flatness `1 - sqrt(v0 / v1)`, with the variances `v0 <= v1 <= v2`
/// along the principal axes.
fn normal_of(moments: &Moments) -> ([f32; 3], f32) {
    match moments.principal_axes() {
        Some(axes) if moments.weight() >= 5.0 && axes.variances[1] > 0.0 => {
            let flatness = 1.0 - (axes.variances[0] / axes.variances[1]).sqrt();
            (axes.normal().map(|c| c as f32), flatness as f32)
        }
        Some(axes) => {
            // A line or less: any plane along it will do, so not one across it.
            let along = axes.directions[2].map(|c| c.abs());
            let across = (0..3).min_by(|&a, &b| along[a].total_cmp(&along[b])).unwrap_or(0);
            let mut normal = [0.0; 3];
            normal[across] = 1.0;
            (normal, LINE_WEIGHT)
        }
        None => ([0.0; 3], 0.0),
    }
}

/// The axis of every cell: the one with the largest sum of [`CellPlane::fit`] and the votes of the cells around,
/// [`NEIGHBOUR_PULL`] each, a few rounds over.
fn choose_axes(planes: &CellPlanes) -> Vec<u8> {
    let best = |score: &dyn Fn(usize) -> f32| {
        (0..3).max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a))).map_or(0, |a| a as u8)
    };
    let mut axes: Vec<u8> = parallel::map(&planes.of_cells, |plane| best(&|a| plane.fit(a)));
    for _ in 0..SIDE_ROUNDS {
        axes = parallel::map_range(axes.len(), |g| {
            let plane = &planes.of_cells[g];
            let mut votes = [0.0_f32; 3];
            for &near in planes.around.of(g) {
                votes[axes[near as usize] as usize] += NEIGHBOUR_PULL;
            }
            best(&|a| plane.fit(a) + votes[a])
        });
    }
    axes
}

/// Sides of the samples of a cell: down the axis for those that were seen from below its plane, unless nearly all
/// agree.
fn sides_of_cell<'a>(
    samples: impl Iterator<Item = &'a SeenSample>,
    axis: u8,
    mut normal: [f32; 3],
    has_views: bool,
) -> Vec<u8> {
    let a = usize::from(axis);
    if normal[a] < 0.0 {
        normal = normal.map(|c| -c);
    }
    if normal[a] == 0.0 {
        normal = [0.0; 3];
        normal[a] = 1.0;
    }
    let down: Vec<bool> = samples.map(|s| has_views && dot(s.view, normal) < 0.0).collect();
    let share = down.iter().filter(|d| **d).count() as f32 / down.len() as f32;
    let side = |down: bool| 2 * axis + u8::from(down);
    down.into_iter()
        .map(|d| {
            if share >= SIDE_AGREEMENT {
                side(true)
            } else if share <= 1.0 - SIDE_AGREEMENT {
                side(false)
            } else {
                side(d)
            }
        })
        .collect()
}
