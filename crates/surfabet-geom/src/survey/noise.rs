//! How far neighbouring points deviate from their plane.

use super::around::{NEIGHBORS, NeighborShapes, Shape};
use super::median;
use crate::vector::dot;

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
    /// Which of [`NEIGHBORS`] a plane is fitted to: few, so that the other face of a thin wall is not among them even where
    /// nobody knows which way it faces; more where a few points of a fused scan are less than its thickness apart, and look
    /// like a ball.
    pub size: usize,
    /// Median standard deviation of neighbours from their plane, metres.
    pub noise: f64,
}

impl Planes {
    /// Measures planes of the fewest neighbours that are flat, for half of the points, and along the plane of the most; where
    /// none are along it of the fewest that are flat, and of the most where none are flat.
    pub fn about(surroundings: &[NeighborShapes]) -> Self {
        let mut flat = None;
        let mut found = Self { size: 0, noise: 0.0 };
        for size in 0..NEIGHBORS.len() {
            let of = |around: &NeighborShapes| deviations(&around.shapes[size]?);
            let deviations: Vec<[f64; 2]> = surroundings.iter().filter_map(of).collect();
            let flatness =
                median(deviations.iter().map(|[across, along]| across / along).collect());
            let noise = median(deviations.iter().map(|[across, _]| *across).collect());
            found = Self { size, noise };
            if flatness <= FLATNESS {
                if is_along_surface(surroundings, size) {
                    return found;
                }
                flat.get_or_insert(found);
            }
        }
        flat.unwrap_or(found)
    }
}

/// Whether for at least half of the points the plane of so many neighbours is along that of the most.
fn is_along_surface(surroundings: &[NeighborShapes], size: usize) -> bool {
    let cosine = |around: &NeighborShapes| {
        let normal = |size: usize| Some(around.shapes[size]?.normal);
        Some(dot(normal(size)?, normal(NEIGHBORS.len() - 1)?).abs())
    };
    let cosines: Vec<f64> = surroundings.iter().filter_map(cosine).collect();
    cosines.is_empty() || median(cosines) >= SAME_PLANE
}

/// Standard deviations of neighbours across their plane and along its shorter axis; `None` of points on a line.
fn deviations(shape: &Shape) -> Option<[f64; 2]> {
    let (variances, n) = (shape.variances, shape.count as f64);
    let along = variances[1].sqrt();
    if n <= PLANE_PARAMETERS || along <= 0.0 {
        return None;
    }
    Some([(variances[0] * n / (n - PLANE_PARAMETERS)).sqrt(), along])
}
