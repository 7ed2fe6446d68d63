//! How far points spread about their surface, before any patch is known.

use std::ops::Range;

use surfabet_base::parallel;
use surfabet_geom::morton;

use super::flat_cells::{moments_of, spanned};
use crate::planes::constants::{CELL_POINTS, NOISE_FLATNESS};
use crate::planes::fit::incidence::{Incidence, weighted_median};
use crate::planes::fit::trim::facing;
use crate::planes::points::Points;
use crate::vector::dot;

/// Standard deviation of the points about their planes, metres: the median over the points, in the smallest cells in
/// which at least half of the points lie in flat cells; and how it depends on the angle at which they were seen. `None` when that is so at
/// no size of cells. Where it is known from where points were seen, those seen from either side of a cell count each
/// about their own plane.
pub(in crate::planes::fit) fn noise(points: &Points) -> Option<(f64, Incidence)> {
    for level in points.level_with(CELL_POINTS)..morton::BITS {
        let cells: Vec<Range<usize>> = points.cells(level).collect();
        if cells.len() < 2 {
            break;
        }
        let side = points.side(level);
        let found: Vec<(f64, f64, f64)> = parallel::gather(cells.len(), |i, found| {
            found.extend(deviations(points, cells[i].clone(), side));
        });
        let mut deviations: Vec<(f64, f64)> = found.iter().map(|c| (c.0, c.2)).collect();
        let middle = weighted_median(&mut deviations);
        if middle <= NOISE_FLATNESS * side {
            // What is not flat is no noise.
            let flat: Vec<_> = found.into_iter().filter(|c| c.0 <= NOISE_FLATNESS * side).collect();
            return Some((middle, Incidence::of(&flat)));
        }
    }
    None
}

/// Standard deviation of the points of a cell of side `side` about their plane, infinite where they span none, the mean cosine of
/// the angle at which they were seen, and their weight; of each side that they were seen from.
fn deviations(points: &Points, cell: Range<usize>, side: f64) -> Vec<(f64, f64, f64)> {
    let moments = points.moments(cell.clone());
    let Some((frame, deviation)) = spanned(&moments, side) else {
        return vec![(f64::INFINITY, 1.0, moments.weight())];
    };
    if points.facing.is_none() {
        return vec![(deviation, 1.0, moments.weight())];
    }
    let n = cell.len();
    let members: Vec<u32> = cell.map(|i| i as u32).collect();
    let sides = points.sides(&members, frame.normal).into_iter().filter(|s| !s.is_empty());
    sides
        .map(|members| {
            // Mostly all were seen from one side.
            let (weight, spanned) = if members.len() == n {
                (moments.weight(), Some((frame, deviation)))
            } else {
                let moments = moments_of(points, &members);
                (moments.weight(), spanned(&moments, side))
            };
            let Some((frame, deviation)) = spanned else {
                return (f64::INFINITY, 1.0, weight);
            };
            let seen = facing(points, &members).unwrap_or_default();
            (deviation, dot(seen, frame.normal).abs() / members.len() as f64, weight)
        })
        .collect()
}
