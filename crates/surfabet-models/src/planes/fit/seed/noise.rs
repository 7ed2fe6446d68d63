//! How far points spread about their surface, before any patch is known.

use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::morton;

use super::flat_cells::{moments_of, spanned};
use crate::planes::constants::{CELL_POINTS, NOISE_FLATNESS};
use crate::planes::points::Points;

/// Standard deviation of the points about their planes, metres: the median over the points, in the smallest cells in
/// which at least half of the points lie in flat cells. `None` when that is so at no size of cells. Where it is known from
/// where points were seen, those seen from either side of a cell count each about their own plane.
pub(in crate::planes::fit) fn noise(points: &Points) -> Option<f64> {
    for level in points.level_with(CELL_POINTS)..morton::BITS {
        let cells: Vec<Range<usize>> = points.cells(level).collect();
        if cells.len() < 2 {
            break;
        }
        let side = points.side(level);
        let mut deviations: Vec<(f64, f64)> = parallel::gather(cells.len(), |i, found| {
            found.extend(deviations(points, cells[i].clone(), side));
        });
        let middle = weighted_median(&mut deviations);
        if middle <= NOISE_FLATNESS * side {
            return Some(middle);
        }
    }
    None
}

/// Standard deviation of the points of a cell of side `side` about their plane, infinite where they span none, and their
/// weight; of each side that they were seen from.
fn deviations(points: &Points, cell: Range<usize>, side: f64) -> Vec<(f64, f64)> {
    let moments = points.moments(cell.clone());
    let Some((frame, deviation)) = spanned(&moments, side) else {
        return vec![(f64::INFINITY, moments.weight())];
    };
    if points.facing.is_none() {
        return vec![(deviation, moments.weight())];
    }
    let members: Vec<u32> = cell.map(|i| i as u32).collect();
    let sides = points.sides(&members, frame.normal).into_iter().filter(|s| !s.is_empty());
    sides
        .map(|members| {
            let moments = moments_of(points, &members);
            let deviation = spanned(&moments, side).map_or(f64::INFINITY, |s| s.1);
            (deviation, moments.weight())
        })
        .collect()
}

/// The weighted median of values with weights: half of the weight is of values up to it.
fn weighted_median(values: &mut [(f64, f64)]) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut seen = 0.0;
    for &(value, weight) in values.iter() {
        seen += weight;
        if seen >= half {
            return value;
        }
    }
    f64::INFINITY
}
