//! Whether surfaces fix a pose: a corridor looks the same along its length, a floor all over and all around.

use crate::locate::Near;
use crate::locate::constants::{FINE_REACH, FREE, SAME_PLACE, SLIDE, SLIDE_TURN, VERIFIED_SAMPLES};
use crate::locate::free::{FreeMotion, FreeSpace, loose_motions, refine_beside};
use crate::locate::map::{Localizer, evenly};
use crate::locate::placement::Placement;
use crate::locate::refine::matched_system;
use crate::locate::samples::Sample;

use super::RefinedPose;
use super::verify::evidence;

/// Shares of the way from a place to that of the prior that are tried, where the prior's own does not fit.
const WAYS: [f64; 4] = [0.75, 0.5, 0.25, 0.0];

/// Motions along which a place is free: surfaces hold it little, and [`SLIDE`] metres or [`SLIDE_TURN`] radians farther one way at least
/// the evidence is as good.
pub(in crate::locate) fn free_motions(
    map: &Localizer,
    samples: &[Sample],
    candidate: &RefinedPose,
) -> Vec<FreeMotion> {
    let verified = evenly(samples, VERIFIED_SAMPLES);
    let mut motions =
        loose_motions(&matched_system(map, &verified, &candidate.placement, FINE_REACH[1]));
    let least = candidate.evidence.rank() - FREE;
    motions.retain(|m| ways(map, &verified, &candidate.placement, m, least).contains(&true));
    motions
}

/// Whether the evidence is at least `least` after a motion back and forth.
fn ways(
    map: &Localizer,
    verified: &[Sample],
    placement: &Placement,
    motion: &FreeMotion,
    least: f64,
) -> [bool; 2] {
    let by = if motion.is_shift() { SLIDE } else { SLIDE_TURN };
    [-by, by].map(|by| evidence(map, verified, &motion.applied(placement, by)).rank() > least)
}

/// A candidate whose place is free both ways along some motions, as near to the prior on these as it fits: what the surfaces say of the
/// position there is chance, and with the prior's the covariance says so. Other candidates stay.
pub(in crate::locate) fn held(
    map: &Localizer,
    samples: &[Sample],
    fine: &[Sample],
    candidate: RefinedPose,
    near: &Near,
) -> RefinedPose {
    let verified = evenly(samples, VERIFIED_SAMPLES);
    let mut motions =
        loose_motions(&matched_system(map, &verified, &candidate.placement, FINE_REACH[1]));
    let mut ways_left = WAYS.iter();
    let mut target = near.placement;
    while !motions.is_empty() {
        let placement = refine_beside(map, fine, &candidate.placement, &target, &motions);
        let evidence = evidence(map, &verified, &placement);
        let before = motions.len();
        if evidence.rank() > candidate.evidence.rank() - FREE {
            let least = evidence.rank() - FREE;
            motions.retain(|m| ways(map, &verified, &placement, m, least) == [true; 2]);
            if motions.len() == before {
                return RefinedPose { placement, evidence, free: motions };
            }
        } else {
            let Some(&share) = ways_left.next() else { break };
            target = candidate.placement.between(&near.placement, share);
        }
    }
    candidate
}

/// Removes candidates that are one that is held by the prior, moved along what is free, unless they are clearly likelier: they are that
/// place.
pub(in crate::locate) fn keep_held(
    map: &Localizer,
    samples: &[Sample],
    candidates: &mut Vec<RefinedPose>,
) {
    let verified = evenly(samples, VERIFIED_SAMPLES);
    let mut next = 0;
    while next < candidates.len() {
        let other = candidates[next].clone();
        next += 1;
        if other.free.is_empty() {
            continue;
        }
        let system = matched_system(map, &verified, &other.placement, FINE_REACH[1]);
        let space = FreeSpace::new(&system, &other.free);
        candidates.retain(|c| {
            *c == other
                || space.distance(&other.placement, &c.placement) > SAME_PLACE.0
                || c.evidence.rank() > other.evidence.rank() + FREE
        });
        next = 1 + candidates.iter().position(|c| *c == other).unwrap_or(next);
    }
}
