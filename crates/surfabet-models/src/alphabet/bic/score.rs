//! The BIC of an alphabet (eq. 4), candidate by candidate: what a word changes is worked out where it changes it, and
//! is the same, to the bit, as scoring everything anew.

use surfabet_geom::KdTree;

use super::descriptor::{Descriptors, penalty_steps};
use super::features::Features;
use super::likelihood::{LANES, Reaches, Samples, Sums, bic};
use super::matching::Matching;
use super::options::BicOptions;
use super::sparsify::{Change, Sparse, Stamp, rebuild};
use super::words::BicWord;
use crate::alphabet::Scene;

/// What scoring needs of a scene and never changes.
pub(super) struct Stage<'a> {
    pub scene: &'a Scene,
    pub tree: &'a KdTree,
    pub features: &'a Features,
    pub descriptors: &'a Descriptors,
    pub options: &'a BicOptions,
    pub samples: Samples,
    reaches: Reaches,
}

impl<'a> Stage<'a> {
    pub fn new(
        scene: &'a Scene,
        tree: &'a KdTree,
        features: &'a Features,
        descriptors: &'a Descriptors,
        options: &'a BicOptions,
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
pub(super) struct Score {
    pub words: Vec<BicWord>,
    pub matching: Matching,
    pub sparse: Sparse,
    sums: Sums,
    decoded: i64,
    parameters: usize,
}

/// Memory for trying candidates, one per thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Bench {
    change: Change,
    distances: Vec<u32>,
    taken: Vec<u32>,
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

    /// Everything at once.
    pub fn of(stage: &Stage<'_>, words: Vec<BicWord>) -> Self {
        let penalty = penalty_steps(stage.options.empty_penalty);
        let matching = Matching::new(stage.descriptors, &words, penalty);
        let stamps: Vec<Stamp> = words.iter().map(|w| stage.stamp(w)).collect();
        let frames = &stage.features.frames;
        let sparse = rebuild(frames, &matching.words, &stamps, stage.epsilon());
        let mut sums = stage.samples.nothing();
        for (p, _) in sparse.arena.points.iter().zip(&sparse.kept).filter(|(_, k)| **k) {
            let reach = stage.reaches.of(p.owner);
            stage.samples.scatter(p.position, reach, true, &mut sums.sums, |_| ());
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
        let Bench { change, sums, touched, is_touched, .. } = bench;
        for &(position, owner, _) in change.flips.iter().filter(|f| f.2 == come) {
            stage.samples.scatter(position, stage.reaches.of(owner), come, sums, |b| {
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
