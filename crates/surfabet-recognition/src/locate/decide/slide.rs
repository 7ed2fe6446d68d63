//! Whether surfaces fix a position in every direction: a corridor looks the same along its length.

use nalgebra::SymmetricEigen;

use super::Candidate;
use super::verify::evidence;
use crate::locate::constants::{FINE_REACH, FREE, LOOSE, SLIDE, VERIFIED_SAMPLES};
use crate::locate::map::{Localizer, evenly};
use crate::locate::refine::facing;
use crate::locate::samples::Sample;

/// The direction along which a place is free: surfaces that face it hold the position little, and [`SLIDE`] metres farther along it
/// the evidence is as good.
pub(in crate::locate) fn free_direction(
    map: &Localizer,
    samples: &[Sample],
    candidate: &Candidate,
) -> Option<[f64; 3]> {
    let verified = evenly(samples, VERIFIED_SAMPLES);
    let eigen = SymmetricEigen::new(facing(map, &verified, &candidate.placement, FINE_REACH[1])?);
    let least = eigen.eigenvalues.imin();
    if eigen.eigenvalues[least] > LOOSE {
        return None;
    }
    let along = eigen.eigenvectors.column(least).into_owned();
    let is_as_likely = |step: f64| {
        let mut moved = candidate.placement;
        moved.translation += along * step;
        evidence(map, &verified, &moved).rank() > candidate.evidence.rank() - FREE
    };
    [-SLIDE, SLIDE].into_iter().any(is_as_likely).then(|| along.into())
}
