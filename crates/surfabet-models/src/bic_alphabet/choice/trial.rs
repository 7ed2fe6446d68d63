//! What one more word, or one occurrence less, changes: computed where it changes it, and the same, to the bit, as
//! scoring everything anew.

use super::prepared::PreparedScene;
use super::reconstruction::{Reconstruction, bic, n_parameters};
use crate::bic_alphabet::likelihood::LANES;
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
        // Points of one occurrence reach the same blocks.
        self.change.flips.sort_by_key(|flip| flip.owner);
    }

    /// Adds the Gaussians of newly kept points to the sums (`add`), or subtracts those of points no longer kept.
    fn scatter(&mut self, scene: &PreparedScene<'_>, add: bool) {
        let Self { change, positions, sums, touched, is_touched, .. } = self;
        for of_owner in change.flips.chunk_by(|a, b| a.owner == b.owner) {
            positions.clear();
            let flips = of_owner.iter().filter(|flip| flip.is_kept == add);
            positions.extend(flips.map(|flip| flip.position));
            let reachable = scene.reachable.of(of_owner[0].owner);
            scene.likelihood.scatter(positions, reachable, add, sums, |b| {
                if !is_touched[b as usize] {
                    is_touched[b as usize] = true;
                    touched.push(b);
                }
            });
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
        trial.change.added.clear();
        let stamp = scene.stamp(word);
        stamp.place(&scene.features.frames, &trial.features, &mut trial.change.added);
        self.sparsified.change(&trial.features, scene.epsilon(), &mut trial.change);
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
        // Before any point is subtracted every sum is at least its final value: a bound of the BIC from below.
        trial.scatter(scene, true);
        if score(self.gain(scene, trial)) >= limit {
            return None;
        }
        trial.scatter(scene, false);
        trial.gain = self.gain(scene, trial);
        Some(score(trial.gain)).filter(|&bic| bic < limit)
    }

    /// `ln L` without the occurrence at a feature; `trial` then holds what changes.
    pub fn try_without(&self, scene: &PreparedScene<'_>, feature: u32, trial: &mut Trial) -> f64 {
        trial.change.added.clear();
        self.sparsified.change(&[feature], scene.epsilon(), &mut trial.change);
        trial.clear_sums(scene);
        trial.scatter(scene, true);
        trial.scatter(scene, false);
        trial.gain = self.gain(scene, trial);
        let n_decoded = self.n_decoded + trial.change.balance();
        if n_decoded == 0 {
            return f64::NEG_INFINITY;
        }
        scene.likelihood.log_likelihood(self.sums.total + trial.gain, n_decoded)
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

    /// Applies the trial of [`Reconstruction::try_word`].
    pub fn accept(&mut self, scene: &PreparedScene<'_>, word: BicWord, trial: &Trial) {
        self.apply_sums(scene, trial);
        self.sparsified = self.sparsified.changed(&trial.change, scene.epsilon());
        self.matching.assign(self.words.len() as u32, &trial.features, &trial.distances);
        self.n_parameters += n_parameters(&word);
        self.words.push(word);
    }

    /// Applies the trial of [`Reconstruction::try_without`].
    pub fn remove(&mut self, scene: &PreparedScene<'_>, feature: u32, trial: &Trial) {
        self.apply_sums(scene, trial);
        self.sparsified.remove(&trial.change);
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

    /// Kept points by rank, and everything that a score adds up.
    fn content(best: &Reconstruction) -> (Vec<u64>, &Matching, &KernelSums, i64, usize) {
        let mut kept: Vec<u64> = best.sparsified.kept().map(|p| p.rank).collect();
        kept.sort_unstable();
        (kept, &best.matching, &best.sums, best.n_decoded, best.n_parameters)
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
                    best.accept(scene, word, &trial);
                    prop_assert_eq!(content(&best), content(&full));
                    prop_assert_eq!(best.bic(scene), full.bic(scene));
                }
            }
        }

        #[test]
        fn a_reduction_never_lowers_the_likelihood_and_leaves_what_would(
            points in prop::collection::vec(prop::array::uniform3(0.0_f32..1.0), 100..400),
            chosen in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
        ) {
            let options = BicAlphabetOptions { radius: Some(0.1), epsilon: Some(0.03), ..BicAlphabetOptions::default() };
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
                let before = plain.log_likelihood(scene);
                let without = plain.try_without(scene, f, &mut trial);
                let mut removed = plain.clone();
                removed.remove(scene, f, &trial);
                prop_assert_eq!(removed.log_likelihood(scene), without);
                if without >= before {
                    plain = removed;
                }
            }
            let mut reduced = full.clone();
            reduce(scene, &mut reduced, &Silent).unwrap();
            prop_assert!(reduced.log_likelihood(scene) >= full.log_likelihood(scene));
            if n_words == 1 {
                // Occurrences of a single word are visited in this order.
                prop_assert_eq!(content(&reduced), content(&plain));
            }
            let left = |s: &Reconstruction| s.matching.words.iter().filter(|&&w| w != u32::MAX).count();
            prop_assert!(left(&reduced) >= 1 && left(&reduced) <= left(&full));
        }
    }
}
