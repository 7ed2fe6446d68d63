//! How far neighbouring points deviate from their plane.

use super::median;
use super::sample::Sample;
use crate::moments::{Moments, PrincipalAxes};
use crate::vector::dot;

/// Numbers of points, the one in the middle included, whose plane is fitted, the smallest first: few, so that the other
/// face of a thin wall is not among them even where nobody knows which way it faces; more where a few points of a fused scan are less than its thickness apart, and
/// look like a ball.
const NEIGHBORS: [usize; 4] = [7, 16, 48, 192];

/// Parameters of a plane: of k points, k less these are free to deviate.
const PLANE_PARAMETERS: f64 = 3.0;

/// Neighbours lie on a plane when the deviation across it is less than this share of that along its shorter axis: half
/// of the neighbourhoods of a slab do from about three thicknesses on.
const FLATNESS: f64 = 0.35;

/// Cosine of the angle between the planes of fewer and of the most neighbours, below which the fewer do not lie along the
/// surface: the points of one scan line lie in the plane that the sensor scans, across the surface and without its noise.
/// The angle is 20 degrees; that of seven points as far from their plane as may be differs by 11 from the true one.
const SAME_PLANE: f64 = 0.94;

/// The planes of neighbouring points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planes {
    /// Neighbours that a plane is fitted to.
    pub neighbors: usize,
    /// Median standard deviation of neighbours from their plane, metres.
    pub noise: f64,
}

impl Planes {
    /// Measures planes of the fewest neighbours that are flat, for half of the points, and along the plane of the most; where
    /// none are along it of the fewest that are flat, and of the most where none are flat.
    pub fn about(sample: &Sample) -> Self {
        let mut flat = None;
        let mut found = Self { neighbors: NEIGHBORS[0], noise: 0.0 };
        for neighbors in NEIGHBORS {
            let deviations = sample.measure(|point| deviations(sample, point, neighbors));
            let flatness =
                median(deviations.iter().map(|[across, along]| across / along).collect());
            let noise = median(deviations.iter().map(|[across, _]| *across).collect());
            found = Self { neighbors, noise };
            if flatness <= FLATNESS {
                if is_along_surface(sample, neighbors) {
                    return found;
                }
                flat.get_or_insert(found);
            }
        }
        flat.unwrap_or(found)
    }
}

/// Whether for at least half of the points the plane of `neighbors` is along that of the most.
fn is_along_surface(sample: &Sample, neighbors: usize) -> bool {
    let most = NEIGHBORS[NEIGHBORS.len() - 1];
    let cosines = sample.measure(|point| {
        let normal = |k| Some(axes_at(sample, point, k)?.0.normal());
        Some(dot(normal(neighbors)?, normal(most)?).abs())
    });
    cosines.is_empty() || median(cosines) >= SAME_PLANE
}

/// Principal axes of the neighbours of a point, and their number.
fn axes_at(sample: &Sample, point: usize, neighbors: usize) -> Option<(PrincipalAxes, f64)> {
    let near = sample.near(point, neighbors);
    let moments = Moments::about(sample.positions[point], sample.positions_of(&near));
    Some((moments.principal_axes()?, near.len() as f64))
}

/// Standard deviations of the neighbours of a point across their plane and along its shorter axis; `None` of points on
/// a line.
fn deviations(sample: &Sample, point: usize, neighbors: usize) -> Option<[f64; 2]> {
    let (axes, n) = axes_at(sample, point, neighbors)?;
    let along = axes.variances[1].sqrt();
    if n <= PLANE_PARAMETERS || along <= 0.0 {
        return None;
    }
    Some([(axes.variances[0] * n / (n - PLANE_PARAMETERS)).sqrt(), along])
}
