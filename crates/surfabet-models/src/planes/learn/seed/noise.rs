//! How far points spread about their surface, before any patch is known.

use surfabet_geom::{Moments, morton};

use super::flat_cells::spanned;
use crate::planes::constants::{CELL_POINTS, NOISE_FLATNESS};
use crate::planes::points::Points;

/// Standard deviation of the points about their planes, metres: the median over the points, in the smallest cells in
/// which at least half of the points lie in flat cells. `None` when that is so at no size of cells.
pub(in crate::planes::learn) fn noise(points: &Points) -> Option<f64> {
    let mut level = points.level_with(CELL_POINTS);
    let mut cells: Vec<(u64, Moments)> = points
        .cells(level)
        .map(|c| (points.codes[c.start] >> (3 * level), points.moments(c)))
        .collect();
    while level < morton::BITS && cells.len() > 1 {
        let side = points.side(level);
        let mut deviations: Vec<(f64, f64)> = cells
            .iter()
            .map(|(_, m)| (spanned(m, side).map_or(f64::INFINITY, |d| d.1), m.weight()))
            .collect();
        let middle = weighted_median(&mut deviations);
        if middle <= NOISE_FLATNESS * side {
            return Some(middle);
        }
        cells = cells
            .chunk_by(|a, b| a.0 >> 3 == b.0 >> 3)
            .map(|children| {
                let mut sum = Moments::new();
                children.iter().for_each(|c| sum.merge(&c.1));
                (children[0].0 >> 3, sum)
            })
            .collect();
        level += 1;
    }
    None
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
