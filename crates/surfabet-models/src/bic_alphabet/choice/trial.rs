//! What one more word, or one occurrence less, changes: computed where it changes it, and the same, to the bit, as
//! scoring everything anew.

use super::prepared::PreparedScene;
use super::reconstruction::{Prior, Reconstruction, bic, n_parameters};
use crate::bic_alphabet::likelihood::{LANES, Shares};
use crate::bic_alphabet::rebuild::Change;
use crate::bic_alphabet::words::BicWord;

/// A change that is tried, with memory that is used again for the next.
#[derive(Debug, Clone, Default)]
pub(in crate::bic_alphabet) struct Trial {
    /// Points that become kept, or are no longer.
    change: Change,
    /// Distance of every feature's descriptor to the candidate's.
    distances: Vec<u32>,
    /// Features whose nearest word the candidate would be.
    features: Vec<u32>,
    /// Changes of `S_i` (see [`crate::bic_alphabet::likelihood`]) by block and lane.
    sums: Vec<[i64; LANES]>,
    /// Blocks with changes.
    touched: Vec<u32>,
    is_touched: Vec<bool>,
    /// Change of the sum of the logarithms.
    gain: i64,
    positions: Vec<[f32; 3]>,
}

impl Trial {
    /// Forgets the sums of the trial before.
    fn clear_sums(&mut self, scene: &PreparedScene<'_>) {
        self.sums.resize(scene.likelihood.n_blocks(), [0; LANES]);
        self.is_touched.resize(scene.likelihood.n_blocks(), false);
        for b in self.touched.drain(..) {
            self.sums[b as usize] = [0; LANES];
            self.is_touched[b as usize] = false;
        }
    }

    /// Subtracts the Gaussians of points that are no longer kept from the sums, and adds those of newly kept ones.
    fn scatter(&mut self, scene: &PreparedScene<'_>, shares: &Shares) {
        let Self { change, positions, sums, touched, is_touched, .. } = self;
        let mut touch = |b: u32| {
            if !is_touched[b as usize] {
                is_touched[b as usize] = true;
                touched.push(b);
            }
        };
        // Points of one occurrence reach the same blocks.
        for of_place in change.flips.chunk_by(|a, b| a.place == b.place) {
            let place = of_place[0].place;
            let reachable = scene.reachable.of(place);
            for is_kept in [false, true] {
                let goes_whole = !is_kept && change.replaces(place);
                if goes_whole && shares.take_away(place, sums, &mut touch) {
                    continue;
                }
                positions.clear();
                let flips = of_place.iter().filter(|flip| flip.is_kept == is_kept);
                positions.extend(flips.map(|flip| flip.position));
                scene.likelihood.scatter(positions, reachable, is_kept, sums, &mut touch);
            }
        }
    }
}

impl Reconstruction {
    /// The BIC with one more word, where it is below `limit`; `trial` then holds what changes.
    pub fn try_word(
        &self,
        scene: &PreparedScene<'_>,
        word: &BicWord,
        limit: f64,
        trial: &mut Trial,
    ) -> Option<f64> {
        scene.descriptors.distances(&word.descriptor, scene.penalty(), &mut trial.distances);
        self.matching.taken(&trial.distances, &mut trial.features);
        let Trial { features, change, .. } = &mut *trial;
        self.sparsified.change(scene.places(), features, Some(scene.stamp(word)), change);
        let n_parameters = self.n_parameters + n_parameters(word);
        let n_decoded = self.n_decoded + trial.change.balance();
        if n_decoded == 0 {
            return None;
        }
        let score = |gain: i64| {
            let logs = self.sums.total + gain;
            let log_likelihood = scene.likelihood.log_likelihood(logs, n_decoded);
            bic(log_likelihood, n_parameters, scene.likelihood.len())
        };
        trial.clear_sums(scene);
        trial.scatter(scene, &self.shares);
        trial.gain = self.gain(scene, trial);
        Some(score(trial.gain)).filter(|&bic| bic < limit)
    }

    /// `ln L` without the occurrence at a feature; `trial` then holds what changes.
    pub fn try_without(
        &self,
        scene: &PreparedScene<'_>,
        feature: u32,
        prior: Prior,
        trial: &mut Trial,
    ) -> f64 {
        self.sparsified.change(scene.places(), &[feature], None, &mut trial.change);
        trial.clear_sums(scene);
        trial.scatter(scene, &self.shares);
        trial.gain = self.gain(scene, trial);
        let n_decoded = self.n_decoded + trial.change.balance();
        if n_decoded == 0 {
            return f64::NEG_INFINITY;
        }
        let logs = self.sums.total + trial.gain;
        scene.likelihood.log_likelihood(logs, prior.divisor(n_decoded))
    }

    /// `sum_i (ln(S_i + change) - ln S_i)` over the points whose sum changes, in the units of
    /// [`crate::bic_alphabet::likelihood::Likelihood::log`].
    fn gain(&self, scene: &PreparedScene<'_>, trial: &Trial) -> i64 {
        let mut gain = 0;
        for &b in &trial.touched {
            let b = b as usize;
            for lane in 0..scene.likelihood.lanes(b) {
                if trial.sums[b][lane] != 0 {
                    let log = scene.likelihood.log(self.sums.sums[b][lane] + trial.sums[b][lane]);
                    gain += log - self.sums.logs[b][lane];
                }
            }
        }
        gain
    }

    /// Adds the changes of a trial to the sums.
    fn apply_sums(&mut self, scene: &PreparedScene<'_>, trial: &Trial) {
        for &b in &trial.touched {
            let b = b as usize;
            for lane in 0..scene.likelihood.lanes(b) {
                if trial.sums[b][lane] != 0 {
                    self.sums.sums[b][lane] += trial.sums[b][lane];
                    self.sums.logs[b][lane] = scene.likelihood.log(self.sums.sums[b][lane]);
                }
            }
        }
        self.sums.total += trial.gain;
        self.n_decoded += trial.change.balance();
    }

    /// Applies the changes of a trial to the kept points.
    fn apply_change(&mut self, scene: &PreparedScene<'_>, trial: &mut Trial) {
        let Trial { change, positions, .. } = trial;
        for (place, kept) in change.decided() {
            positions.clear();
            positions.extend(kept.iter().map(|p| p.position));
            self.shares.set(&scene.likelihood, &scene.reachable, place, positions);
        }
        self.sparsified.apply(change);
    }

    /// Applies the trial of [`Reconstruction::try_word`].
    pub fn accept(&mut self, scene: &PreparedScene<'_>, word: BicWord, trial: &mut Trial) {
        self.apply_sums(scene, trial);
        self.apply_change(scene, trial);
        self.matching.assign(self.words.len() as u32, &trial.features, &trial.distances);
        self.n_parameters += n_parameters(&word);
        self.words.push(word);
    }

    /// Applies the trial of [`Reconstruction::try_without`].
    pub fn remove(&mut self, scene: &PreparedScene<'_>, feature: u32, trial: &mut Trial) {
        self.apply_sums(scene, trial);
        self.apply_change(scene, trial);
        self.matching.words[feature as usize] = u32::MAX;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{PointCloud, Silent};

    use super::super::matching::Matching;
    use super::super::reduce::reduce;
    use super::*;
    use crate::bic_alphabet::learn::STAGES;
    use crate::bic_alphabet::likelihood::KernelSums;
    use crate::bic_alphabet::options::BicAlphabetOptions;
    use crate::scans::{Deviation, Scene};
    use crate::stages::Stages;

    /// A corner of two planes with a bump, sampled at random.
    fn scene(points: &[[f32; 3]]) -> Scene {
        let positions = points
            .iter()
            .map(|&[u, v, s]| {
                let bump = 0.05 * (-((u - 0.3).powi(2) + (v - 0.3).powi(2)) / 0.005).exp();
                if s < 0.5 { [u, v, bump] } else { [u, 0.0, v] }
            })
            .collect();
        let (cloud, _) = PointCloud::from_positions(positions);
        Scene::new(&cloud, Deviation::default(), 0.0, &Silent).unwrap()
    }

    fn prepared<'a>(points: &[[f32; 3]], options: &'a BicAlphabetOptions) -> PreparedScene<'a> {
        let mut stages = Stages::new(STAGES, &Silent);
        PreparedScene::of_scene(scene(points), options, &mut stages).unwrap()
    }

    /// Kept points, and everything that a score adds up.
    fn content(
        best: &Reconstruction,
    ) -> (Vec<[f32; 3]>, &Matching, (&KernelSums, &Shares), i64, usize) {
        let kept = best.sparsified.kept().collect();
        (kept, &best.matching, (&best.sums, &best.shares), best.n_decoded, best.n_parameters)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn step_by_step_is_the_same_to_the_bit_as_all_at_once(
            points in prop::collection::vec(prop::array::uniform3(0.0_f32..1.0), 100..500),
            candidates in prop::collection::vec(any::<prop::sample::Index>(), 1..10),
        ) {
            let options = BicAlphabetOptions { radius: Some(0.1), epsilon: Some(0.03), ..BicAlphabetOptions::default() };
            let scene = &prepared(&points, &options);
            let mut best = Reconstruction::empty(scene);
            let mut trial = Trial::default();
            for candidate in candidates {
                let word = scene.word(candidate.index(scene.features.len()) as u32);
                if word.points.is_empty() {
                    continue;
                }
                let words = [best.words.clone(), vec![word.clone()]].concat();
                let matching = Matching::new(&scene.descriptors, &words, scene.penalty());
                let full = Reconstruction::new(scene, words, matching);
                let now = best.bic(scene);
                let found = best.try_word(scene, &word, f64::INFINITY, &mut trial);
                prop_assert_eq!(found, Some(full.bic(scene)));
                // What a bound rejects would not have been accepted.
                let bounded = best.try_word(scene, &word, now, &mut trial);
                prop_assert_eq!(bounded, found.filter(|&bic| bic < now));
                if bounded.is_some() {
                    best.accept(scene, word, &mut trial);
                    prop_assert_eq!(content(&best), content(&full));
                    prop_assert_eq!(best.bic(scene), full.bic(scene));
                }
            }
        }

        #[test]
        fn a_reduction_lowers_the_likelihood_by_its_tolerance_at_most_and_leaves_what_would(
            points in prop::collection::vec(prop::array::uniform3(0.0_f32..1.0), 100..400),
            chosen in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
            reduce_tolerance in prop::option::of(0.0_f64..20.0),
        ) {
            let options = BicAlphabetOptions {
                radius: Some(0.1),
                epsilon: Some(0.03),
                reduce_tolerance,
                ..BicAlphabetOptions::default()
            };
            let prior = if reduce_tolerance.is_some() { Prior::One } else { Prior::Uniform };
            let tolerance = reduce_tolerance.unwrap_or(0.0);
            let scene = &prepared(&points, &options);
            let at = |i: prop::sample::Index| scene.word(i.index(scene.features.len()) as u32);
            let words: Vec<BicWord> =
                chosen.into_iter().map(at).filter(|w| !w.points.is_empty()).collect();
            if words.is_empty() {
                return Ok(());
            }
            let n_words = words.len();
            let matching = Matching::new(&scene.descriptors, &words, scene.penalty());
            let full = Reconstruction::new(scene, words, matching);
            // One removal after the other, each compared with the likelihood before it.
            let mut plain = full.clone();
            let mut trial = Trial::default();
            for f in 0..scene.features.len() as u32 {
                let before = plain.log_likelihood_with(scene, prior);
                let without = plain.try_without(scene, f, prior, &mut trial);
                let mut removed = plain.clone();
                removed.remove(scene, f, &mut trial);
                if without > f64::NEG_INFINITY {
                    prop_assert_eq!(removed.log_likelihood_with(scene, prior), without);
                }
                if without - before >= -tolerance {
                    plain = removed;
                }
            }
            let mut reduced = full.clone();
            reduce(scene, &mut reduced, &Silent).unwrap();
            let left = |s: &Reconstruction| s.matching.words.iter().filter(|&&w| w != u32::MAX).count();
            let fall = full.log_likelihood_with(scene, prior) - reduced.log_likelihood_with(scene, prior);
            prop_assert!(fall <= tolerance * (left(&full) - left(&reduced)) as f64 + 1e-6);
            if n_words == 1 {
                // Occurrences of a single word are visited in this order.
                prop_assert_eq!(content(&reduced), content(&plain));
            }
            prop_assert!(left(&reduced) >= 1 && left(&reduced) <= left(&full));
        }
    }
}
