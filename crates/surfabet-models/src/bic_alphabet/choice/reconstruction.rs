//! The scene as an alphabet rebuilds it, and its score: the Bayesian information criterion (eq. 4, 5).

use super::matching::Matching;
use super::prepared::PreparedScene;
use crate::bic_alphabet::likelihood::KernelSums;
use crate::bic_alphabet::model::Occurrences;
use crate::bic_alphabet::rebuild::{Sparsified, Stamp, rebuild};
use crate::bic_alphabet::words::BicWord;

/// An alphabet, the scene rebuilt from it, and what its score is computed from.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Reconstruction {
    /// The alphabet A.
    pub words: Vec<BicWord>,
    /// The word of every feature: the model M(A, D).
    pub matching: Matching,
    /// The rebuilt scene R^ (eq. 3).
    pub sparsified: Sparsified,
    pub(super) sums: KernelSums,
    /// Number of decoded points, M.
    pub(super) n_decoded: i64,
    /// Number of parameters, k (eq. 5).
    pub(super) n_parameters: usize,
}

/// Eq. 4: `BIC = -2 ln L + k ln N`.
pub(super) fn bic(log_likelihood: f64, n_parameters: usize, n_points: usize) -> f64 {
    -2.0 * log_likelihood + n_parameters as f64 * (n_points as f64).ln()
}

/// A word's share of k (eq. 5): three numbers per point.
pub(super) fn n_parameters(word: &BicWord) -> usize {
    3 * word.points.len()
}

impl Reconstruction {
    /// Without words: nothing explains the scene, and the BIC is infinite.
    pub fn empty(scene: &PreparedScene<'_>) -> Self {
        Self {
            words: Vec::new(),
            matching: Matching::none(scene.features.len()),
            sparsified: Sparsified::new(&[], scene.features.len(), scene.epsilon()),
            sums: scene.likelihood.empty_sums(),
            n_decoded: 0,
            n_parameters: 0,
        }
    }

    /// With the nearest of `words` at every feature (`matching`), computed at once.
    pub fn new(scene: &PreparedScene<'_>, words: Vec<BicWord>, matching: Matching) -> Self {
        let stamps: Vec<Stamp> = words.iter().map(|w| scene.stamp(w)).collect();
        let frames = &scene.features.frames;
        let sparsified = rebuild(frames, &matching.words, &stamps, scene.epsilon());
        let likelihood = &scene.likelihood;
        let mut sums = likelihood.empty_sums();
        for p in sparsified.kept() {
            let reachable = scene.reachable.of(p.owner);
            likelihood.scatter(&[p.position], reachable, true, &mut sums.sums, |_| ());
        }
        sums.total = 0;
        for (b, (sums_of, logs)) in sums.sums.iter().zip(&mut sums.logs).enumerate() {
            for lane in 0..likelihood.lanes(b) {
                logs[lane] = likelihood.log(sums_of[lane]);
                sums.total += logs[lane];
            }
        }
        let n_decoded = sparsified.count() as i64;
        let n_parameters = words.iter().map(n_parameters).sum();
        Self { words, matching, sparsified, sums, n_decoded, n_parameters }
    }

    /// `ln L` (eq. 6).
    pub fn log_likelihood(&self, scene: &PreparedScene<'_>) -> f64 {
        scene.likelihood.log_likelihood(self.sums.total, self.n_decoded)
    }

    /// The BIC (eq. 4).
    pub fn bic(&self, scene: &PreparedScene<'_>) -> f64 {
        if self.n_decoded == 0 {
            return f64::INFINITY;
        }
        bic(self.log_likelihood(scene), self.n_parameters, scene.likelihood.len())
    }

    /// Number of points of all words.
    pub fn n_word_points(&self) -> usize {
        self.words.iter().map(|w| w.points.len()).sum()
    }

    /// The features that have a word, in the order of their poses.
    pub fn occurrences(&self, scene: &PreparedScene<'_>) -> Occurrences {
        let mut found = Occurrences::default();
        for (pose, &word) in scene.features.poses.iter().zip(&self.matching.words) {
            if (word as usize) < self.words.len() {
                found.poses.push(*pose);
                found.words.push(word);
            }
        }
        found
    }
}
