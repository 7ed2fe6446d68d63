//! Search for other places of a scene that look like an example.
//!
//! | file | step |
//! |---|---|
//! | `options` | the example's region, and the options |
//! | `lengths` | spacing of samples and tolerance |
//! | `scene` | the scene that is searched, as samples of its surface in smooth pieces |
//! | `template` | the example as samples about a pivot, and how well a place matches it |
//! | `motion` | a turn about the vertical and a shift |
//! | `guess`, `occupancy` | motions from pairs of occurrences, tried on coarse cells |
//! | `refine` | motions improved by least squares |
//! | `border` | where the example ends, and whether a place ends there too |
//! | `score` | how much of the example is found at a place, and how much of the place is explained |
//! | `suppression` | of motions to one place the best |

mod border;
mod guess;
mod lengths;
mod motion;
mod occupancy;
mod options;
mod refine;
mod scene;
mod score;
mod suppression;
mod template;

use surfabet_geom::vector::{self, minus};
use surfabet_geom::{Part, Pose, Progress};
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::options::Options;
use surfabet_models::{Error, Result, Stages};

pub(super) use self::guess::Side;
use self::guess::guess_motions;
pub(super) use self::lengths::{Lengths, median_sigma};
pub(super) use self::motion::Motion;
pub use self::options::{FindOptions, Region};
pub(super) use self::scene::SearchScene;
pub(super) use self::template::Template;
use super::constants::{
    FINALISTS, GUESSES, LEAST_SCORE, LEAST_SCORE_OF_COLORS, LEAST_SCORE_OF_SHAPES,
    SAME_PLACE_OF_ANY,
};

/// The stages and their shares of the progress, in per cent.
pub(super) const FIND_STAGES: &[(&str, f32)] = &[
    ("sampling the surface", 20.0),
    ("guessing motions", 20.0),
    ("refining motions", 30.0),
    ("scoring places", 30.0),
];

/// A place that looks like the example.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Takes the example there: a turn about the vertical and a shift.
    pub pose: Pose,
    /// Similarity, 0 to 1; 1 for the example itself.
    pub score: f64,
    /// The middle of the region after the motion, world coordinates.
    pub center: [f64; 3],
    /// Sizes over those of the example: level, upright.
    pub size: [f64; 2],
    /// Number of the example that fits best, from 0.
    pub example: usize,
}

/// An example of another scene.
#[derive(Debug, Clone, Copy)]
pub struct Example<'a> {
    /// The model that shows it.
    pub model: &'a AlphabetModel,
    /// Where in it the example is; `None` when it is all of the model.
    pub region: Option<Region>,
}

/// All places of a scene that look like the part of it in `example`, the best first; the example itself is among them.
///
/// Scenes are upright, so places differ by a turn about the vertical and a shift. Motions are guessed from pairs of
/// occurrences of equal radius and inclination, refined on the samples of both surfaces, and scored by the share of
/// the example that is found again and of the place that the example explains. Surfaces that go on beyond the
/// region, such as the floor, count by the share of them that lies inside.
///
/// Only shapes larger than the deviation that the model was learned with can be found: legs of a chair are lost at a
/// sigma of their width.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// [`surfabet_models::Error::InvalidParameter`] for options or a region outside their domain, and for a region without
/// words, [`surfabet_models::Error::TooManyPoints`] when the spacing of samples is too close, [`surfabet_models::Error::Cancelled`].
pub fn find(
    model: &AlphabetModel,
    example: &Region,
    options: &FindOptions,
    progress: &dyn Progress,
) -> Result<Vec<Found>> {
    options.check()?;
    example.check()?;
    let mut stages = Stages::new(FIND_STAGES, progress);
    let origin = model.header().origin;
    let lengths = Lengths::new(model, example, options)?;
    let scene = stages.run("sampling the surface", |progress| {
        SearchScene::new(model, lengths.spacing, options.color_tolerance, progress)
    })?;
    let Some(template) = Template::new(&scene, &example.about(origin), &lengths)? else {
        return Err(example.invalid("a region with a surface"));
    };
    let side = Side::new(model, &scene);
    let budget = Budget { guesses: GUESSES, finalists: FINALISTS };
    let mut places = places_like(&template, &side, &side, budget, &mut stages)?;
    places.push((1.0, Motion::NONE));
    let least = options.min_score.unwrap_or(LEAST_SCORE);
    places.retain(|(score, _)| *score >= least);
    let places = template.best_places(places, options.max_found);
    places.into_iter().map(|place| template.found(place, example, 0, [origin; 2])).collect()
}

/// All places of a scene that look like one of the `examples`, which are of other scenes; the best first, each with the example that fits
/// best there. As [`find`]; sizes may differ by `options.size_tolerance`, and of an example that is all of its model what
/// stands beside it does not count.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// As [`find`]; also for no example and for an example without surface.
pub fn find_examples(
    searched: &AlphabetModel,
    examples: &[Example<'_>],
    options: &FindOptions,
    progress: &dyn Progress,
) -> Result<Vec<Found>> {
    options.check()?;
    if examples.is_empty() {
        return Err(Error::invalid("example", "none", "at least one model"));
    }
    let mut all: Vec<Found> = Vec::new();
    for (k, example) in examples.iter().enumerate() {
        let n = examples.len() as f32;
        let part = Part::new(progress, k as f32 / n..(k + 1) as f32 / n);
        all.extend(find_example(searched, k, example, options, &part)?);
    }
    Ok(best_of_all(all, options.max_found))
}

/// Places like one example, the best first.
fn find_example(
    searched: &AlphabetModel,
    number: usize,
    example: &Example<'_>,
    options: &FindOptions,
    progress: &dyn Progress,
) -> Result<Vec<Found>> {
    let model = example.model;
    if model.is_empty() {
        return Err(Error::invalid("example", format!("model {number}"), "a model with surface"));
    }
    let mut stages = Stages::new(FIND_STAGES, progress);
    let origins = [model.header().origin, searched.header().origin];
    let region = match example.region {
        Some(region) => {
            region.check()?;
            region
        }
        None => whole(model),
    };
    let lengths = Lengths::across(searched, model, &region, example.region.is_none(), options)?;
    let [from, to] = stages.run("sampling the surface", |progress| {
        let scene = |of| SearchScene::new(of, lengths.spacing, options.color_tolerance, progress);
        Ok([scene(model)?, scene(searched)?])
    })?;
    let Some(template) = Template::new(&from, &region.about(origins[0]), &lengths)? else {
        return Err(region.invalid("a region with a surface"));
    };
    let budget = Budget { guesses: GUESSES, finalists: FINALISTS };
    let sides = [Side::new(model, &from), Side::new(searched, &to)];
    let mut places = places_like(&template, &sides[0], &sides[1], budget, &mut stages)?;
    let by_shape = from.color_tolerance.is_none() || to.color_tolerance.is_none();
    let least = if by_shape { LEAST_SCORE_OF_SHAPES } else { LEAST_SCORE_OF_COLORS };
    let least = options.min_score.unwrap_or(least);
    places.retain(|(score, _)| *score >= least);
    let places = template.best_places(places, options.max_found);
    places.into_iter().map(|p| template.found(p, &region, number, origins)).collect()
}

/// How much a search may try.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    /// Guesses that are refined.
    pub guesses: usize,
    /// Guesses that are refined finely.
    pub finalists: usize,
}

/// Places like the template with their scores: guessed from pairs of occurrences, the most promising refined roughly, the best of
/// these finely.
pub(super) fn places_like(
    template: &Template,
    example: &Side<'_>,
    searched: &Side<'_>,
    budget: Budget,
    stages: &mut Stages<'_>,
) -> Result<Vec<(f64, Motion)>> {
    let scene = searched.scene;
    let guesses = stages.run("guessing motions", |progress| {
        guess_motions(example, searched, template, budget.guesses, progress)
    })?;
    let motions = stages.run("refining motions", |progress| {
        let motions = template.refine_roughly(scene, &guesses, progress)?;
        Ok(template.best_guesses(motions, budget.finalists))
    })?;
    stages.run("scoring places", |progress| {
        let motions = template.refine_finely(scene, &motions, progress)?;
        template.score_all(scene, &motions, progress)
    })
}

impl Template {
    /// A place in world coordinates, from the origin of the example's model to that of the scene.
    pub(super) fn found(
        &self,
        (score, motion): (f64, Motion),
        region: &Region,
        example: usize,
        [from, to]: [[f64; 3]; 2],
    ) -> Result<Found> {
        let pose = self.pose(&motion, from, to)?;
        Ok(Found { pose, score, center: pose.apply(region.center()), size: motion.size, example })
    }
}

/// A box around all that a model shows.
fn whole(model: &AlphabetModel) -> Region {
    let [low, high] = model.extent();
    Region::Box { low, high }
}

/// Of places of several examples the best, without those whose middle is within [`SAME_PLACE_OF_ANY`] of that of a better one.
fn best_of_all(mut all: Vec<Found>, most: usize) -> Vec<Found> {
    all.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.example.cmp(&b.example)));
    let mut kept: Vec<Found> = Vec::new();
    for f in all {
        let is_same = |k: &Found| {
            let away = vector::length(minus(k.center, f.center));
            away < SAME_PLACE_OF_ANY
        };
        if kept.len() < most && !kept.iter().any(is_same) {
            kept.push(f);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};
    use surfabet_models::alphabet::{AlphabetOptions, learn};

    use super::*;

    /// Poses of the things: x, y, yaw.
    const PLACES: [[f64; 3]; 3] = [[-1.0, -0.9, 0.2], [1.0, -0.7, 1.4], [0.1, 1.1, 3.7]];

    /// A seat with a back and one arm, so that it looks the same in no other direction, as rectangles: corner, two
    /// edges.
    const THING: [[[f64; 3]; 3]; 3] = [
        [[-0.25, -0.25, 0.45], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        [[-0.25, -0.25, 0.45], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]],
        [[-0.25, -0.25, 0.45], [0.0, 0.4, 0.0], [0.0, 0.0, 0.2]],
    ];

    fn placed([x, y, yaw]: [f64; 3], p: [f64; 3]) -> [f64; 3] {
        let (s, c) = yaw.sin_cos();
        [x + c * p[0] - s * p[1], y + s * p[0] + c * p[1], p[2]]
    }

    /// Three things on a floor, and a box that is not one of them.
    fn model() -> AlphabetModel {
        let mut points = Vec::new();
        let mut rectangle = |place: [f64; 3], [corner, right, up]: [[f64; 3]; 3]| {
            let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
            let n = [right, up].map(|v| (length(v) / 0.015).round() as usize);
            for i in 0..n[0] * n[1] {
                let s = ((i % n[0]) as f64 + 0.5) / n[0] as f64;
                let t = ((i / n[0]) as f64 + 0.5) / n[1] as f64;
                let p = std::array::from_fn(|a| corner[a] + s * right[a] + t * up[a]);
                points.push(placed(place, p).map(|c| c as f32));
            }
        };
        rectangle([0.0; 3], [[-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
        for place in PLACES {
            THING.iter().for_each(|&r| rectangle(place, r));
        }
        let other = [-1.2, 1.2, 0.4];
        rectangle(other, [[0.0, 0.0, 0.6], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]]);
        rectangle(other, [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.0, 0.6]]);
        let (cloud, _) = PointCloud::from_positions(points);
        let options =
            AlphabetOptions { sigma_scale: 1.0, noise: Some(0.008), ..AlphabetOptions::default() };
        learn(&cloud, &options, &Silent).unwrap()
    }

    fn example() -> Region {
        let [x, y, _] = PLACES[0];
        Region::Box { low: [x - 0.4, y - 0.4, 0.1], high: [x + 0.4, y + 0.4, 1.0] }
    }

    #[test]
    fn equal_things_are_found_with_their_poses() {
        let model = model();
        let found = find(&model, &example(), &FindOptions::default(), &Silent).unwrap();
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(found[0].pose, Pose::identity());
        assert_eq!(found[0].score, 1.0);
        assert!(found.windows(2).all(|w| w[0].score >= w[1].score));
        for to in &PLACES[1..] {
            let right = |f: &&Found| {
                let corners = [[0.25, -0.25, 0.45], [-0.25, 0.25, 0.45], [-0.25, -0.25, 0.95]];
                corners.iter().all(|&p| {
                    let [at, should] = [f.pose.apply(placed(PLACES[0], p)), placed(*to, p)];
                    (0..3).map(|a| (at[a] - should[a]).powi(2)).sum::<f64>() < 0.03_f64.powi(2)
                })
            };
            assert_eq!(found.iter().filter(right).count(), 1, "{to:?}: {found:?}");
        }
    }

    #[test]
    fn threads_do_not_change_the_result() {
        let model = model();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| find(&model, &example(), &FindOptions::default(), &Silent).unwrap())
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn regions_without_extent_or_words_are_refused() {
        let model = model();
        let search = |region: Region| find(&model, &region, &FindOptions::default(), &Silent);
        let nowhere = Region::Ball { center: [50.0, 0.0, 0.0], radius: 1.0 };
        let flat = Region::Box { low: [0.0; 3], high: [1.0, 0.0, 1.0] };
        let none = Region::Ball { center: [0.0; 3], radius: f64::NAN };
        for region in [nowhere, flat, none] {
            assert!(matches!(search(region), Err(Error::InvalidParameter { .. })), "{region:?}");
        }
        let options = FindOptions { min_score: Some(1.5), ..FindOptions::default() };
        assert!(find(&model, &example(), &options, &Silent).is_err());
    }
}
