//! The scene as an alphabet rebuilds it, and its score: the Bayesian information criterion (eq. 4, 5).

use super::matching::Matching;
use super::prepared::PreparedScene;
use crate::bic_alphabet::likelihood::{KernelSums, Shares};
use crate::bic_alphabet::model::Occurrences;
use crate::bic_alphabet::rebuild::{Sparsified, Stamp};
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
    /// What each occurrence adds to them.
    pub(super) shares: Shares,
    /// Number of decoded points, M.
    pub(super) n_decoded: i64,
    /// Number of parameters, k (eq. 5).
    pub(super) n_parameters: usize,
}

/// The prior of an association of a measured with a decoded point, `P(a)` of eq. 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::bic_alphabet) enum Prior {
    /// 1/M (eq. 9).
    Uniform,
    /// 1, so that the number of decoded points does not matter by itself.
    One,
}

impl Prior {
    /// What the prior divides by, with so many decoded points.
    pub fn divisor(self, n_decoded: i64) -> i64 {
        match self {
            Self::Uniform => n_decoded,
            Self::One => 1,
        }
    }
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
            sparsified: Sparsified::empty(scene.features.len()),
            sums: scene.likelihood.empty_sums(),
            shares: scene.empty_shares(),
            n_decoded: 0,
            n_parameters: 0,
        }
    }

    /// With the nearest of `words` at every feature (`matching`), computed at once.
    pub fn new(scene: &PreparedScene<'_>, words: Vec<BicWord>, matching: Matching) -> Self {
        let stamps: Vec<Stamp> = words.iter().map(|w| scene.stamp(w)).collect();
        let sparsified = Sparsified::new(scene.places(), &matching.words, stamps);
        let likelihood = &scene.likelihood;
        let mut sums = likelihood.empty_sums();
        let mut shares = scene.empty_shares();
        for (place, kept) in sparsified.by_place() {
            let positions: Vec<[f32; 3]> = kept.iter().map(|p| p.position).collect();
            let reachable = scene.reachable.of(place);
            likelihood.scatter(&positions, reachable, true, &mut sums.sums, |_| ());
            shares.set(likelihood, &scene.reachable, place, &positions);
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
        Self { words, matching, sparsified, sums, shares, n_decoded, n_parameters }
    }

    /// `ln L` (eq. 6).
    pub fn log_likelihood(&self, scene: &PreparedScene<'_>) -> f64 {
        self.log_likelihood_with(scene, Prior::Uniform)
    }

    /// `ln L` with a prior of associations.
    pub(super) fn log_likelihood_with(&self, scene: &PreparedScene<'_>, prior: Prior) -> f64 {
        scene.likelihood.log_likelihood(self.sums.total, prior.divisor(self.n_decoded))
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
