//! Find all like this: where else in the scene stands what an example shows.
//!
//! | file | step |
//! |---|---|
//! | `options` | what to look for, and how |
//! | `scene` | the scene that is searched, and motions in it |
//! | `template` | the example, sample by sample |
//! | `guess`, `occupancy` | motions from pairs of like words, tried coarsely |
//! | `refine` | motions improved |
//! | `score` | how like the example a place is |
//! | `suppression` | one motion for one thing |

mod guess;
mod occupancy;
mod options;
mod refine;
mod scene;
mod score;
mod suppression;
mod template;

use rayon::prelude::*;
use surfabet_geom::{KdTree, Pose, Progress};

use self::guess::guesses;
pub use self::options::{FindOptions, Region};
use self::refine::REFINED;
use self::scene::{Motion, Place};
use self::score::{MATCHED, share};
use self::template::Template;
use super::surface::Surface;
use crate::alphabet::model::{AlphabetModel, Occurrence};
use crate::error::{Error, Result};

/// Samples along the diagonal of an example.
const FINENESS: f64 = 64.0;

/// Closest spacing of samples, metres.
const LEAST_SPACING: f64 = 0.004;

/// Motions that are refined to the end.
const FINALISTS: usize = 300;

/// A place that looks like the example.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Takes the example there: a turn about the vertical and a shift.
    pub pose: Pose,
    /// How alike, 0 to 1; 1 for the example itself.
    pub score: f64,
    /// Where the middle of the region comes to lie, world coordinates.
    pub center: [f64; 3],
}

impl AlphabetModel {
    /// All places that look like what stands in `example`, the best first; the example itself is among them.
    ///
    /// Scenes are upright, so places differ by a turn about the vertical and a shift. Motions are guessed from pairs of
    /// occurrences of like words, refined on the samples of both surfaces, and scored by the share of the example that
    /// is found again and of the place that the example explains. Surfaces that go on beyond the region, such as the
    /// floor, count by the share of them that lies inside.
    ///
    /// Things must stand out of the deviation that the model was learned with: legs of a chair are lost at a sigma of
    /// their width.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for options or a region outside their domain, and for a region where no word
    /// stands, [`Error::TooManyPoints`] when the spacing of samples is too close, [`Error::Cancelled`].
    pub fn find(
        &self,
        example: &Region,
        options: &FindOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<Found>> {
        options.check()?;
        example.check()?;
        progress.update("sampling the surface", 0.0);
        let origin = self.header().origin;
        let region = example.about(origin);
        let inside: Vec<Occurrence> =
            self.occurrences().filter(|o| example.contains(o.center)).collect();
        let diagonal = region.diagonal();
        let spacing = options.resolution.unwrap_or((diagonal / FINENESS).max(LEAST_SPACING));
        let mut sigmas: Vec<f64> = inside.iter().map(|o| o.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let Some(&sigma) = sigmas.get(sigmas.len() / 2) else {
            let place = format!("{example:?}");
            return Err(Error::invalid("region", place, "where the model has words"));
        };
        let tolerance = options.tolerance.unwrap_or(sigma.max(0.25 * spacing));
        let surface = Surface::of(self, spacing, progress)?;
        let tree = KdTree::new(&surface.points)?;
        let color_tolerance = options.color_tolerance.filter(|_| surface.colors.is_some());
        // What lies flush is one piece with its wall: where colours tell things apart, pieces do not.
        let (pieces, sizes) = match color_tolerance {
            Some(_) => ((0..surface.len() as u32).collect(), vec![1; surface.len()]),
            None => surface.pieces(&tree, progress)?,
        };
        progress.check()?;
        let scene = Place { surface: &surface, tree: &tree, pieces: &pieces, sizes: &sizes };
        let Some(template) = Template::new(&scene, &region, tolerance, color_tolerance, diagonal)?
        else {
            let place = format!("{example:?}");
            return Err(Error::invalid("region", place, "where the model has a surface"));
        };
        progress.update("guessing motions", 0.2);
        let guesses = guesses(self, &scene, &template, progress)?;
        progress.update("refining motions", 0.4);
        let motions: Vec<(f64, Motion)> = guesses
            .into_par_iter()
            .map(|motion| {
                progress.check()?;
                let motion = template.refined(
                    &scene,
                    motion,
                    REFINED[0],
                    [0.12 * diagonal, 3.0 * tolerance],
                    6,
                );
                let matches = template.matches(&scene, &motion, 2.0 * tolerance, REFINED[0]);
                Ok((share(&matches, &template.weights), motion))
            })
            .collect::<Result<_>>()?;
        let motions = template.best_guesses(motions, FINALISTS);
        progress.update("scoring places", 0.7);
        let motions: Vec<(Motion, Vec<f32>)> = motions
            .into_par_iter()
            .map(|(_, motion)| {
                progress.check()?;
                let reach = [6.0 * tolerance, tolerance];
                let mut motion = template.refined(&scene, motion, REFINED[1], reach, 8);
                if color_tolerance.is_some() {
                    motion = template.slid(&scene, motion);
                }
                Ok((motion, template.matches(&scene, &motion, tolerance, MATCHED)))
            })
            .collect::<Result<_>>()?;
        let rarity = template.rarity(&motions);
        let mut finals: Vec<(f64, Motion)> = motions
            .par_iter()
            .map(|(motion, matches)| {
                progress.check()?;
                Ok((template.score(&scene, motion, matches, &rarity), *motion))
            })
            .collect::<Result<_>>()?;
        finals.push((1.0, Motion { yaw: 0.0, shift: [0.0; 3] }));
        finals.retain(|(score, _)| *score >= options.min_score);
        let finals = template.best_places(finals, options.max_found);
        let middle = example.center();
        let found = |(score, motion): (f64, Motion)| {
            let pose = template.pose(&motion, origin)?;
            Ok(Found { pose, score, center: pose.apply(middle) })
        };
        finals.into_iter().map(found).collect()
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::alphabet::{AlphabetOptions, learn};

    /// Where the things stand: x, y, yaw.
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
    fn the_number_of_threads_is_of_no_account() {
        let model = model();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| model.find(&example(), &FindOptions::default(), &Silent).unwrap())
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn regions_without_room_or_words_are_refused() {
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
