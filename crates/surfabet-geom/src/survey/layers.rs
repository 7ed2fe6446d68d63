//! How far behind a surface the next one lies: both faces of a thin wall, a door and its frame.

use super::median;
use super::noise::Planes;
use super::sample::Sample;
use crate::moments::Moments;
use crate::vector::{dot, minus};

/// How far a second surface is looked for, spacings: six make the three spacings of a pixel finer, and ten leave room for
/// the coarser pixels of noise and of small models.
const REACH: f64 = 10.0;

/// Radius of the column in which it is looked for, spacings: of points at random places it holds `9 ln 2` = 6 of each
/// surface on average.
const COLUMN: f64 = 3.0;

/// Least empty gap between two surfaces, standard deviations of the heights on either side of it: the points of one noisy
/// surface leave no such gap.
const DEVIATIONS: f64 = 4.0;

/// Least empty gap between two surfaces, spacings: more than the points of one surface on a lattice are apart, one.
const SPACINGS: f64 = 1.2;

/// Least distance between the means of surfaces that face opposite ways, whose points may overlap, standard deviations of
/// the noise. The difference of two means of the fewest points that make a surface, four each, has a standard deviation of
/// 0.7 of them.
const NOISES: f64 = 2.5;

/// Neighbours whose plane is along both faces of a wall, where that of the nearest few may lie across.
const MORE_NEIGHBORS: usize = 48;

/// Neighbours that are on one line where points are on scan lines: fewer are wide with noise, more are on two lines.
const LINE_NEIGHBORS: usize = 16;

/// Least ratio of the deviations along the two axes of a plane: the points of a single scan line have no normal.
const LEAST_WIDTH: f64 = 0.3;

/// Points that make a surface of what lies behind the gap: three lie on a plane anyhow.
const LEAST_POINTS: usize = 4;

/// Share of the points that must have a second surface behind theirs, one in this many: edges and clutter have one here
/// and there.
const ONE_OF: usize = 7;

/// Largest ratio of the distances that these points have: what lies behind clutter is at any distance.
const SAME_DISTANCE: f64 = 1.3;

/// Median distance from a surface to the one behind it, metres, where enough points have about the same one; of several
/// such distances the most frequent.
pub(super) fn layer_gap(sample: &Sample, planes: &Planes, spacing: f64) -> Option<f64> {
    if spacing <= 0.0 {
        return None;
    }
    let gaps = sample.measure(|i| Some(gap_at(sample, planes, spacing, i)));
    let n = gaps.len();
    let found = most_frequent(gaps.into_iter().flatten().collect());
    (found.len() * ONE_OF >= n && found.len() >= LEAST_POINTS).then(|| median(found))
}

/// The largest set of values with a ratio of at most [`SAME_DISTANCE`] to one another, of equal ones that of the smallest
/// values.
fn most_frequent(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let about = |from: usize| {
        let end = values.partition_point(|&v| v <= SAME_DISTANCE * values[from]);
        from..end
    };
    let larger = |a: std::ops::Range<usize>, b: std::ops::Range<usize>| {
        if b.len() > a.len() { b } else { a }
    };
    let most = (0..values.len()).map(about).reduce(larger).unwrap_or(0..0);
    values[most].to_vec()
}

/// Distance along the normal of the plane about a point from the layer of the point to the nearest other one.
fn gap_at(sample: &Sample, planes: &Planes, spacing: f64, point: usize) -> Option<f64> {
    normal_at(sample, point, LINE_NEIGHBORS)?;
    let few = normal_at(sample, point, planes.neighbors)?;
    let more = normal_at(sample, point, planes.neighbors.max(MORE_NEIGHBORS))?;
    let column = |normal: [f64; 3]| Column::about(sample, spacing, point, normal);
    if sample.facings.is_some() {
        // All neighbours are on the same face, and the nearest follow it best.
        let least = NOISES * planes.noise;
        return [few, more].into_iter().find_map(|normal| column(normal).gap_to_opposite(least));
    }
    [more, few].into_iter().find_map(|normal| column(normal).empty_gap(SPACINGS * spacing))
}

/// Normal of the plane about a point; `None` on a line: what lies beside a scan line is not behind the surface.
fn normal_at(sample: &Sample, point: usize, neighbors: usize) -> Option<[f64; 3]> {
    let near = sample.near(point, neighbors);
    let moments = Moments::about(sample.positions[point], sample.positions_of(&near));
    let axes = moments.principal_axes()?;
    let is_line = axes.variances[1] < LEAST_WIDTH.powi(2) * axes.variances[2];
    (!is_line).then(|| axes.normal())
}

/// Points above and below a point.
struct Column {
    /// Heights above the plane about the point, ascending, with whether the surface there faces the other way.
    heights: Vec<(f64, bool)>,
}

impl Column {
    /// The column about a point along a normal.
    fn about(sample: &Sample, spacing: f64, point: usize, normal: [f64; 3]) -> Self {
        let about = sample.positions[point];
        let facing = |i: usize| {
            sample.facings.as_ref().map_or(0.0, |facings| dot(facings[i].map(f64::from), normal))
        };
        let own = facing(point);
        let mut near = Vec::new();
        sample.tree.within(about, (REACH * spacing) as f32, &mut near);
        let mut heights: Vec<(f64, bool)> = near
            .iter()
            .filter_map(|n| {
                let offset = minus(sample.positions[n.index()], about).map(f64::from);
                let height = dot(offset, normal);
                let aside = dot(offset, offset) - height * height;
                let is_opposite = own * facing(n.index()) < 0.0;
                (aside <= (COLUMN * spacing).powi(2)).then_some((height, is_opposite))
            })
            .collect();
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { heights }
    }

    /// Distance from the mean height of the points that face the point's own way to that of those that face the other way,
    /// if it is at least `least`.
    fn gap_to_opposite(&self, least: f64) -> Option<f64> {
        let height = |opposite: bool| {
            let of: Vec<f64> =
                self.heights.iter().filter(|h| h.1 == opposite).map(|h| h.0).collect();
            (of.len() >= LEAST_POINTS).then(|| mean(&of))
        };
        let gap = (height(true)? - height(false)?).abs();
        (gap >= least).then_some(gap)
    }

    /// Distance between the mean heights of two layers: the one of the point, and the nearest, upwards or downwards, behind an
    /// empty stretch of at least `least` that is wide against the deviations of both.
    fn empty_gap(&self, least: f64) -> Option<f64> {
        let heights: Vec<f64> = self.heights.iter().map(|h| h.0).collect();
        let own = heights.partition_point(|&h| h < 0.0).min(heights.len() - 1);
        // Numbers of the heights behind which `least` is empty: the borders between layers.
        let borders: Vec<usize> =
            (1..heights.len()).filter(|&i| heights[i] - heights[i - 1] >= least).collect();
        let next = borders.partition_point(|&i| i <= own);
        let ends = |border: usize| {
            let from = if border == 0 { 0 } else { borders[border - 1] };
            let to = borders.get(border + 1).copied().unwrap_or(heights.len());
            (&heights[from..borders[border]], &heights[borders[border]..to])
        };
        let distance = |border: usize| {
            let (below, above) = ends(border);
            let width = above[0] - below[below.len() - 1];
            let enough = below.len().min(above.len()) >= LEAST_POINTS;
            let spread = deviation(below).max(deviation(above));
            (enough && width >= DEVIATIONS * spread).then(|| mean(above) - mean(below))
        };
        let up = (next < borders.len()).then(|| distance(next)).flatten();
        let down = (next > 0).then(|| distance(next - 1)).flatten();
        [up, down].into_iter().flatten().min_by(f64::total_cmp)
    }
}

fn mean(heights: &[f64]) -> f64 {
    heights.iter().sum::<f64>() / heights.len() as f64
}

/// Standard deviation of some heights about their mean.
fn deviation(heights: &[f64]) -> f64 {
    let middle = mean(heights);
    let squares: f64 = heights.iter().map(|h| (h - middle).powi(2)).sum();
    (squares / heights.len() as f64).sqrt()
}
