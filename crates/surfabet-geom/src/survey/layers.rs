//! How far behind a surface the next one lies: both faces of a thin wall, a door and its frame.

use surfabet_base::parallel;

use super::around::NeighborShapes;
use super::median;
use super::noise::Planes;
use super::sample::SampledCloud;
use crate::vector::{dot, minus};

/// How far a second surface is looked for, spacings: pixels of three spacings become finer below six, and ten leave room for
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

/// Which of [`NEIGHBORS`](super::around::NEIGHBORS) have a plane along both faces of a wall, where that of the nearest few
/// may lie across: 48.
const MORE_NEIGHBORS: usize = 2;

/// Which of them are on one line where points are on scan lines: fewer are wide with noise, more are on two lines: 16.
const LINE_NEIGHBORS: usize = 1;

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
pub(super) fn layer_gap(
    sample: &SampledCloud,
    surroundings: &[NeighborShapes],
    planes: &Planes,
    spacing: f64,
) -> Option<f64> {
    if spacing <= 0.0 {
        return None;
    }
    let gap = |around: &NeighborShapes| gap_at(sample, around, planes, spacing);
    let gaps = parallel::map(surroundings, gap).into_iter().flatten().collect();
    let found = most_frequent(gaps);
    let is_enough = found.len() * ONE_OF >= surroundings.len() && found.len() >= LEAST_POINTS;
    is_enough.then(|| median(found))
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
fn gap_at(
    sample: &SampledCloud,
    around: &NeighborShapes,
    planes: &Planes,
    spacing: f64,
) -> Option<f64> {
    normal(around, LINE_NEIGHBORS)?;
    let few = normal(around, planes.size)?;
    let more = normal(around, planes.size.max(MORE_NEIGHBORS))?;
    let column = |normal: [f64; 3]| Column::about(sample, spacing, around.point, normal);
    if sample.facings.is_some() {
        // All neighbours are on the same face, and the nearest follow it best.
        let least = NOISES * planes.noise;
        return [few, more].into_iter().find_map(|normal| column(normal).gap_to_opposite(least));
    }
    let least = SPACINGS * spacing;
    [more, few].into_iter().find_map(|normal| column(normal).empty_gap(least, REACH * spacing))
}

/// Normal of the plane of so many neighbours, by their place in [`NEIGHBORS`](super::around::NEIGHBORS); `None` on a line:
/// what lies beside a scan line is not behind the surface.
fn normal(around: &NeighborShapes, size: usize) -> Option<[f64; 3]> {
    let shape = around.shapes[size]?;
    let is_line = shape.variances[1] < LEAST_WIDTH.powi(2) * shape.variances[2];
    (!is_line).then_some(shape.normal)
}

/// Points above and below a point.
struct Column {
    /// Heights above the plane about the point, in no order, with whether the surface there faces the other way.
    heights: Vec<(f64, bool)>,
}

impl Column {
    /// The column about a point along a normal.
    fn about(sample: &SampledCloud, spacing: f64, point: usize, normal: [f64; 3]) -> Self {
        let (about, reach, radius) = (sample.positions[point], REACH * spacing, COLUMN * spacing);
        let limit = (reach as f32) * (reach as f32);
        let facing = |i: usize| {
            sample.facings.as_ref().map_or(0.0, |facings| dot(facings[i].map(f64::from), normal))
        };
        let own = facing(point);
        // Squared distance from the axis, and height.
        let place = |offset: [f64; 3]| {
            let height = dot(offset, normal);
            (dot(offset, offset) - height * height, height)
        };
        // A thousandth more, so that rounding leaves out no box that counts.
        let may_reach = |low: [f32; 3], high: [f32; 3]| {
            let middle = |a: usize| 0.5 * (f64::from(low[a]) + f64::from(high[a]));
            let offset: [f64; 3] = std::array::from_fn(|a| middle(a) - f64::from(about[a]));
            let diagonal = minus(high, low).map(f64::from);
            let half = 0.5 * dot(diagonal, diagonal).sqrt();
            let (aside, height) = place(offset);
            let within = |most: f64| 1.001 * (most + half);
            aside <= within(radius).powi(2) && height.abs() <= within(reach)
        };
        let mut heights = Vec::new();
        sample.tree.visit_where(may_reach, |position, i| {
            let offset = minus(position, about);
            let (aside, height) = place(offset.map(f64::from));
            if aside <= radius.powi(2) && dot(offset, offset) <= limit {
                heights.push((height, own * facing(i) < 0.0));
            }
        });
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
    /// empty stretch of at least `least` that is wide against the deviations of both. All heights are up to `reach`.
    fn empty_gap(&self, least: f64, reach: f64) -> Option<f64> {
        if !self.may_have_gap(least, reach) {
            return None;
        }
        let mut heights: Vec<f64> = self.heights.iter().map(|h| h.0).collect();
        heights.sort_unstable_by(f64::total_cmp);
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

    /// Whether there is an empty slice, a bit less than half as thick as `least`, between others: where there is none, no
    /// heights that follow each other are `least` apart.
    fn may_have_gap(&self, least: f64, reach: f64) -> bool {
        let slice = |height: f64| ((height + 1.1 * reach) / (0.499 * least)) as usize;
        let mut is_filled = vec![false; slice(reach) + 2];
        for (height, _) in &self.heights {
            is_filled[slice(*height)] = true;
        }
        let filled = is_filled.split(|&is| !is).filter(|run| !run.is_empty());
        filled.count() > 1
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
