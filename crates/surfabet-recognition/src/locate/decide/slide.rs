//! Whether surfaces fix a position in every direction: a corridor looks the same along its length.

use nalgebra::{SymmetricEigen, Vector3};

use super::RefinedPose;
use super::verify::evidence;
use crate::locate::constants::{FINE_REACH, FREE, LOOSE, SLIDE, VERIFIED_SAMPLES};
use crate::locate::map::{Localizer, evenly};
use crate::locate::placement::Placement;
use crate::locate::refine::facing;
use crate::locate::samples::Sample;

/// The direction along which a place is free: surfaces that face it hold the position little, and [`SLIDE`] metres farther along it
/// the evidence is as good.
pub(in crate::locate) fn free_direction(
    map: &Localizer,
    samples: &[Sample],
    candidate: &RefinedPose,
) -> Option<[f64; 3]> {
    let (along, ways) = free_ways(map, samples, candidate)?;
    ways.contains(&true).then(|| along.into())
}

/// The direction that surfaces hold least, if they hold it little, and whether [`SLIDE`] metres back and forth along it the evidence is as
/// good.
fn free_ways(
    map: &Localizer,
    samples: &[Sample],
    candidate: &RefinedPose,
) -> Option<(Vector3<f64>, [bool; 2])> {
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
    Some((along, [-SLIDE, SLIDE].map(is_as_likely)))
}

/// A candidate whose place is free both ways along a line, at the place of the prior on it: what the surfaces say of the position there is
/// chance. It may be anywhere up to `radius` metres from the prior, evenly, so that its standard deviation is `radius / sqrt(3)`. The
/// place of the prior must be as likely; other candidates stay.
pub(in crate::locate) fn held(
    map: &Localizer,
    samples: &[Sample],
    candidate: RefinedPose,
    prior: &Placement,
    radius: f64,
) -> RefinedPose {
    let Some((along, [true, true])) = free_ways(map, samples, &candidate) else {
        return candidate;
    };
    let mut placement = candidate.placement;
    placement.translation += along * (prior.translation - placement.translation).dot(&along);
    let evidence = evidence(map, &evenly(samples, VERIFIED_SAMPLES), &placement);
    if evidence.rank() < candidate.evidence.rank() - FREE {
        return candidate;
    }
    let free = Some((along * (radius / 3.0_f64.sqrt())).into());
    RefinedPose { placement, evidence, free }
}
