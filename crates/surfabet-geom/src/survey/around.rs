//! The neighbours of the sampled points: searched once for all that is measured of them.

use super::sample::SampledCloud;
use crate::kdtree::Neighbor;
use crate::moments::{Moments, PrincipalAxes};
use crate::vector::dot;

/// Numbers of nearest points, the one in the middle included, whose shape is known, the smallest first.
/// 5, 11, 32 and 128 change the noise of 28 of 40 clouds by more than 10 percent, of 25 to less; 10, 24, 72 and 288 that of 16, of
/// 12 to more (`docs/benchmarks/constants.md`).
pub(super) const NEIGHBORS: [usize; 4] = [7, 16, 48, 192];

/// The most of them.
const MOST: usize = NEIGHBORS[NEIGHBORS.len() - 1];

/// Points lie on a line when the deviation across it is less than this share of that along it.
const SLIMNESS: f64 = 0.3;

/// The shape of some neighbours of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// Variances along the axes, smallest first, square metres.
    pub variances: [f64; 3],
    /// Unit normal of their plane.
    pub normal: [f64; 3],
    /// Number of neighbours: fewer than asked for, where fewer face the same way.
    pub count: usize,
}

/// The line that some neighbours of a point lie on.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineShape {
    /// Unit vector along the line.
    pub direction: [f64; 3],
    /// Larger standard deviation across it, metres.
    pub deviation: f64,
}

/// What is known of the neighbours of a point.
#[derive(Debug, Clone)]
pub(super) struct NeighborShapes {
    /// The number of the point in the sample.
    pub point: usize,
    /// Distance of the nearest other point, metres.
    pub nearest: Option<f64>,
    /// Of each number of [`NEIGHBORS`] that face the same way.
    pub shapes: [Option<Shape>; NEIGHBORS.len()],
    /// The line of the fewest of [`NEIGHBORS`], but for the most, that lie on one, whichever way they face.
    ///
    /// Few neighbours are enough where lines are thin, and more where noise is as large as the distance of the points along
    /// them. Range noise leaves a line in the plane that the sensor scans, so that flat neighbourhoods may be lines, too.
    pub line: Option<LineShape>,
}

impl NeighborShapes {
    /// What is about a point of the sample.
    pub fn new(sample: &SampledCloud, point: usize) -> Self {
        let mut near = Vec::new();
        // Of points that face the same way half of those around may face the other one.
        let searched = if sample.facings.is_some() { 2 * MOST } else { MOST };
        sample.tree.k_nearest(sample.positions[point], searched, &mut near);
        let nearest = near.get(1).map(|n| f64::from(n.squared_distance()).sqrt());
        let axes = |near: &[Neighbor]| {
            let positions = near.iter().map(|n| sample.positions[n.index()]);
            Moments::about(sample.positions[point], positions).principal_axes()
        };
        let first = |k: usize| &near[..k.min(near.len())];
        let of_all = NEIGHBORS.map(|k| axes(first(k)));
        let line = of_all[..NEIGHBORS.len() - 1].iter().flatten().find_map(line_of);
        let shape = |axes: &PrincipalAxes, count: usize| Shape {
            variances: axes.variances,
            normal: axes.normal(),
            count,
        };
        let shapes = std::array::from_fn(|size| {
            let k = NEIGHBORS[size];
            let Some(facings) = &sample.facings else {
                return of_all[size].as_ref().map(|axes| shape(axes, first(k).len()));
            };
            let is_same = |n: &&Neighbor| dot(facings[n.index()], facings[point]) > 0.0;
            let same: Vec<Neighbor> =
                first(2 * k).iter().filter(is_same).take(k).copied().collect();
            axes(&same).map(|axes| shape(&axes, same.len()))
        });
        Self { point, nearest, shapes, line }
    }
}

/// The line of points with these axes, if they lie on one.
fn line_of(axes: &PrincipalAxes) -> Option<LineShape> {
    let [_, across, along] = axes.variances;
    let is_line = across <= SLIMNESS * SLIMNESS * along;
    is_line.then(|| LineShape { direction: axes.directions[2], deviation: across.sqrt() })
}
