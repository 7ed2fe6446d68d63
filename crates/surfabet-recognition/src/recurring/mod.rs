//! What occurs in a scene again and again: unsupervised classes of things, as groups of occurrences that lie to each other in
//! the same way in several places.
//!
//! | file | step |
//! |---|---|
//! | `options` | the options |
//! | `candidates` | regions that may be a thing: what hangs together beside walls, floors and other large surfaces |
//! | `mod` | classes: the largest candidate that occurs often enough, then the next of what is left |
//!
//! The paper on alphabets (000) counts on words that recur; a class is the same one level up. Candidates are taken from large to
//! small, so that a chair is a class and its legs are not.

mod candidates;
mod options;

use surfabet_geom::{Part, Progress};
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::options::Options;
use surfabet_models::{Error, Result, Stages};

use self::candidates::candidates;
pub use self::options::RecurringOptions;
use super::constants::{CLAIMED, LEAST_SPACING_OF_THINGS, RECURRING_FINALISTS, RECURRING_GUESSES};
use super::find::{Budget, FIND_STAGES, Found, Lengths, Motion, Region, SearchScene, Side};
use super::find::{Template, median_sigma, places_like};

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
/// Candidates are what hangs together beside large smooth surfaces, at most `options.max_size` wide. The largest is searched
/// for in the scene, as by [`find`](crate::find()); when it is found often enough, it and what was found are a class, and their
/// samples belong to no other. Then the next.
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
    let spacing = options.resolution.unwrap_or(sigma.max(LEAST_SPACING_OF_THINGS));
    let part = Part::named(progress, "sampling the surface", 0.0..SAMPLING);
    let scene = SearchScene::new(model, spacing, options.color_tolerance, &part)?;
    let regions = candidates(&scene, options, progress)?;
    let mut classes = Classes {
        model,
        scene: &scene,
        side: Side::new(model, &scene),
        tolerance: options.tolerance.unwrap_or(sigma),
        options,
        claimed: vec![false; scene.surface.len()],
        found: Vec::new(),
    };
    for (k, region) in regions.iter().enumerate() {
        let at = |k: usize| SAMPLING + (1.0 - SAMPLING) * k as f32 / regions.len() as f32;
        classes.try_candidate(region, &Part::new(progress, at(k)..at(k + 1)))?;
    }
    Ok(classes.found)
}

/// Classes as they are found.
struct Classes<'a> {
    model: &'a AlphabetModel,
    scene: &'a SearchScene,
    side: Side<'a>,
    tolerance: f64,
    options: &'a RecurringOptions,
    /// Whether a sample belongs to a class.
    claimed: Vec<bool>,
    found: Vec<RecurringClass>,
}

impl Classes<'_> {
    /// Makes a class of a region when what it shows occurs often enough and belongs to no class yet.
    fn try_candidate(&mut self, region: &Region, progress: &dyn Progress) -> Result<()> {
        let lengths = Lengths {
            diagonal: region.diagonal(),
            spacing: self.scene.surface.spacing,
            tolerance: self.tolerance,
            surroundings: None,
            size_tolerance: self.options.size_tolerance,
        };
        let Some(template) = Template::new(self.scene, region, &lengths)? else { return Ok(()) };
        if self.is_claimed(&template.covered(self.scene, &Motion::NONE)) {
            return Ok(());
        }
        let budget = Budget { guesses: RECURRING_GUESSES, finalists: RECURRING_FINALISTS };
        let mut stages = Stages::new(FIND_STAGES, progress);
        let mut places = places_like(&template, &self.side, &self.side, budget, &mut stages)?;
        places.push((1.0, Motion::NONE));
        places.retain(|(score, _)| *score >= self.options.min_score);
        let mut kept: Vec<((f64, Motion), Vec<u32>)> = Vec::new();
        for place in template.best_places(places, usize::MAX) {
            let covered = template.covered(self.scene, &place.1);
            if !covered.is_empty() && !self.is_claimed(&covered) {
                kept.push((place, covered));
            }
        }
        if kept.len() < self.options.min_count as usize {
            return Ok(());
        }
        kept.iter().flat_map(|(_, covered)| covered).for_each(|&i| self.claimed[i as usize] = true);
        let origin = self.model.header().origin;
        let example = region.about(origin.map(|c| -c));
        let number = self.found.len();
        let found = |(place, covered): &((f64, Motion), Vec<u32>)| -> Result<(Found, Vec<u32>)> {
            let found = template.found(*place, &example, number, [origin; 2])?;
            Ok((found, self.occurrences_of(covered)))
        };
        let (places, occurrences) =
            kept.iter().map(found).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        self.found.push(RecurringClass { example, places, occurrences });
        Ok(())
    }

    /// Whether most of some samples belong to a class.
    fn is_claimed(&self, samples: &[u32]) -> bool {
        let claimed = samples.iter().filter(|&&i| self.claimed[i as usize]).count();
        claimed as f64 > CLAIMED * samples.len() as f64
    }

    /// Occurrences with samples among these.
    fn occurrences_of(&self, samples: &[u32]) -> Vec<u32> {
        let of = &self.scene.surface.occurrences;
        let mut all: Vec<u32> = samples.iter().map(|&i| of[i as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}
