//! How uncertain a refined pose is.

use nalgebra::Matrix6;

use super::Near;
use super::constants::{FACTS, FINE_REACH, LEAST_VARIANCE};
use super::free::{FreeMotion, FreeSpace};
use super::map::Localizer;
use super::placement::Placement;
use super::refine::matched_system;
use super::samples::Sample;

/// Covariance of a refined pose: rows and columns x, y, z in metres, then turns about x, y, z of the world in radians.
///
/// The inverse of the normal matrix over the variance of the distances, as of [`FACTS`] samples: neighbouring samples share the errors
/// of one surface of the map and are not independent. With a prior its information is added, that of a place anywhere within its
/// radius and of a turn anywhere within its angle: a third of their squares is the variance of each. Where the prior alone holds a
/// placement along `free` motions, what the surfaces say of these is left out.
pub(super) fn covariance(
    map: &Localizer,
    samples: &[Sample],
    placement: &Placement,
    free: &[FreeMotion],
    near: Option<&Near>,
) -> [[f64; 6]; 6] {
    let system = matched_system(map, samples, placement, FINE_REACH[1]);
    let per_fact = (samples.len() as f64 / FACTS).max(1.0);
    let variance = per_fact * system.squares / system.weight.max(1e-12);
    let matrix = match near {
        None => system.held().try_inverse().unwrap_or_else(Matrix6::zeros) * variance,
        Some(near) => {
            let fixed = FreeSpace::new(&system, free).without(&system.matrix);
            let information = fixed / variance.max(LEAST_VARIANCE) + near.information(map);
            information.try_inverse().unwrap_or_else(Matrix6::zeros)
        }
    };
    // Translations first.
    let of = |i: usize| (i + 3) % 6;
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[(of(r), of(c))]))
}

impl Near {
    /// The inverse of its covariance, turns first. A radius beyond the size of the map says no more than that.
    fn information(&self, map: &Localizer) -> Matrix6<f64> {
        let [low, high] = map.bounds;
        let across: f64 = (0..3).map(|a| f64::from(high[a] - low[a]).powi(2)).sum();
        let radius = self.radius.min(across.sqrt().max(map.cell));
        let angle = self.angle.min(std::f64::consts::PI);
        let of = |i: usize| 3.0 / if i < 3 { angle * angle } else { radius * radius };
        Matrix6::from_fn(|r, c| if r == c { of(r) } else { 0.0 })
    }
}
