//! Scan lines: points that are close along lines, and lines that are far apart.

use super::median;
use super::sample::Sample;
use crate::kdtree::Neighbor;
use crate::moments::{Moments, PrincipalAxes};
use crate::vector::{dot, minus};

/// Numbers of points, the one in the middle included, whose shape is looked at, the smallest first: more where noise is as
/// large as the distance of the points along their line.
const NEIGHBORS: [usize; 3] = [7, 16, 48];

/// Points lie on a line when the deviation across it is less than this share of that along it.
const SLIMNESS: f64 = 0.3;

/// Cosine of half the angle of the double cone about a line: points outside of it are on another line.
const CONE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// How far the next line is looked for, spacings, each a doubling from the first to the last.
const FIRST_REACH: f64 = 8.0;
const LAST_REACH: f64 = 256.0;

/// Deviations across its line beyond which a point is no longer on it.
const DEVIATIONS: f64 = 4.0;

/// Lines are scan lines when they are this many times as far apart as the points on them.
const LEAST_RATIO: f64 = 3.0;

/// Median distance from a point to the next scan line, metres, where at least half of the points lie on lines that are
/// far apart for the spacing of the points; lines without another one near count as the furthest.
pub(super) fn line_spacing(sample: &Sample, spacing: f64) -> Option<f64> {
    if spacing <= 0.0 {
        return None;
    }
    let distances = sample.measure(|i| Some(next_line(sample, spacing, sample.positions[i])));
    let n = distances.len();
    let found: Vec<f64> =
        distances.into_iter().flatten().filter(|&d| d >= LEAST_RATIO * spacing).collect();
    (2 * found.len() > n).then(|| median(found))
}

/// Distance from a point on a line to the nearest point outside of the double cone about the line; `None` of points on
/// no line.
fn next_line(sample: &Sample, spacing: f64, point: [f32; 3]) -> Option<f64> {
    let axes = line_at(sample, point)?;
    let direction = axes.directions[2];
    let thickness = DEVIATIONS * axes.variances[1].sqrt();
    let mut near: Vec<Neighbor> = Vec::new();
    let mut reach = FIRST_REACH;
    while reach <= LAST_REACH {
        sample.tree.within(point, (reach * spacing) as f32, &mut near);
        let beside = sample.positions_of(&near).filter_map(|p| {
            let offset = minus(p, point).map(f64::from);
            let (squared, along) = (dot(offset, offset), dot(offset, direction));
            let aside = squared - along * along;
            (along * along < CONE * CONE * squared && aside > thickness * thickness)
                .then(|| squared.sqrt())
        });
        if let Some(distance) = beside.min_by(f64::total_cmp) {
            return Some(distance);
        }
        reach *= 2.0;
    }
    Some(LAST_REACH * spacing)
}

/// The axes of the line on which the neighbours of a point lie, of the fewest that do; `None` where none do.
///
/// Range noise leaves a line in the plane that the sensor scans, so that flat neighbourhoods may be lines, too.
fn line_at(sample: &Sample, point: [f32; 3]) -> Option<PrincipalAxes> {
    let mut near = Vec::new();
    NEIGHBORS.into_iter().find_map(|neighbors| {
        sample.tree.k_nearest(point, neighbors, &mut near);
        let axes = Moments::about(point, sample.positions_of(&near)).principal_axes()?;
        let [_, across, along] = axes.variances;
        (across <= SLIMNESS * SLIMNESS * along).then_some(axes)
    })
}
