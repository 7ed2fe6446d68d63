//! How far neighbouring points deviate from their plane.

use super::median;
use super::sample::Sample;
use crate::moments::Moments;

/// Numbers of points, the one in the middle included, whose plane is fitted, the smallest first: few, so that the other
/// face of a thin wall is not among them even where nobody knows which way it faces; more where a few points of a fused scan are less than its thickness apart, and
/// look like a ball.
const NEIGHBORS: [usize; 4] = [7, 16, 48, 192];

/// Parameters of a plane: of k points, k less these are free to deviate.
const PLANE_PARAMETERS: f64 = 3.0;

/// Neighbours lie on a plane when the deviation across it is less than this share of that along its shorter axis: half
/// of the neighbourhoods of a slab do from about three thicknesses on.
const FLATNESS: f64 = 0.35;

/// The planes of neighbouring points.
pub(super) struct Planes {
    /// Neighbours that a plane is fitted to.
    pub neighbors: usize,
    /// Median standard deviation of neighbours from their plane, metres.
    pub noise: f64,
}

impl Planes {
    /// Measures planes of the fewest neighbours half of which are flat, or of the most where none are.
    pub fn about(sample: &Sample) -> Self {
        let mut found = Self { neighbors: NEIGHBORS[0], noise: 0.0 };
        for neighbors in NEIGHBORS {
            let deviations = sample.measure(|i| deviations(sample, i, neighbors));
            let flatness =
                median(deviations.iter().map(|[across, along]| across / along).collect());
            let noise = median(deviations.iter().map(|[across, _]| *across).collect());
            found = Self { neighbors, noise };
            if flatness <= FLATNESS {
                break;
            }
        }
        found
    }
}

/// Standard deviations of the neighbours of a point across their plane and along its shorter axis; `None` of points on
/// a line.
fn deviations(sample: &Sample, point: usize, neighbors: usize) -> Option<[f64; 2]> {
    let near = sample.near(point, neighbors);
    let about = sample.positions[point];
    let axes = Moments::about(about, sample.positions_of(&near)).principal_axes()?;
    let along = axes.variances[1].sqrt();
    let n = near.len() as f64;
    if n <= PLANE_PARAMETERS || along <= 0.0 {
        return None;
    }
    Some([(axes.variances[0] * n / (n - PLANE_PARAMETERS)).sqrt(), along])
}
