//! Which poses are accepted, with what probability, and why none is.

mod slide;
mod verify;

use std::fmt;

use nalgebra::Vector3;
use surfabet_geom::vector;
use surfabet_models::Result;

use super::constants::{
    AGAINST_PER_EXPLAINED, CLEARLY_EXPLAINED, DOUBT, FACTS_AGAINST, FACTS_FOR, FINE_SAMPLES,
    FULLY_INSIDE, HOPELESS, LEAST_EXPLAINED, LEAST_PROBABILITY, LEAST_SAMPLES, LOOSE_MARGIN,
    MIRROR_MARGIN, MOST_AGAINST, MOST_ALIKE, NARROW, NARROW_EXPLAINED, ROW, ROW_EXPLAINED,
    SAME_PLACE, SECTORS, SURE, TILTED_AGAINST, TILTED_EXPLAINED, UNKNOWN,
};
use super::covariance::covariance;
use super::free::FreeMotion;
use super::map::{Localizer, evenly};
use super::placement::Placement;
use super::samples::Sample;
use super::{Located, Location, Near};
use slide::free_motions;
pub(super) use slide::{held, keep_held};
use verify::Evidence;
pub(super) use verify::evidence;

/// A refined pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RefinedPose {
    pub placement: Placement,
    pub evidence: Evidence,
    /// Motions along which the prior alone holds it.
    pub free: Vec<FreeMotion>,
}

impl RefinedPose {
    /// Whether it is accepted and explains so much that the search ends.
    pub fn is_clear(&self, demands: &Demands) -> bool {
        self.evidence.explained >= CLEARLY_EXPLAINED && self.evidence.refusal(demands).is_none()
    }
}

/// What a place must meet to be accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Demands {
    /// Least share explained.
    explained: f64,
    /// Largest share against, beside the limit that grows with what is explained.
    against: f64,
    /// Most places that may be as likely.
    alike: usize,
    /// Least probability of the only place.
    sure: f64,
    /// Whether surfaces must fix the position in every direction.
    fixed: bool,
    /// Whether a place of a row must be explained by more.
    rows: bool,
    /// Whether the scan must fit better than its mirror image.
    handed: bool,
}

impl Demands {
    /// More is asked of what is tilted, since an upside-down room looks much like a mirrored one; and of a narrow view, since a part
    /// of a scan fits in many places. A prior holds what no surface fixes.
    pub fn of(samples: &[Sample], is_tilted: bool, has_prior: bool) -> Self {
        let is_narrow = is_narrow(samples);
        let narrow = if is_narrow { NARROW_EXPLAINED } else { 0.0 };
        let tilted = if is_tilted { TILTED_EXPLAINED } else { 0.0 };
        Self {
            explained: LEAST_EXPLAINED.max(narrow).max(tilted),
            against: if is_tilted { TILTED_AGAINST } else { 1.0 },
            alike: if is_narrow { MOST_ALIKE } else { usize::MAX },
            sure: if is_narrow { SURE } else { 0.0 },
            fixed: !has_prior,
            rows: is_narrow && !has_prior,
            handed: is_narrow && !has_prior,
        }
    }
}

/// Whether a scan shows a part of what is around the sensor.
pub(super) fn is_narrow(samples: &[Sample]) -> bool {
    share_of_circle(samples) < NARROW
}

/// The share of the directions around the sensor's own vertical in which samples lie.
fn share_of_circle(samples: &[Sample]) -> f64 {
    let mut has_sample = [false; SECTORS];
    for s in samples {
        let [x, y, _] = vector::minus(s.point, s.viewpoint).map(f64::from);
        let turn = y.atan2(x) / std::f64::consts::TAU + 0.5;
        has_sample[((turn * SECTORS as f64) as usize).min(SECTORS - 1)] = true;
    }
    has_sample.iter().filter(|&&has| has).count() as f64 / SECTORS as f64
}

/// Why no place is accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Refusal {
    /// The scan has too few surfaces to be recognised by.
    TooFewSurfaces {
        /// Voxels with points.
        samples: usize,
    },
    /// Nowhere in the map do the scan's surfaces fit.
    NoPlace,
    /// At the best place too little of the scan lies on mapped surfaces.
    Unexplained {
        /// The share that does.
        explained: f64,
        /// The least share that is accepted.
        limit: f64,
    },
    /// At the best place the scan sees through mapped surfaces, or hides them.
    Contradicted {
        /// The share that does, of the samples that the pose explains or contradicts.
        contradicted: f64,
        /// The largest share that is accepted.
        limit: f64,
    },
    /// A narrow view fits in several places, too many for the right one to be surely among those that are found, or none of them well
    /// enough to be told from the others.
    Alike {
        /// How many were found.
        places: usize,
    },
    /// The best place is as likely farther along a line, such as a corridor without ends.
    Loose {
        /// Direction of the line in the world.
        along: [f64; 3],
    },
    /// The mirror image of a narrow view fits nearly as well: of what is the same in a mirror the view does not show which side it saw.
    Mirrored,
}

impl Refusal {
    /// The name of the reason, for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::TooFewSurfaces { .. } => "too few surfaces",
            Self::NoPlace => "no place",
            Self::Unexplained { .. } => "unexplained",
            Self::Contradicted { .. } => "contradicted",
            Self::Alike { .. } => "alike",
            Self::Loose { .. } => "loose",
            Self::Mirrored => "mirrored",
        }
    }

    /// Whether the scan fits, but in more than one place, in several or anywhere along a line, or so does its mirror image.
    pub fn is_ambiguous(&self) -> bool {
        matches!(self, Self::Alike { .. } | Self::Loose { .. } | Self::Mirrored)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFewSurfaces { samples: 0 } => write!(f, "the scan has no points"),
            Self::TooFewSurfaces { samples } => write!(
                f,
                "the scan has points in {samples} voxels only, and at least {LEAST_SAMPLES} are needed"
            ),
            Self::NoPlace => write!(f, "nowhere in the map do the surfaces of the scan fit"),
            Self::Unexplained { explained, limit } => write!(
                f,
                "at the best place {:.0} % of the scan lie on mapped surfaces, less than {:.0} %",
                100.0 * explained,
                100.0 * limit
            ),
            Self::Contradicted { contradicted, limit } => write!(
                f,
                "at the best place the map contradicts {:.0} % of the scan, more than {:.0} %",
                100.0 * contradicted,
                100.0 * limit
            ),
            Self::Alike { places } => {
                write!(f, "ambiguous: a view this narrow fits in at least {places} places alike")
            }
            Self::Loose { along: [x, y, z] } => write!(
                f,
                "ambiguous: the map looks the same along the direction ({x:.2}, {y:.2}, {z:.2}), \
                 and nothing in the scan fixes the position on it"
            ),
            Self::Mirrored => write!(
                f,
                "ambiguous: a view this narrow must fit clearly better than its mirror image, and fits \
                 in no place so"
            ),
        }
    }
}

impl Evidence {
    /// Logarithm of the likelihood, up to a constant. Samples neither explained nor contradicted count as a share [`UNKNOWN`] of what
    /// is explained as closely as the rest: the scan may see beyond the map.
    pub fn rank(&self) -> f64 {
        let unknown = (1.0 - self.explained - self.contradicted - self.in_front).max(0.0);
        let closeness = self.closeness * (1.0 + UNKNOWN * unknown / self.explained.max(0.1));
        FACTS_FOR * closeness - FACTS_AGAINST * (self.contradicted + 0.5 * self.in_front)
    }

    /// The largest share against that is accepted: more of it where more is explained.
    fn limit(&self) -> f64 {
        let more = (self.explained - FULLY_INSIDE).max(0.0);
        MOST_AGAINST + AGAINST_PER_EXPLAINED * more
    }

    /// Share against the pose, of the samples that it explains or contradicts.
    fn against(&self) -> f64 {
        let against = self.contradicted + self.in_front;
        against / (against + self.explained).max(1e-9)
    }

    fn refusal(&self, demands: &Demands) -> Option<Refusal> {
        let (explained, contradicted) = (self.explained, self.against());
        if explained < demands.explained {
            return Some(Refusal::Unexplained { explained, limit: demands.explained });
        }
        let limit = self.limit().min(demands.against);
        if contradicted > limit {
            return Some(Refusal::Contradicted { contradicted, limit });
        }
        None
    }
}

/// Sorts candidates and drops those that are at the place of a better one or much less likely than the best; at most `most` stay.
pub(super) fn best_first(candidates: &mut Vec<RefinedPose>, most: usize) {
    candidates.sort_by(|a, b| b.evidence.rank().total_cmp(&a.evidence.rank()));
    let best = candidates.first().map_or(0.0, |c| c.evidence.rank());
    let mut kept: Vec<RefinedPose> = Vec::new();
    for c in candidates.iter().take_while(|c| c.evidence.rank() >= best - HOPELESS) {
        let is_same = |other: &RefinedPose| {
            let (away, turned) = c.placement.distance_to(&other.placement);
            away < SAME_PLACE.0 && turned < SAME_PLACE.1
        };
        if kept.len() < most && !kept.iter().any(is_same) {
            kept.push(c.clone());
        }
    }
    *candidates = kept;
}

/// The direction of the row that a candidate is of: [`ROW`] others are turned as it is and lie on one line with it.
fn row_of(c: &RefinedPose, candidates: &[RefinedPose]) -> Option<[f64; 3]> {
    let turned_alike = |other: &&RefinedPose| {
        let (away, turned) = c.placement.distance_to(&other.placement);
        away > 0.0 && turned < SAME_PLACE.1
    };
    let steps: Vec<Vector3<f64>> = candidates
        .iter()
        .filter(turned_alike)
        .map(|other| other.placement.translation - c.placement.translation)
        .collect();
    let is_row = |along: &Vector3<f64>| {
        let on_line = |step: &&Vector3<f64>| step.cross(along).norm() < SAME_PLACE.0;
        steps.iter().filter(on_line).count() >= ROW
    };
    steps.iter().map(|step| step.normalize()).find(is_row).map(Into::into)
}

/// Why each candidate is refused, when `places` are likely.
///
/// Where a place whose position is free along a line is nearly as likely as the best of the others, all are refused: the place
/// may be any on that line, and a step along it that happens to fit less well does not make one of them certain.
fn refusals(
    map: &Localizer,
    samples: &[Sample],
    candidates: &[RefinedPose],
    demands: &Demands,
    places: usize,
) -> Vec<Option<Refusal>> {
    let of = |c: &RefinedPose| -> Option<Refusal> {
        let too_many = || (places > demands.alike).then_some(Refusal::Alike { places });
        let loose = || {
            let free = if demands.fixed { free_motions(map, samples, c) } else { Vec::new() };
            let along = free.iter().find(|m| m.is_shift())?;
            Some(Refusal::Loose { along: along.shift.into() })
        };
        c.evidence.refusal(demands).or_else(too_many).or_else(loose)
    };
    let mut refusals: Vec<Option<Refusal>> = candidates.iter().map(of).collect();
    for (c, refusal) in candidates.iter().zip(&mut refusals) {
        if demands.rows && refusal.is_none() && c.evidence.explained < ROW_EXPLAINED {
            *refusal = row_of(c, candidates).map(|along| Refusal::Loose { along });
        }
    }
    let rank = |found: Option<usize>| found.map(|i| candidates[i].evidence.rank());
    let loose = refusals.iter().position(|r| matches!(r, Some(Refusal::Loose { .. })));
    let fixed = refusals.iter().position(Option::is_none);
    if rank(loose) > rank(fixed).map(|r| r - LOOSE_MARGIN) {
        let loose = loose.and_then(|i| refusals[i]);
        refusals.iter_mut().filter(|r| r.is_none()).for_each(|r| *r = loose);
    }
    refusals
}

/// Refuses places of a narrow view that cannot be told from others, and gives the reason if there are such: all with much against
/// them, unless one is sure, and then one that is left alone and not sure. `shares` are probabilities among all candidates.
fn refuse_doubtful(
    candidates: &[RefinedPose],
    refusals: &mut [Option<Refusal>],
    demands: &Demands,
    shares: &[f64],
) -> Option<Refusal> {
    let alike = Refusal::Alike { places: likely(shares).max(2) };
    let is_sure = |share: f64| share >= demands.sure;
    let before = refusals.iter().filter(|r| r.is_none()).count();
    if !shares.iter().copied().any(is_sure) {
        for (c, refusal) in candidates.iter().zip(refusals.iter_mut()) {
            if c.evidence.against() > MOST_AGAINST {
                refusal.get_or_insert(alike);
            }
        }
    }
    let mut left = refusals.iter_mut().zip(shares).filter(|(r, _)| r.is_none());
    if let (Some((refusal, &share)), None) = (left.next(), left.next())
        && !is_sure(share)
    {
        *refusal = Some(alike);
    }
    let after = refusals.iter().filter(|r| r.is_none()).count();
    (before > 0 && after == 0).then_some(alike)
}

/// Refuses all places of a view whose mirror image has nearly the `best` rank, and gives the reason if there were such: a hall that is
/// the same in a mirror has both, and the view does not tell which of them it saw. The `image` is looked for where a place is left.
fn refuse_mirrored(
    refusals: &mut [Option<Refusal>],
    best: f64,
    image: &dyn Fn() -> Option<f64>,
) -> Option<Refusal> {
    let is_doubtful = refusals.iter().any(Option::is_none)
        && image().is_some_and(|rank| rank > best - MIRROR_MARGIN);
    is_doubtful.then(|| {
        refusals.iter_mut().for_each(|refusal| {
            refusal.get_or_insert(Refusal::Mirrored);
        });
        Refusal::Mirrored
    })
}

/// How many of the places are likely.
fn likely(shares: &[f64]) -> usize {
    shares.iter().filter(|&&share| share >= LEAST_PROBABILITY).count()
}

/// The answer from distinct candidates, the best first. `image` is the rank of the best place of the scan's mirror image.
pub(super) fn decide(
    map: &Localizer,
    samples: &[Sample],
    candidates: &[RefinedPose],
    demands: &Demands,
    image: &dyn Fn() -> Option<f64>,
    (sensor, top, near): ([f64; 3], usize, Option<&Near>),
) -> Result<Located> {
    let fine = evenly(samples, FINE_SAMPLES);
    let location = |c: &RefinedPose, probability: f64| -> Result<Location> {
        Ok(Location {
            pose: c.placement.pose(map.origin, sensor)?,
            score: c.evidence.closeness,
            probability,
            covariance: covariance(map, &fine, &c.placement, &c.free, near),
            explained: c.evidence.explained,
            contradicted: c.evidence.contradicted,
            in_front: c.evidence.in_front,
        })
    };
    let Some(best) = candidates.first() else {
        return Ok(Located { refusal: Some(Refusal::NoPlace), ..Located::default() });
    };
    // Probabilities among all, also those that are refused: a place that is refused by little still makes another doubtful.
    let ratio = |c: &RefinedPose| (c.evidence.rank() - best.evidence.rank()).exp();
    let sum: f64 = candidates.iter().map(ratio).sum();
    let shares: Vec<f64> = candidates.iter().map(|c| ratio(c) / sum).collect();
    let mut refusals = refusals(map, samples, candidates, demands, likely(&shares));
    let mut doubt = refuse_doubtful(candidates, &mut refusals, demands, &shares);
    if demands.handed {
        doubt = doubt.or(refuse_mirrored(&mut refusals, best.evidence.rank(), image));
    }
    // What the map contradicts less than the best may be the right one, of which less is mapped.
    let weight = |(c, refusal): (&RefinedPose, &Option<Refusal>)| {
        let is_doubt = refusal.is_none() && c.evidence.contradicted < best.evidence.contradicted;
        ratio(c).max(if is_doubt { DOUBT } else { 0.0 })
    };
    let weights: Vec<f64> = candidates.iter().zip(&refusals).map(weight).collect();
    let total: f64 = weights.iter().sum();
    let mut answer = Located::default();
    for ((c, refusal), weight) in candidates.iter().zip(&refusals).zip(weights) {
        if weight / total >= LEAST_PROBABILITY && refusal.is_none() {
            answer.locations.push(location(c, weight / total)?);
        } else {
            answer.rejected.push(location(c, 0.0)?);
        }
    }
    answer.places = answer.locations.len();
    let accepted = candidates.iter().zip(&refusals).find(|(_, refusal)| refusal.is_none());
    answer.set_free(accepted.map_or(&[], |(c, _)| &c.free));
    if answer.locations.is_empty() {
        answer.refusal = doubt.or(refusals[0]);
        if let Some(Refusal::Loose { along }) = answer.refusal {
            let free = candidates.iter().map(|c| free_motions(map, samples, c));
            let of_one = free.into_iter().find(|free| free.iter().any(FreeMotion::is_shift));
            answer.set_free(&of_one.unwrap_or_else(|| vec![FreeMotion::along(along)]));
        }
    }
    // The places that an ambiguous scan fits are worth knowing, though none is accepted.
    if answer.refusal.is_some_and(|r| r.is_ambiguous()) {
        answer.places = likely(&shares);
        answer.rejected.iter_mut().zip(&shares).for_each(|(r, &share)| r.probability = share);
    }
    answer.locations.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    answer.locations.truncate(top);
    answer.rejected.truncate(top);
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// Candidates at these places, turned about the vertical.
    fn candidates(places: &[([f64; 3], f64)]) -> Vec<RefinedPose> {
        let of = |&(translation, yaw): &([f64; 3], f64)| RefinedPose {
            placement: Placement {
                rotation: UnitQuaternion::from_euler_angles(0.0, 0.0, yaw),
                translation: translation.into(),
            },
            evidence: Evidence::default(),
            free: Vec::new(),
        };
        places.iter().map(of).collect()
    }

    #[test]
    fn one_place_of_a_narrow_view_must_be_sure() {
        let demands = Demands {
            explained: NARROW_EXPLAINED,
            against: 1.0,
            alike: MOST_ALIKE,
            sure: SURE,
            fixed: true,
            rows: true,
            handed: true,
        };
        let other = Some(Refusal::Unexplained { explained: 0.5, limit: NARROW_EXPLAINED });
        let of = |shares: [f64; 2], contradicted: f64, before: [Option<Refusal>; 2]| {
            let mut found = candidates(&[([0.0; 3], 0.0), ([5.0, 0.0, 0.0], 0.0)]);
            for c in &mut found {
                c.evidence.explained = 0.9;
                c.evidence.contradicted = contradicted;
            }
            let mut refusals = before;
            let doubt = refuse_doubtful(&found, &mut refusals, &demands, &shares);
            (doubt, refusals.map(|r| r.is_none()))
        };
        let alike = Some(Refusal::Alike { places: 2 });
        assert_eq!(of([0.96, 0.04], 0.0, [None, other]), (None, [true, false]));
        assert_eq!(of([0.94, 0.06], 0.0, [None, other]), (alike, [false, false]));
        // Two that are named need not be sure, but little may be against them.
        assert_eq!(of([0.6, 0.4], 0.0, [None, None]), (None, [true, true]));
        assert_eq!(of([0.6, 0.4], 0.1, [None, None]), (alike, [false, false]));
        assert_eq!(of([0.96, 0.04], 0.1, [None, None]), (None, [true, true]));
        // What was refused before keeps its reason.
        assert_eq!(of([0.6, 0.4], 0.0, [other, other]), (None, [false, false]));
    }

    #[test]
    fn a_view_must_fit_better_than_its_mirror_image() {
        let of = |image: Option<f64>| {
            let mut refusals = [None, Some(Refusal::NoPlace), None];
            (refuse_mirrored(&mut refusals, 20.0, &|| image), refusals)
        };
        let (mirrored, other) = (Some(Refusal::Mirrored), Some(Refusal::NoPlace));
        assert_eq!(of(None), (None, [None, other, None]));
        assert_eq!(of(Some(20.0 - MIRROR_MARGIN - 0.01)), (None, [None, other, None]));
        assert_eq!(of(Some(20.0 - MIRROR_MARGIN + 0.01)), (mirrored, [mirrored, other, mirrored]));
        assert_eq!(of(Some(25.0)), (mirrored, [mirrored, other, mirrored]));
        // Where no place is left its mirror image is not looked for.
        let mut refused = [other];
        assert_eq!(refuse_mirrored(&mut refused, 20.0, &|| unreachable!()), None);
    }

    #[test]
    fn four_places_on_a_line_are_a_row() {
        let row = [
            ([0.0; 3], 0.0),
            ([3.0, 0.1, 0.0], 0.0),
            ([-6.0, 0.0, 0.2], 0.05),
            ([9.0, 0.0, 0.0], 0.0),
        ];
        let found = candidates(&row);
        let along = row_of(&found[0], &found).unwrap();
        assert!(along[0].abs() > 0.99);
        // One fewer, one turned another way, one beside the line.
        assert_eq!(row_of(&found[0], &found[..3]), None);
        for other in [([9.0, 0.0, 0.0], 1.5), ([9.0, 4.0, 0.0], 0.0)] {
            let found = candidates(&[row[0], row[1], row[2], other]);
            assert_eq!(row_of(&found[0], &found), None);
        }
    }
}
