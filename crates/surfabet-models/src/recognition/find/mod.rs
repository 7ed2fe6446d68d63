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
//! | `score` | how much of the example is found at a place, and how much of the place is explained |
//! | `suppression` | of motions to one place the best |

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

use surfabet_geom::{Pose, Progress};

use self::guess::guess_motions;
use self::lengths::Lengths;
use self::motion::Motion;
pub use self::options::{FindOptions, Region};
use self::scene::SearchScene;
use self::template::Template;
use super::constants::FINALISTS;
use crate::alphabet::model::AlphabetModel;
use crate::error::Result;
use crate::options::Options;
use crate::stages::Stages;

/// The stages and their shares of the progress, in per cent.
const STAGES: &[(&str, f32)] = &[
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
}

impl AlphabetModel {
    /// All places that look like the part of the scene in `example`, the best first; the example itself is among them.
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
    /// [`crate::Error::InvalidParameter`] for options or a region outside their domain, and for a region without
    /// words, [`crate::Error::TooManyPoints`] when the spacing of samples is too close, [`crate::Error::Cancelled`].
    pub fn find(
        &self,
        example: &Region,
        options: &FindOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<Found>> {
        options.check()?;
        example.check()?;
        let mut stages = Stages::new(STAGES, progress);
        let origin = self.header().origin;
        let lengths = Lengths::new(self, example, options)?;
        let scene = stages.run("sampling the surface", |progress| {
            SearchScene::new(self, &lengths, options.color_tolerance, progress)
        })?;
        let Some(template) = Template::new(&scene, &example.about(origin), &lengths)? else {
            return Err(example.invalid("a region with a surface"));
        };
        // Guesses from pairs of occurrences, the most promising kept.
        let guesses = stages
            .run("guessing motions", |progress| guess_motions(self, &scene, &template, progress))?;
        // A rough refinement of all, a fine one of the best.
        let motions = stages.run("refining motions", |progress| {
            let motions = template.refine_roughly(&scene, &guesses, progress)?;
            Ok(template.best_guesses(motions, FINALISTS))
        })?;
        let mut places = stages.run("scoring places", |progress| {
            let motions = template.refine_finely(&scene, &motions, progress)?;
            template.score_all(&scene, &motions, progress)
        })?;
        places.push((1.0, Motion::NONE));
        places.retain(|(score, _)| *score >= options.min_score);
        let middle = example.center();
        let found = |(score, motion): (f64, Motion)| {
            let pose = template.pose(&motion, origin)?;
            Ok(Found { pose, score, center: pose.apply(middle) })
        };
        template.best_places(places, options.max_found).into_iter().map(found).collect()
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::Error;
    use crate::alphabet::{AlphabetOptions, learn};

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

    /// Three things on a floor, and a box that is none.
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
        let found = model.find(&example(), &FindOptions::default(), &Silent).unwrap();
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
            pool.install(|| model.find(&example(), &FindOptions::default(), &Silent).unwrap())
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn regions_without_extent_or_words_are_refused() {
        let model = model();
        let find = |region: Region| model.find(&region, &FindOptions::default(), &Silent);
        let nowhere = Region::Ball { center: [50.0, 0.0, 0.0], radius: 1.0 };
        let flat = Region::Box { low: [0.0; 3], high: [1.0, 0.0, 1.0] };
        let none = Region::Ball { center: [0.0; 3], radius: f64::NAN };
        for region in [nowhere, flat, none] {
            assert!(matches!(find(region), Err(Error::InvalidParameter { .. })), "{region:?}");
        }
        let options = FindOptions { min_score: 1.5, ..FindOptions::default() };
        assert!(model.find(&example(), &options, &Silent).is_err());
    }
}
