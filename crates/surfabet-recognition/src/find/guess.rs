//! Motions guessed from pairs of occurrences: one in the example, one anywhere.

use std::f64::consts::{FRAC_PI_8, PI, TAU};

use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_models::Result;
use surfabet_models::alphabet::{AlphabetModel, Occurrence};

use super::motion::Motion;
use super::occupancy::Occupancy;
use super::scene::SearchScene;
use super::template::Template;
use crate::constants::{
    GUESS_CELL, LEAST_COLOR_SIMILARITY, LEAST_TRIAL_SHARE, LEVEL, MAX_PIECE_RATIO, RADIUS_RATIOS,
    SAME_INCLINATION, SEEDS, TRIAL_LEVEL, TRIAL_SAMPLES, TURNS, WHOLE_PIECE,
};
use crate::surface::color_similarity;

/// A model with its surface: that of the example, or that which is searched.
pub(crate) struct Side<'a> {
    /// About the origin of the model.
    pub occurrences: Vec<Occurrence>,
    pub scene: &'a SearchScene,
}

impl<'a> Side<'a> {
    pub fn new(model: &AlphabetModel, scene: &'a SearchScene) -> Self {
        let origin = model.header().origin;
        let about = |o: Occurrence| Occurrence {
            center: std::array::from_fn(|a| o.center[a] - origin[a]),
            ..o
        };
        Self { occurrences: model.occurrences().map(about).collect(), scene }
    }
}

/// The most promising motions, at most `most`: every pair of an occurrence in the example and one anywhere of the same inclination
/// and of its radius or the next gives one, and the opposite one, since thin objects look the same from both sides. They are
/// tried on coarse cells, and the best of each cell and direction is kept.
pub(super) fn guess_motions(
    example: &Side<'_>,
    searched: &Side<'_>,
    template: &Template,
    most: usize,
    progress: &dyn Progress,
) -> Result<Vec<Motion>> {
    let scene = searched.scene;
    let (from, to) = (&example.occurrences, &searched.occurrences);
    let seeds = Seeds::new(example.scene, template, from);
    let side = (2.0 * template.spacing).max(GUESS_CELL * template.diagonal).max(template.tolerance);
    let limit = piece_limit(template);
    let is_searched = |i: usize| scene.piece_size(i) <= limit;
    let trial = Trial::new(scene, template, side, is_searched);
    let mut eligible = vec![false; to.len()];
    for (i, &o) in scene.surface.occurrences.iter().enumerate() {
        eligible[o as usize] |= is_searched(i);
    }
    let hues = (&example.scene.surface.hues, &scene.surface.hues, scene.color_tolerance);
    let has_same_color = |i: usize, j: usize| match hues {
        (Some(a), Some(b), Some(tolerance)) => {
            color_similarity(a[i], b[j], tolerance) > LEAST_COLOR_SIMILARITY
        }
        _ => true,
    };
    let motions: Vec<(f64, Motion)> = parallel::try_map(&seeds.occurrences, |&k| -> Result<_> {
        progress.check()?;
        let mut promising = Vec::new();
        for j in (0..to.len()).filter(|&j| eligible[j] && has_same_color(k, j)) {
            for motion in seeds.motions(template, &from[k], &to[j]) {
                let share = trial.share(template, &motion);
                if share > LEAST_TRIAL_SHARE {
                    promising.push((share, motion));
                }
            }
        }
        Ok(promising)
    })?
    .concat();
    Ok(best_by_cell(motions, side).into_iter().take(most).map(|m| m.1).collect())
}

/// The occurrences of the example that motions are guessed from.
struct Seeds {
    occurrences: Vec<usize>,
    /// Whether their normals have horizontal directions, from which a turn follows.
    are_steep: bool,
}

impl Seeds {
    /// The occurrences of the example whose samples have the largest mean weight; only steep ones if there are any.
    fn new(scene: &SearchScene, template: &Template, all: &[Occurrence]) -> Self {
        let surface = &scene.surface;
        let inside: Vec<u32> = (0..surface.len() as u32)
            .filter(|&i| template.region.contains(surface.points[i as usize].map(f64::from)))
            .collect();
        let mut weights = vec![(0.0, 0.0); all.len()];
        for (&i, weight) in inside.iter().zip(scene.weights(&inside)) {
            let (sum, n) = &mut weights[surface.occurrences[i as usize] as usize];
            *sum += weight;
            *n += 1.0;
        }
        let mut seeds: Vec<(f64, usize)> = weights
            .iter()
            .enumerate()
            .filter(|(k, (_, n))| *n > 0.0 && template.region.contains(all[*k].center))
            .map(|(k, (sum, n))| (sum / n, k))
            .collect();
        let is_steep = |k: usize| all[k].rows[2][2].abs() < LEVEL;
        let are_steep = seeds.iter().any(|&(_, k)| is_steep(k));
        seeds.retain(|&(_, k)| !are_steep || is_steep(k));
        seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        seeds.truncate(SEEDS);
        Self { occurrences: seeds.into_iter().map(|(_, k)| k).collect(), are_steep }
    }

    /// The motions that take `from` to `to`, if the two can be of one kind: with the normal, and against it. Where no seed
    /// is steep, turns all around.
    fn motions(&self, template: &Template, from: &Occurrence, to: &Occurrence) -> Vec<Motion> {
        let difference = (to.rows[2][2].abs() - from.rows[2][2].abs()).abs();
        if difference > SAME_INCLINATION || !RADIUS_RATIOS.contains(&(to.radius / from.radius)) {
            return Vec::new();
        }
        let heading = |o: &Occurrence| o.rows[2][1].atan2(o.rows[2][0]);
        let turns: Vec<f64> = if self.are_steep {
            let turn = heading(to) - heading(from);
            vec![turn, turn + PI]
        } else {
            (0..TURNS).map(|i| f64::from(i) * FRAC_PI_8).collect()
        };
        let motion = |yaw: f64| {
            let arm = std::array::from_fn(|a| (from.center[a] - template.pivot[a]) as f32);
            let turned = Motion { yaw, ..Motion::NONE }.turned(arm);
            let shift = std::array::from_fn(|a| to.center[a] - turned[a] - template.pivot[a]);
            Motion { yaw, shift, ..Motion::NONE }
        };
        turns.into_iter().map(motion).collect()
    }
}

/// Size of the largest piece of the scene that is searched: whole pieces of the example are not searched in much larger
/// ones.
fn piece_limit(template: &Template) -> f64 {
    let pieces = template.piece_sizes.iter().zip(&template.weights);
    let whole = pieces.filter(|(_, weight)| **weight > WHOLE_PIECE);
    let largest = whole.map(|(size, _)| *size).fold(0.0, f64::max);
    if largest > 0.0 { MAX_PIECE_RATIO * largest } else { f64::INFINITY }
}

/// A quick trial of motions: a few samples against coarse cells.
struct Trial {
    cells: Occupancy,
    samples: Vec<usize>,
    /// Weight of all of them.
    total: f64,
}

impl Trial {
    fn new(
        scene: &SearchScene,
        template: &Template,
        side: f64,
        is_searched: impl Fn(usize) -> bool,
    ) -> Self {
        let mut samples: Vec<usize> = (0..template.points.len().min(4 * TRIAL_SAMPLES)).collect();
        let weights = &template.weights;
        samples.sort_by(|&i, &j| weights[j].total_cmp(&weights[i]).then(i.cmp(&j)));
        samples.truncate(TRIAL_SAMPLES);
        let total = samples.iter().map(|&i| weights[i]).sum();
        Self { cells: Occupancy::new(&scene.surface, side, is_searched), samples, total }
    }

    /// The share of the samples, by weight, that a motion takes to occupied cells.
    fn share(&self, template: &Template, motion: &Motion) -> f64 {
        let mut sum = 0.0;
        for &i in &self.samples {
            let level = template.normals[i][2].abs() > TRIAL_LEVEL;
            if self.cells.has(template.moved(motion, i), level) {
                sum += template.weights[i];
            }
        }
        sum / self.total
    }
}

/// Of the motions of each cell of shifts and class of turns the best; the best first.
fn best_by_cell(mut motions: Vec<(f64, Motion)>, side: f64) -> Vec<(f64, Motion)> {
    let cell = |m: &Motion| {
        let turn = (m.yaw.rem_euclid(TAU) / (0.5 * FRAC_PI_8)).floor() as i64;
        (m.shift.map(|c| (c / side).floor() as i64), turn)
    };
    motions.sort_by(|a, b| {
        let ties = (0..3).map(|k| a.1.shift[k].total_cmp(&b.1.shift[k]));
        let order = cell(&a.1).cmp(&cell(&b.1)).then(b.0.total_cmp(&a.0));
        ties.fold(order, std::cmp::Ordering::then).then(a.1.yaw.total_cmp(&b.1.yaw))
    });
    motions.dedup_by(|a, b| cell(&a.1) == cell(&b.1));
    motions.sort_by(|a, b| b.0.total_cmp(&a.0));
    motions
}
