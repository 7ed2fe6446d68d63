//! Classes of inclination, as pairs of occurrences and layers have them.

use crate::constants::INCLINATION_LIMITS;

/// Classes of inclination: steep, sloped, level.
pub(super) const INCLINATIONS: usize = INCLINATION_LIMITS.len() + 1;

/// Class of inclination of a normal with the vertical component `z`.
pub(super) fn inclination(z: f64) -> usize {
    INCLINATION_LIMITS.iter().filter(|&&limit| z.abs() > limit).count()
}
