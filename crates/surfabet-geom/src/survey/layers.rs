//! How far behind a surface the next one lies: both faces of a thin wall, a door and its frame.

use super::median;
use super::noise::Planes;
use super::sample::Sample;
use crate::moments::Moments;
use crate::vector::{dot, minus};

/// How far a second surface is looked for, spacings.
const REACH: f64 = 10.0;

/// Radius of the column in which it is looked for, spacings.
const COLUMN: f64 = 3.0;

/// Least gap between two surfaces, standard deviations of the noise: points of one surface leave no such gap.
const NOISES: f64 = 6.0;

/// Least gap between two surfaces, spacings.
const SPACINGS: f64 = 1.5;

/// Least ratio of the deviations along the two axes of a plane: the points of a single scan line have no normal.
const LEAST_WIDTH: f64 = 0.3;

/// Points that make a surface of what lies behind the gap.
const LEAST_POINTS: usize = 4;

/// Share of the points that must have a second surface behind theirs, one in this many: edges and clutter have one here
/// and there.
const ONE_OF: usize = 7;

/// Median distance from a surface to the one behind it, metres, where enough points have one.
pub(super) fn layer_gap(sample: &Sample, planes: &Planes, spacing: f64) -> Option<f64> {
    if spacing <= 0.0 {
        return None;
    }
    let gaps = sample.measure(|p| Some(gap_at(sample, planes, spacing, p)));
    let n = gaps.len();
    let found: Vec<f64> = gaps.into_iter().flatten().collect();
    (found.len() * ONE_OF >= n && found.len() >= LEAST_POINTS).then(|| median(found))
}

/// Distance along the normal of the plane about `point` from the layer of the point to the nearest other one.
fn gap_at(sample: &Sample, planes: &Planes, spacing: f64, point: [f32; 3]) -> Option<f64> {
    let mut near = Vec::new();
    sample.tree.k_nearest(point, planes.neighbors, &mut near);
    let axes = Moments::about(point, sample.positions_of(&near)).principal_axes()?;
    if axes.variances[1] < LEAST_WIDTH.powi(2) * axes.variances[2] {
        return None;
    }
    let normal = axes.normal();
    sample.tree.within(point, (REACH * spacing) as f32, &mut near);
    let mut heights: Vec<f64> = sample
        .positions_of(&near)
        .filter_map(|p| {
            let offset = minus(p, point).map(f64::from);
            let height = dot(offset, normal);
            let aside = dot(offset, offset) - height * height;
            (aside <= (COLUMN * spacing).powi(2)).then_some(height)
        })
        .collect();
    heights.sort_by(f64::total_cmp);
    let own = heights.partition_point(|&h| h < 0.0);
    let least = (NOISES * planes.noise).max(SPACINGS * spacing);
    let is_gap = |w: &[f64]| w[1] - w[0] >= least;
    // Upwards and downwards from the point's own layer.
    let above = heights[own..].windows(2).position(is_gap).map(|i| own + i + 1);
    let below = heights[..heights.len().min(own + 1)].windows(2).rposition(is_gap).map(|i| i + 1);
    let up =
        above.filter(|&i| heights.len() - i >= LEAST_POINTS).map(|i| heights[i] - heights[i - 1]);
    let down = below.filter(|&i| i >= LEAST_POINTS).map(|i| heights[i] - heights[i - 1]);
    [up, down].into_iter().flatten().min_by(f64::total_cmp)
}
