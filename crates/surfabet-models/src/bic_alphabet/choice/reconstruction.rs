//! The BIC of an alphabet (eq. 4), candidate by candidate: what a word changes is worked out where it changes it, and
//! is the same, to the bit, as scoring everything anew.

use surfabet_geom::KdTree;

use crate::bic_alphabet::choice::matching::Matching;
use crate::bic_alphabet::features::Features;
use crate::bic_alphabet::features::descriptor::{Descriptors, penalty_steps};
use crate::bic_alphabet::likelihood::{LANES, Reaches, Samples, Sums, bic};
use crate::bic_alphabet::options::BicAlphabetOptions;
use crate::bic_alphabet::rebuild::sparsify::{Change, Sparse, Stamp, rebuild};
use crate::bic_alphabet::words::BicWord;
use crate::scans::Scene;

/// What scoring needs of a scene and never changes.
pub(crate) struct Stage<'a> {
    pub scene: &'a Scene,
    pub tree: &'a KdTree,
    pub features: &'a Features,
    pub descriptors: &'a Descriptors,
    pub options: &'a BicAlphabetOptions,
    pub samples: Samples,
    reaches: Reaches,
}

impl<'a> Stage<'a> {
    pub fn new(
        scene: &'a Scene,
        tree: &'a KdTree,
        features: &'a Features,
        descriptors: &'a Descriptors,
        options: &'a BicAlphabetOptions,
    ) -> Self {
        let samples = Samples::new(scene, options.floor);
        // A word's points are rounded by less than a step beyond the radius.
        let reaches = samples.reaches(&features.frames, 1.03 * options.radius as f32);
        Self { scene, tree, features, descriptors, options, samples, reaches }
    }

    /// The word at a feature.
    pub fn word(&self, feature: u32) -> BicWord {
        let f = feature as usize;
        let pixels = self.descriptors.pixels;
        let descriptor = &self.descriptors.values[f * pixels..(f + 1) * pixels];
        let frame = &self.features.frames[f];
        BicWord::take(self.scene, self.tree, frame, descriptor, self.options.radius)
    }

    pub fn stamp(&self, word: &BicWord) -> Stamp {
        Stamp::new(word, self.options.radius, self.options.epsilon())
    }

    fn epsilon(&self) -> f32 {
        self.options.epsilon() as f32
    }
}

/// An alphabet, the model that it gives of the scene, and its score.
#[derive(Debug, Clone)]
pub(crate) struct Score {
    pub words: Vec<BicWord>,
    pub matching: Matching,
    pub sparse: Sparse,
    sums: Sums,
    decoded: i64,
    parameters: usize,
}

/// Memory for trying candidates, one per thread.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bench {
    change: Change,
    distances: Vec<u32>,
    taken: Vec<u32>,
    positions: Vec<[f32; 3]>,
    sums: Vec<[i64; LANES]>,
    touched: Vec<u32>,
    is_touched: Vec<bool>,
    /// What a change does to the sum of the logarithms.
    gain: i64,
}

impl Bench {
    /// Forgets the sums of the change before.
    fn clear_sums(&mut self, stage: &Stage<'_>) {
        self.sums.resize(stage.samples.n_blocks(), [0; LANES]);
        self.is_touched.resize(stage.samples.n_blocks(), false);
        for b in self.touched.drain(..) {
            self.sums[b as usize] = [0; LANES];
            self.is_touched[b as usize] = false;
        }
        // Points of one occurrence feel the same blocks.
        self.change.flips.sort_by_key(|f| f.1);
    }
}

impl Score {
    /// No words: nothing explains the scene, and the BIC is infinite.
    pub fn nothing(stage: &Stage<'_>) -> Self {
        Self {
            words: Vec::new(),
            matching: Matching::none(stage.features.len()),
            sparse: Sparse::new(&[], stage.features.len(), stage.epsilon()),
            sums: stage.samples.nothing(),
            decoded: 0,
            parameters: 0,
        }
    }

    /// The nearest word of every feature.
    pub fn matching(stage: &Stage<'_>, words: &[BicWord]) -> Matching {
        let penalty = penalty_steps(stage.options.empty_penalty);
        Matching::new(stage.descriptors, words, penalty)
    }

    /// Everything at once.
    pub fn of(stage: &Stage<'_>, words: Vec<BicWord>, matching: Matching) -> Self {
        let stamps: Vec<Stamp> = words.iter().map(|w| stage.stamp(w)).collect();
        let frames = &stage.features.frames;
        let sparse = rebuild(frames, &matching.words, &stamps, stage.epsilon());
        let mut sums = stage.samples.nothing();
        for (p, _) in sparse.arena.points.iter().zip(&sparse.kept).filter(|(_, k)| **k) {
            let reach = stage.reaches.of(p.owner);
            stage.samples.scatter(&[p.position], reach, true, &mut sums.sums, |_| ());
        }
        sums.total = 0;
        for (b, (sums_of, logs)) in sums.sums.iter().zip(&mut sums.logs).enumerate() {
            for lane in 0..stage.samples.lanes(b) {
                logs[lane] = stage.samples.log(sums_of[lane]);
                sums.total += logs[lane];
            }
        }
        let decoded = sparse.count() as i64;
        let parameters = words.iter().map(|w| 3 * w.points.len()).sum();
        Self { words, matching, sparse, sums, decoded, parameters }
    }

    /// ln L of the model.
    pub fn log_likelihood(&self, stage: &Stage<'_>) -> f64 {
        stage.samples.log_likelihood(self.sums.total, self.decoded)
    }

    pub fn bic(&self, stage: &Stage<'_>) -> f64 {
        if self.decoded == 0 {
            return f64::INFINITY;
        }
        bic(self.log_likelihood(stage), self.parameters, stage.samples.len())
    }

    /// The BIC with one more word, where it is below `limit`; `bench` then holds what changes.
    pub fn with(
        &self,
        stage: &Stage<'_>,
        word: &BicWord,
        limit: f64,
        bench: &mut Bench,
    ) -> Option<f64> {
        let penalty = penalty_steps(stage.options.empty_penalty);
        stage.descriptors.distances(&word.descriptor, penalty, &mut bench.distances);
        self.matching.taken(&bench.distances, &mut bench.taken);
        let stamp = stage.stamp(word);
        bench.change.added.clear();
        stamp.place(&stage.features.frames, &bench.taken, &mut bench.change.added);
        self.sparse.change(&bench.taken, stage.epsilon(), &mut bench.change);
        let parameters = self.parameters + 3 * word.points.len();
        let decoded = self.decoded + bench.change.balance();
        if decoded == 0 {
            return None;
        }
        let score = |gain: i64| {
            let log_likelihood = stage.samples.log_likelihood(self.sums.total + gain, decoded);
            bic(log_likelihood, parameters, stage.samples.len())
        };
        bench.clear_sums(stage);
        // With all that comes and nothing gone yet, every sum is at least what it will be.
        self.scatter(stage, bench, true);
        if score(self.gain(stage, bench)) >= limit {
            return None;
        }
        self.scatter(stage, bench, false);
        bench.gain = self.gain(stage, bench);
        Some(score(bench.gain)).filter(|&bic| bic < limit)
    }

    /// ln L without the occurrence at a feature; `bench` then holds what changes.
    pub fn without(&self, stage: &Stage<'_>, feature: u32, bench: &mut Bench) -> f64 {
        bench.change.added.clear();
        self.sparse.change(&[feature], stage.epsilon(), &mut bench.change);
        bench.clear_sums(stage);
        self.scatter(stage, bench, true);
        self.scatter(stage, bench, false);
        bench.gain = self.gain(stage, bench);
        let decoded = self.decoded + bench.change.balance();
        if decoded == 0 {
            return f64::NEG_INFINITY;
        }
        stage.samples.log_likelihood(self.sums.total + bench.gain, decoded)
    }

    /// Adds the Gaussians of the points that come, or takes away those of the points that go.
    fn scatter(&self, stage: &Stage<'_>, bench: &mut Bench, come: bool) {
        let Bench { change, positions, sums, touched, is_touched, .. } = bench;
        for of_owner in change.flips.chunk_by(|a, b| a.1 == b.1) {
            positions.clear();
            positions.extend(of_owner.iter().filter(|f| f.2 == come).map(|f| f.0));
            let reach = stage.reaches.of(of_owner[0].1);
            stage.samples.scatter(positions, reach, come, sums, |b| {
                if !is_touched[b as usize] {
                    is_touched[b as usize] = true;
                    touched.push(b);
                }
            });
        }
    }

    /// What the sums in `bench` do to the sum of the logarithms.
    fn gain(&self, stage: &Stage<'_>, bench: &Bench) -> i64 {
        let mut gain = 0;
        for &b in &bench.touched {
            let b = b as usize;
            for lane in 0..stage.samples.lanes(b) {
                if bench.sums[b][lane] != 0 {
                    let log = stage.samples.log(self.sums.sums[b][lane] + bench.sums[b][lane]);
                    gain += log - self.sums.logs[b][lane];
                }
            }
        }
        gain
    }

    fn settle_sums(&mut self, stage: &Stage<'_>, bench: &Bench) {
        for &b in &bench.touched {
            let b = b as usize;
            for lane in 0..stage.samples.lanes(b) {
                if bench.sums[b][lane] != 0 {
                    self.sums.sums[b][lane] += bench.sums[b][lane];
                    self.sums.logs[b][lane] = stage.samples.log(self.sums.sums[b][lane]);
                }
            }
        }
        self.sums.total += bench.gain;
        self.decoded += bench.change.balance();
    }

    /// Makes the change of [`Score::with`] real.
    pub fn accept(&mut self, stage: &Stage<'_>, word: BicWord, bench: &Bench) {
        self.settle_sums(stage, bench);
        self.sparse = self.sparse.changed(&bench.change, stage.epsilon());
        self.matching.give(self.words.len() as u32, &bench.taken, &bench.distances);
        self.parameters += 3 * word.points.len();
        self.words.push(word);
    }

    /// Makes the change of [`Score::without`] real.
    pub fn remove(&mut self, stage: &Stage<'_>, feature: u32, bench: &Bench) {
        self.settle_sums(stage, bench);
        self.sparse.remove(&bench.change);
        self.matching.words[feature as usize] = u32::MAX;
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::bic_alphabet::choice::reduce::reduce;

    /// A corner of two planes with a bump, sampled at random.
    pub fn scene(points: &[[f32; 3]]) -> Scene {
        let positions = points
            .iter()
            .map(|&[u, v, s]| {
                let bump = 0.05 * (-((u - 0.3).powi(2) + (v - 0.3).powi(2)) / 0.005).exp();
                if s < 0.5 { [u, v, bump] } else { [u, 0.0, v] }
            })
            .collect();
        let (cloud, _) = PointCloud::from_positions(positions);
        Scene::new(&cloud, crate::scans::Deviation::default(), 0.0, &Silent).unwrap()
    }

    pub fn on_stage<T>(
        points: &[[f32; 3]],
        options: &BicAlphabetOptions,
        work: impl FnOnce(&Stage<'_>) -> T,
    ) -> T {
        let scene = scene(points);
        let tree = KdTree::new(&scene.positions).unwrap();
        let features = Features::new(&scene, &tree, options, &Silent).unwrap();
        let descriptors = Descriptors::new(&scene, &tree, &features, options, &Silent).unwrap();
        work(&Stage::new(&scene, &tree, &features, &descriptors, options))
    }

    /// Kept points by rank, and everything that a score adds up.
    fn content(score: &Score) -> (Vec<u64>, &Matching, &Sums, i64, usize) {
        let pairs = score.sparse.arena.points.iter().zip(&score.sparse.kept);
        let mut kept: Vec<u64> = pairs.filter(|(_, k)| **k).map(|(p, _)| p.rank).collect();
        kept.sort_unstable();
        (kept, &score.matching, &score.sums, score.decoded, score.parameters)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn step_by_step_is_the_same_to_the_bit_as_all_at_once(
            points in prop::collection::vec(prop::array::uniform3(0.0_f32..1.0), 100..500),
            candidates in prop::collection::vec(any::<prop::sample::Index>(), 1..10),
        ) {
            let options = BicAlphabetOptions { epsilon: Some(0.03), ..BicAlphabetOptions::default() };
            on_stage(&points, &options, |stage| {
                let mut score = Score::nothing(stage);
                let mut bench = Bench::default();
                for candidate in candidates {
                    let word = stage.word(candidate.index(stage.features.len()) as u32);
                    if word.points.is_empty() {
                        continue;
                    }
                    let words = [score.words.clone(), vec![word.clone()]].concat();
                    let matching = Score::matching(stage, &words);
                    let full = Score::of(stage, words, matching);
                    let now = score.bic(stage);
                    let found = score.with(stage, &word, f64::INFINITY, &mut bench);
                    prop_assert_eq!(found, Some(full.bic(stage)));
                    // What a bound rejects would not have been accepted.
                    let bounded = score.with(stage, &word, now, &mut bench);
                    prop_assert_eq!(bounded, found.filter(|&bic| bic < now));
                    if bounded.is_some() {
                        score.accept(stage, word, &bench);
                        prop_assert_eq!(content(&score), content(&full));
                        prop_assert_eq!(score.bic(stage), full.bic(stage));
                    }
                }
                Ok(())
            })?;
        }

        #[test]
        fn a_reduction_never_lowers_the_likelihood_and_leaves_what_would(
            points in prop::collection::vec(prop::array::uniform3(0.0_f32..1.0), 100..400),
            chosen in prop::collection::vec(any::<prop::sample::Index>(), 1..4),
        ) {
            let options = BicAlphabetOptions { epsilon: Some(0.03), ..BicAlphabetOptions::default() };
            on_stage(&points, &options, |stage| {
                let at = |i: prop::sample::Index| stage.word(i.index(stage.features.len()) as u32);
                let words: Vec<BicWord> =
                    chosen.into_iter().map(at).filter(|w| !w.points.is_empty()).collect();
                if words.is_empty() {
                    return Ok(());
                }
                let matching = Score::matching(stage, &words);
                let full = Score::of(stage, words, matching);
                // One removal after the other, each held against the likelihood before it.
                let mut plain = full.clone();
                let mut bench = Bench::default();
                for f in 0..stage.features.len() as u32 {
                    let before = plain.log_likelihood(stage);
                    let without = plain.without(stage, f, &mut bench);
                    let mut removed = plain.clone();
                    removed.remove(stage, f, &bench);
                    prop_assert_eq!(removed.log_likelihood(stage), without);
                    if without >= before {
                        plain = removed;
                    }
                }
                let mut reduced = full.clone();
                reduce(stage, &mut reduced, &Silent).unwrap();
                prop_assert!(reduced.log_likelihood(stage) >= full.log_likelihood(stage));
                let left = |s: &Score| s.matching.words.iter().filter(|&&w| w != u32::MAX).count();
                prop_assert!(left(&reduced) >= 1 && left(&reduced) <= left(&full));
                Ok(())
            })?;
        }
    }
}
