//! Scan lines: points that are close along lines, and lines that are far apart.

use surfabet_base::parallel;

use super::around::NeighborShapes;
use super::median;
use super::sample::SampledCloud;
use crate::vector::{dot, minus};

/// Cosine of half the angle of the double cone about a line: points outside of it are on another line.
const CONE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// How far the next line is looked for, spacings.
const REACH: f64 = 256.0;

/// Deviations across its line beyond which a point is no longer on it.
const DEVIATIONS: f64 = 4.0;

/// Lines are scan lines when they are this many times as far apart as the points on them.
const LEAST_RATIO: f64 = 3.0;

/// Median distance from a point to the next scan line, metres, where at least half of the points lie on lines that are
/// far apart for the spacing of the points; lines without another one near count as the furthest.
pub(super) fn line_spacing(
    sample: &SampledCloud,
    surroundings: &[NeighborShapes],
    spacing: f64,
) -> Option<f64> {
    if spacing <= 0.0 {
        return None;
    }
    let least = LEAST_RATIO * spacing;
    let is_most = |count: usize| 2 * count > surroundings.len();
    // Most clouds have no lines, or lines with others close by, which takes no search, or a short one.
    let mut lines: Vec<Line> =
        surroundings.iter().filter_map(|around| Line::through(sample, around)).collect();
    let are_alone = |lines: Vec<Line>| -> Vec<Line> {
        let is_alone = |line: &Line| line.next(sample, least).is_none_or(|d| d >= least);
        parallel::map_owned(lines, |line| is_alone(&line).then_some(line))
            .into_iter()
            .flatten()
            .collect()
    };
    if is_most(lines.len()) {
        lines = are_alone(lines);
    }
    is_most(lines.len()).then(|| {
        let reach = REACH * spacing;
        median(parallel::map(&lines, |line| line.next(sample, reach).unwrap_or(reach)))
    })
}

/// A point on a scan line.
struct Line {
    point: [f32; 3],
    /// Unit vector along the line.
    direction: [f64; 3],
    /// Distance from the line up to which points are on it, metres.
    thickness: f64,
}

impl Line {
    /// The line on which the neighbours of a point lie; `None` where none do.
    fn through(sample: &SampledCloud, around: &NeighborShapes) -> Option<Self> {
        around.line.map(|line| Self {
            point: sample.positions[around.point],
            direction: line.direction,
            thickness: DEVIATIONS * line.deviation,
        })
    }

    /// Distance to the nearest point outside of the double cone about the line, metres; `None` where there is none within
    /// `reach`.
    fn next(&self, sample: &SampledCloud, reach: f64) -> Option<f64> {
        let offset = |i: usize| minus(sample.positions[i], self.point).map(f64::from);
        let is_beside = |i: usize| {
            let offset = offset(i);
            let (squared, along) = (dot(offset, offset), dot(offset, self.direction));
            let aside = squared - along * along;
            along * along < CONE * CONE * squared && aside > self.thickness * self.thickness
        };
        let nearest = sample.tree.nearest_where(self.point, reach as f32, is_beside)?;
        let offset = offset(nearest.index());
        Some(dot(offset, offset).sqrt())
    }
}
