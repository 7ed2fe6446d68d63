//! What occurs in a scene again and again: unsupervised classes of things, as groups of occurrences that lie to each other in
//! the same way in several places.
//!
//! | file | step |
//! |---|---|
//! | `options` | the options |
//! | `candidates` | regions that may be a thing: what hangs together beside walls, floors and other large surfaces |
//! | `growth` | the thing that a piece belongs to: what stands beside it in the same way wherever it occurs |
//! | `mod` | classes: the largest thing that occurs often enough, then the next of what is left |
//!
//! The paper on alphabets (000) counts on words that recur; a class is the same one level up. Candidates are taken from large to
//! small, so that a chair is a class and its legs are not. What touches others of its kind, such as one of a row of shelves, is no candidate,
//! and one of its pieces grows to it.

mod candidates;
mod growth;
mod options;

use surfabet_geom::{Part, Progress};
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::options::Options;
use surfabet_models::{Error, Result, Stages};

use self::candidates::candidates;
use self::growth::Growth;
pub use self::options::RecurringOptions;
use super::constants::{
    CLAIMED, GROWN_LEAST, GROWN_PLACES, GROWN_SCORE, LEAST_GROWTH, LEAST_SPACING_OF_THINGS,
    MAX_SAMPLES_OF_THINGS, RECURRING_FINALISTS, RECURRING_GUESSES,
};
use super::find::{Budget, FIND_STAGES, Found, Lengths, Motion, Region, SearchScene, Side};
use super::find::{Template, median_sigma, places_like};
use super::surface::spacing_for;

/// A class of things that recur.
#[derive(Debug, Clone, PartialEq)]
pub struct RecurringClass {
    /// A box around the thing that stands for the class, world coordinates.
    pub example: Region,
    /// Where it occurs, itself first, then the best first.
    pub places: Vec<Found>,
    /// Numbers of the occurrences of words that each place consists of, ascending.
    pub occurrences: Vec<Vec<u32>>,
}

/// Share of the progress that goes into sampling the surface.
const SAMPLING: f32 = 0.1;

/// Classes of things that occur at least `options.min_count` times, the largest things first.
///
/// Candidates are what hangs together beside large smooth surfaces, at most `options.max_size` wide, and smooth pieces of it. The largest is searched
/// for in the scene, as by [`find`](crate::find()), and grown by what stands beside it in the same way at several of its places. When
/// it, or the larger thing that it grows to, is found often enough, their samples belong to no other; then the next. Of these things the largest is a class, then the
/// largest of which enough places are left.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain, [`Error::TooManyPoints`] when the spacing of samples is
/// too close, [`Error::Cancelled`].
pub fn recurring(
    model: &AlphabetModel,
    options: &RecurringOptions,
    progress: &dyn Progress,
) -> Result<Vec<RecurringClass>> {
    options.check()?;
    if options.min_size >= options.max_size {
        let value = format!("{} m", options.min_size);
        return Err(Error::invalid("min_size", value, "less than max_size"));
    }
    let Some(sigma) = median_sigma(model, |_| true) else { return Ok(Vec::new()) };
    let spacing = spacing_of(model, options, sigma)?;
    let part = Part::named(progress, "sampling the surface", 0.0..SAMPLING);
    let scene = SearchScene::new(model, spacing, options.color_tolerance, &part)?;
    let (regions, parts) = candidates(&scene, options, progress)?;
    let mut classes = Classes {
        model,
        side: Side::new(model, &scene),
        tolerance: options.tolerance.unwrap_or(sigma),
        options,
        growth: Growth { scene: &scene, parts: &parts, max_size: options.max_size },
        claimed: vec![false; scene.surface.len()],
        things: Vec::new(),
    };
    for (k, region) in regions.iter().enumerate() {
        let at = |k: usize| SAMPLING + (1.0 - SAMPLING) * k as f32 / regions.len() as f32;
        classes.try_candidate(region, &Part::new(progress, at(k)..at(k + 1)))?;
    }
    classes.chosen()
}

/// The spacing of samples: that of the options, or one that is no closer than the model, and than it has [`MAX_SAMPLES_OF_THINGS`] for.
///
/// # Errors
/// [`Error::InvalidParameter`] for a `resolution` with more samples.
fn spacing_of(model: &AlphabetModel, options: &RecurringOptions, sigma: f64) -> Result<f64> {
    let wished = options.resolution.unwrap_or(sigma.max(LEAST_SPACING_OF_THINGS));
    let least = spacing_for(model, wished, MAX_SAMPLES_OF_THINGS);
    if !least.is_finite() {
        let requirement = format!("a scene of at most {MAX_SAMPLES_OF_THINGS} words");
        return Err(Error::invalid(
            "scene",
            format!("a model of {} words", model.len()),
            requirement,
        ));
    }
    match options.resolution {
        Some(given) if least > given => {
            // Rounded up, so that it may be given.
            let least = (1000.0 * least).ceil() / 1000.0;
            let requirement = format!(
                "at least {least} m: closer, the scene has more than {} million samples, each of which is compared with others",
                MAX_SAMPLES_OF_THINGS / 1_000_000
            );
            Err(Error::invalid("resolution", given, requirement))
        }
        _ => Ok(least),
    }
}

/// A place of a thing with its score, and the samples that the thing covers there.
type ScoredPlace = ((f64, Motion), Vec<u32>);

/// A thing that may stand for a class.
struct Thing {
    region: Region,
    template: Template,
    /// At least one, the best first: the thing itself.
    places: Vec<ScoredPlace>,
}

impl Thing {
    /// Samples of the best place.
    fn size(&self) -> f64 {
        self.places[0].1.len() as f64
    }
}

/// Classes as they are found.
struct Classes<'a> {
    model: &'a AlphabetModel,
    side: Side<'a>,
    tolerance: f64,
    options: &'a RecurringOptions,
    growth: Growth<'a>,
    /// Whether a sample belongs to a thing.
    claimed: Vec<bool>,
    things: Vec<Thing>,
}

impl Classes<'_> {
    /// Makes a thing of a region, or a larger one that what it shows is a piece of, when it occurs often enough and belongs to no
    /// thing yet.
    fn try_candidate(&mut self, region: &Region, progress: &dyn Progress) -> Result<()> {
        let Some(template) = self.template(region)? else { return Ok(()) };
        if self.is_claimed(&template.covered(self.side.scene, &Motion::NONE)) {
            return Ok(());
        }
        let budget = Budget { guesses: RECURRING_GUESSES, finalists: RECURRING_FINALISTS };
        let mut stages = Stages::new(FIND_STAGES, progress);
        let mut places = places_like(&template, &self.side, &self.side, budget, &mut stages)?;
        places.push((1.0, Motion::NONE));
        let grown = self.grown(&template, &places, progress)?;
        let found = self.thing(region, template, places, self.options.min_score);
        let size = |thing: &Option<Thing>| thing.as_ref().map_or(0.0, Thing::size);
        let is_larger = size(&grown) > LEAST_GROWTH * size(&found);
        let Some(thing) = (if is_larger { grown } else { found }) else { return Ok(()) };
        self.claim(&thing);
        self.things.push(thing);
        Ok(())
    }

    /// The thing that a template with these places is a piece of, when it occurs often enough.
    fn grown(
        &self,
        template: &Template,
        places: &[(f64, Motion)],
        progress: &dyn Progress,
    ) -> Result<Option<Thing>> {
        let mut places = places.to_vec();
        places.retain(|(score, _)| *score >= GROWN_SCORE);
        let places = template.places_apart(places, GROWN_PLACES);
        let motions: Vec<Motion> = places.into_iter().map(|p| p.1).collect();
        let least = self.options.min_count as usize;
        let (samples, motions) = self.growth.of(template, &motions, least, progress)?;
        let Some(region) = self.growth.region(&samples) else { return Ok(None) };
        if region.diagonal() > self.options.max_size {
            return Ok(None);
        }
        let Some(larger) = self.template(&region)? else { return Ok(None) };
        let about: Vec<(f64, Motion)> =
            motions.iter().map(|m| (0.0, template.about(m, larger.pivot))).collect();
        let refined = larger.refine_finely(self.side.scene, &about, progress)?;
        let mut places = larger.score_plainly(self.side.scene, &refined, progress)?;
        places.push((1.0, Motion::NONE));
        Ok(self.thing(&region, larger, places, GROWN_LEAST * self.options.min_score))
    }

    fn template(&self, region: &Region) -> Result<Option<Template>> {
        let lengths = Lengths {
            diagonal: region.diagonal(),
            spacing: self.side.scene.surface.spacing,
            tolerance: self.tolerance,
            surroundings: None,
            size_tolerance: self.options.size_tolerance,
        };
        Template::new(self.side.scene, region, &lengths)
    }

    /// A region with those of its places that score at least `least`, and of which most may belong to a thing; `None` when they are too few.
    fn thing(
        &self,
        region: &Region,
        template: Template,
        mut places: Vec<(f64, Motion)>,
        least: f64,
    ) -> Option<Thing> {
        places.retain(|(score, _)| *score >= least);
        let mut kept: Vec<ScoredPlace> = Vec::new();
        for place in template.best_places(places, usize::MAX) {
            let covered = template.covered(self.side.scene, &place.1);
            // What looks like a side of a box may be a bare piece of a wall.
            if 2 * self.own(&covered).len() > covered.len() {
                kept.push((place, covered));
            }
        }
        let is_enough = kept.len() >= self.options.min_count as usize;
        is_enough.then_some(Thing { region: *region, template, places: kept })
    }

    /// The classes: the largest thing, then the largest of which enough places are left.
    fn chosen(mut self) -> Result<Vec<RecurringClass>> {
        let mut things = std::mem::take(&mut self.things);
        // Of equal ones that which was found first.
        things.sort_by(|a, b| b.size().total_cmp(&a.size()));
        self.claimed.fill(false);
        let mut found = Vec::new();
        for mut thing in things {
            thing.places.retain(|(_, covered)| !self.is_claimed(covered));
            if thing.places.len() >= self.options.min_count as usize {
                self.claim(&thing);
                found.push(self.class(&thing, found.len())?);
            }
        }
        Ok(found)
    }

    fn class(&self, thing: &Thing, number: usize) -> Result<RecurringClass> {
        let origin = self.model.header().origin;
        // Around its own samples: the region of a piece is wider, and reaches into the floor below it.
        let own = thing.places.iter().find(|(place, _)| place.1 == Motion::NONE);
        let own: Vec<u32> = own.map_or_else(Vec::new, |(_, covered)| self.own(covered));
        let around = self.growth.region(&own).unwrap_or(thing.region);
        let region = thing.region.shared_with(&around);
        let example = region.about(origin.map(|c| -c));
        let found = |(place, covered): &ScoredPlace| -> Result<(Found, Vec<u32>)> {
            let found = thing.template.found(*place, &example, number, [origin; 2])?;
            Ok((found, self.occurrences_of(&self.own(covered))))
        };
        let (places, occurrences) =
            thing.places.iter().map(found).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        Ok(RecurringClass { example, places, occurrences })
    }

    fn claim(&mut self, thing: &Thing) {
        let covered = thing.places.iter().flat_map(|(_, covered)| covered);
        covered.for_each(|&i| self.claimed[i as usize] = true);
    }

    /// Whether most of some samples belong to a thing.
    fn is_claimed(&self, samples: &[u32]) -> bool {
        let claimed = samples.iter().filter(|&&i| self.claimed[i as usize]).count();
        claimed as f64 > CLAIMED * samples.len() as f64
    }

    /// Those of some samples that may belong to a thing.
    fn own(&self, samples: &[u32]) -> Vec<u32> {
        samples.iter().copied().filter(|&i| self.growth.parts[i as usize]).collect()
    }

    /// Occurrences with samples among these.
    fn occurrences_of(&self, samples: &[u32]) -> Vec<u32> {
        let of = &self.side.scene.surface.occurrences;
        let mut all: Vec<u32> = samples.iter().map(|&i| of[i as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}
