//! Where in a saved model a scan was taken, without an initial pose.
//!
//! The surfaces of the model are sampled once ([`Localizer`]); no point of the original cloud is needed. A query takes a few
//! steps, a file each:
//!
//! | file | what it does |
//! |---|---|
//! | `map/` | samples of the model's surfaces, and what is computed from them once |
//! | `map/grid`, `pyramid`, `nearest` | cells of the map: which way surfaces in and near them face, the nearest sample |
//! | `samples` | the scan as oriented samples, one per voxel |
//! | `directions` | the directions that surfaces face |
//! | `rotations` | rotations that take the scan's directions to the map's, or turns about the vertical |
//! | `search` | translations by branch and bound on the pyramid |
//! | `refine` | point to plane on the map's surfaces |
//! | `free` | motions that no surface fixes |
//! | `covariance` | how uncertain a pose is |
//! | `decide/` | which poses are accepted, with what probability; why none is |
//! | `decide/verify` | surfaces explained and rays through mapped surfaces |
//! | `decide/slide` | whether a pose is fixed in every direction, and where a prior holds it |
//! | `placement` | a pose in the map's own frame |
//! | `constants` | tuned constants of all steps |
//!
//! Source: branch and bound over translations as W. Hess, D. Kohler, H. Rapp, D. Andor: Real-Time Loop Closure in 2D LIDAR SLAM,
//! ICRA 2016, in three dimensions and on the axes that surfaces face; directions and offsets of planes instead of all
//! rotations after K. Pathak, A. Birk, N. Vaskevicius, J. Poppinga: Fast Registration Based on Noisy Planes With Unknown
//! Correspondences for 3-D Mapping, T-RO 2010.

mod constants;
mod covariance;
mod decide;
mod directions;
mod free;
mod map;
mod placement;
mod refine;
mod rotations;
mod samples;
mod search;

use nalgebra::{UnitQuaternion, Vector3};
use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Pose, Progress};
use surfabet_models::{Error, Result};

use self::constants::{
    FINALISTS, FINE_REACH, FINE_SAMPLES, FINE_STEPS, LEAST_ANGLE, LEAST_RADIUS, ROUGH_REACH,
    ROUGH_SAMPLES, ROUGH_STEPS, SCAN_DIRECTIONS, SHARES_OF_BEST, VERIFIED_SAMPLES,
};
pub use self::decide::Refusal;
use self::decide::{Demands, RefinedPose, decide, evidence};
use self::directions::Directions;
use self::free::FreeMotion;
pub use self::map::Localizer;
use self::map::evenly;
use self::placement::Placement;
use self::refine::refine;
use self::rotations::{Allowed, rotations};
use self::samples::{Sample, ScanSamples};
use self::search::Search;

/// What is known of the pose before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Scan to world, about.
    pub pose: Pose,
    /// How far the sensor may be from there, metres.
    pub radius: f64,
    /// How far the scan may be turned from it, radians.
    pub angle: f64,
}

/// How a scan is located.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocateOptions {
    /// What is known of the pose before.
    pub prior: Option<Prior>,
    /// True when the vertical of the scan is that of the map within 45 degrees, false when it can be any; `None` tries
    /// upright poses first, and at all others when none of these is accepted.
    pub upright: Option<bool>,
    /// Most places that are given.
    pub top: usize,
}

impl Default for LocateOptions {
    fn default() -> Self {
        Self { prior: None, upright: None, top: 5 }
    }
}

/// A place where the scan may have been taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// Takes the scan to the world of the model.
    pub pose: Pose,
    /// How well the scan's surfaces lie on those of the map, 0 to 1: the mean over the scan of `exp(-d^2 / (2 s^2))` of
    /// distances d, with s a third of a cell of the map.
    pub score: f64,
    /// How likely this is the place, of all that were found, 0 to 1. Zero where it is rejected, unless the scan is ambiguous.
    pub probability: f64,
    /// Covariance of the pose: rows and columns x, y, z of the sensor in the world in metres, then turns about the world's x,
    /// y, z in radians.
    pub covariance: [[f64; 6]; 6],
    /// Share of the scan that lies on mapped surfaces.
    pub explained: f64,
    /// Share of the scan that was seen through mapped surfaces.
    pub contradicted: f64,
    /// Share of the scan that lies on nothing mapped and hides a mapped surface.
    pub in_front: f64,
}

/// The answer to one scan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Located {
    /// Places that are accepted, the likeliest first: several where places look alike.
    pub locations: Vec<Location>,
    /// Why none is accepted.
    pub refusal: Option<Refusal>,
    /// The best places that are not accepted: where the scan is ambiguous those that it fits, with probabilities.
    pub rejected: Vec<Location>,
    /// How many places the scan fits, beyond [`LocateOptions::top`] too: those that are accepted, or none of which is since the scan is
    /// ambiguous. Zero where it is refused for another reason.
    pub places: usize,
    /// Directions along which nothing in the scan fixes the position, unit vectors in the world: one in a corridor, two over a floor. Of a
    /// refusal as [`Refusal::Loose`], or of the best accepted place, which a prior holds there.
    pub free_along: Vec<[f64; 3]>,
    /// Axes about which nothing fixes how the scan is turned, unit vectors in the world: of a floor its normal, of a tunnel its axis.
    pub free_about: Vec<[f64; 3]>,
}

impl Located {
    /// Whether the scan fits in several places, be they accepted or not, or anywhere along a line.
    pub fn is_ambiguous(&self) -> bool {
        self.places > 1 || self.refusal.is_some_and(|refusal| refusal.is_ambiguous())
    }

    fn set_free(&mut self, motions: &[FreeMotion]) {
        let (shifts, turns): (Vec<&FreeMotion>, Vec<&FreeMotion>) =
            motions.iter().partition(|m| m.is_shift());
        self.free_along = shifts.iter().map(|m| m.shift.into()).collect();
        self.free_about = turns.iter().map(|m| m.turn.into()).collect();
    }
}

impl Localizer {
    /// Where a scan was taken. The sensor stands at the zero of the scan's own coordinates, unless the cloud has viewpoints.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for options outside their domain, [`Error::Cancelled`].
    pub fn locate(
        &self,
        scan: &PointCloud,
        options: &LocateOptions,
        progress: &dyn Progress,
    ) -> Result<Located> {
        options.check(self.cell)?;
        let samples = ScanSamples::of(scan, self.cell);
        let sensor = samples.sensor();
        let near = options.prior.as_ref().map(|prior| {
            let placement = Placement::of(&prior.pose, self.origin, sensor);
            Near { placement, radius: prior.radius, angle: prior.angle }
        });
        let query = Query { map: self, samples: &samples.all, near };
        if let Some(refusal) = query.refusal() {
            return Ok(Located { refusal: Some(refusal), ..Located::default() });
        }
        let (domain, searches) = self.searches(near, options.upright, samples.reach());
        let mut answer = Located::default();
        for allowed in searches {
            let before = std::mem::take(&mut answer);
            let rotations = query.rotations(allowed);
            let is_tilted = allowed == Allowed::Tilted;
            let demands = Demands::of(&samples.all, is_tilted, options.prior.is_some());
            let is_narrow = decide::is_narrow(&samples.all);
            // What is tilted needs a clear answer; what a narrow view fits has to be counted.
            let shares = match (is_tilted, is_narrow) {
                (true, _) => &SHARES_OF_BEST[..1],
                (_, true) => &SHARES_OF_BEST[1..],
                _ => &SHARES_OF_BEST[..],
            };
            for &share in shares {
                progress.check()?;
                let mut candidates = query.candidates(&rotations, domain, share);
                progress.check()?;
                let is_clear = candidates.first().is_some_and(|c| c.is_clear(&demands));
                if is_clear && !is_tilted && !is_narrow && options.prior.is_none() {
                    query.add_alternatives(&mut candidates, domain);
                }
                let image = || query.image_rank(allowed, domain, share);
                let asked = (sensor, options.top, query.near.as_ref());
                answer = decide(self, &samples.all, &candidates, &demands, &image, asked)?;
                if is_clear && !answer.locations.is_empty() {
                    return Ok(answer);
                }
            }
            if !answer.locations.is_empty() {
                break;
            }
            // Why no upright place is accepted is worth more than why no tilted one is.
            if !before.rejected.is_empty() {
                answer = before;
            }
        }
        Ok(answer)
    }

    /// Where sensors are sought, as the lower and upper corner of a box, and the turns that are allowed, one search after the other;
    /// of a scan that reaches so many metres.
    fn searches(
        &self,
        near: Option<Near>,
        upright: Option<bool>,
        reach: f32,
    ) -> ([[f32; 3]; 2], Vec<Allowed>) {
        let [low, high] = self.bounds;
        match (near, upright) {
            (Some(near), _) => {
                let at = near.placement.translation;
                // From further away than the scan reaches none of it falls on the map.
                let domain = [
                    std::array::from_fn(|a| ((at[a] - near.radius) as f32).max(low[a] - reach)),
                    std::array::from_fn(|a| ((at[a] + near.radius) as f32).min(high[a] + reach)),
                ];
                (domain, vec![Allowed::About(near.placement.rotation, near.angle)])
            }
            (None, None) => (self.bounds, vec![Allowed::Upright, Allowed::Tilted]),
            (None, Some(true)) => (self.bounds, vec![Allowed::Upright]),
            (None, Some(false)) => (self.bounds, vec![Allowed::Any]),
        }
    }
}

impl LocateOptions {
    /// For a map with cells of this side.
    fn check(&self, cell: f64) -> Result<()> {
        if let Some(Prior { radius, angle, .. }) = self.prior {
            let least = LEAST_RADIUS * cell;
            if !(radius >= least && radius.is_finite()) {
                let requirement = format!(
                    "at least {least:.2} m: in cells of {cell:.2} m a place is not told from others that are nearer"
                );
                return Err(Error::invalid("radius", radius, requirement));
            }
            if !(angle >= LEAST_ANGLE && angle.is_finite()) {
                let degrees = angle.to_degrees();
                let requirement = format!("at least {} degrees", LEAST_ANGLE.to_degrees().round());
                return Err(Error::invalid("angle", format!("{degrees:.3} degrees"), requirement));
            }
        }
        if self.top == 0 {
            return Err(Error::invalid("top", 0, "at least 1"));
        }
        Ok(())
    }
}

/// About where the sensor is, as a prior says.
#[derive(Debug, Clone, Copy)]
struct Near {
    placement: Placement,
    /// Metres and radians that a place may be from there.
    radius: f64,
    angle: f64,
}

/// A scan and the map that it is looked for in.
struct Query<'a> {
    map: &'a Localizer,
    samples: &'a [Sample],
    near: Option<Near>,
}

impl Query<'_> {
    /// Why the scan cannot be located anywhere.
    fn refusal(&self) -> Option<Refusal> {
        let samples = self.samples.len();
        (samples < constants::LEAST_SAMPLES).then_some(Refusal::TooFewSurfaces { samples })
    }

    fn rotations(&self, allowed: Allowed) -> Vec<UnitQuaternion<f64>> {
        let normals: Vec<([f64; 3], f64)> = self
            .samples
            .iter()
            .filter(|s| s.is_flat())
            .map(|s| (surfabet_geom::vector::unit(s.normal.map(f64::from)), 1.0))
            .collect();
        let directions = Directions::of(&normals, SCAN_DIRECTIONS);
        rotations(self.map, &directions, allowed)
    }

    /// Adds to a clear answer what is as good after half a turn about the vertical, or elsewhere in the same direction, though
    /// less of it is mapped: a corridor is nearly the same from both ends.
    fn add_alternatives(&self, candidates: &mut Vec<RefinedPose>, domain: [[f32; 3]; 2]) {
        let Some(best) = candidates.first() else { return };
        let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let rotations = [best.placement.rotation, half * best.placement.rotation];
        let [_, share] = SHARES_OF_BEST;
        candidates.extend(self.candidates(&rotations, domain, share));
        decide::best_first(candidates, FINALISTS);
    }

    /// The rank of the best place of the scan's mirror image.
    fn image_rank(&self, allowed: Allowed, domain: [[f32; 3]; 2], share: f64) -> Option<f64> {
        let image: Vec<Sample> = self.samples.iter().map(Sample::mirrored).collect();
        let image = Query { samples: &image, ..*self };
        let found = image.candidates(&image.rotations(allowed), domain, share);
        found.first().map(|c| c.evidence.rank())
    }

    /// Refined poses with their evidence, the best first, of those that explain at least a share of what the best does.
    fn candidates(
        &self,
        rotations: &[UnitQuaternion<f64>],
        domain: [[f32; 3]; 2],
        share: f64,
    ) -> Vec<RefinedPose> {
        let is_narrow = decide::is_narrow(self.samples);
        let found = Search::new(self.map, self.samples, rotations, domain).run(share, is_narrow);
        let mut starts: Vec<Placement> = found.into_iter().map(|f| f.1).collect();
        // Where nothing is fixed the prior's own place is as good as any that the search comes upon.
        starts.extend(self.near.map(|near| near.placement));
        let rough = evenly(self.samples, ROUGH_SAMPLES);
        let mut candidates = parallel::map(&starts, |&start| {
            let placement = refine(self.map, &rough, start, ROUGH_REACH, ROUGH_STEPS);
            let evidence = evidence(self.map, &rough, &placement);
            RefinedPose { placement, evidence, free: Vec::new() }
        });
        self.keep_near(&mut candidates);
        decide::best_first(&mut candidates, FINALISTS);
        let (fine, verified) =
            (evenly(self.samples, FINE_SAMPLES), evenly(self.samples, VERIFIED_SAMPLES));
        let mut candidates = parallel::map(&candidates, |c| {
            let placement = refine(self.map, &fine, c.placement, FINE_REACH, FINE_STEPS);
            let evidence = evidence(self.map, &verified, &placement);
            let found = RefinedPose { placement, evidence, free: Vec::new() };
            match &self.near {
                Some(near) => decide::held(self.map, self.samples, &fine, found, near),
                None => found,
            }
        });
        self.keep_near(&mut candidates);
        decide::best_first(&mut candidates, FINALISTS);
        decide::keep_held(self.map, self.samples, &mut candidates);
        candidates
    }

    /// Removes places that refinement took farther away than the prior allows: what looks alike beyond is none of its answers.
    fn keep_near(&self, candidates: &mut Vec<RefinedPose>) {
        let Some(near) = self.near else { return };
        candidates.retain(|c| {
            let (away, turned) = c.placement.distance_to(&near.placement);
            away <= near.radius && turned <= near.angle
        });
    }
}
