//! Learning: words are sampled from the scene and accepted when the BIC falls (III, III-A).

use std::time::Instant;

use rayon::prelude::*;
use surfabet_geom::{KdTree, PointCloud, Progress};

use super::choice::quality::{Fidelity, fidelity};
use super::choice::reconstruction::{Bench, Score, Stage};
use super::choice::reduce::reduce;
use super::features::Features;
use super::features::descriptor::Descriptors;
use super::model::{BicAlphabet, BicAlphabetModel, BicHeader, Occurrences};
use super::options::BicAlphabetOptions;
use super::pose::mix;
use super::words::MAX_WORD_POINTS;
use crate::error::Result;
use crate::options::Options;
use crate::report::{Report, lost};
use crate::scans::Scene;

/// Most candidates tried at once per thread.
const MOST_PER_THREAD: usize = 4;

/// Learns an alphabet from `cloud`, and describes the cloud with it.
///
/// Results depend neither on the number of threads nor on the order of the points.
///
/// # Errors
/// [`Error::InvalidParameter`](crate::Error::InvalidParameter) for options outside their domains,
/// [`Error::EmptyCloud`](crate::Error::EmptyCloud) when no point is left,
/// [`Error::TooLarge`](crate::Error::TooLarge) when the scene exceeds what poses can store,
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn learn(
    cloud: &PointCloud,
    options: &BicAlphabetOptions,
    progress: &dyn Progress,
) -> Result<BicAlphabetModel> {
    with_stage(cloud, options, progress, |stage, report| {
        let start = Instant::now();
        let mut score = grow(stage, report, progress)?;
        report.add_time("choosing words", start.elapsed().as_secs_f64());
        finish(cloud, stage, &mut score, report, progress)
    })
}

impl BicAlphabet {
    /// Describes another cloud with this alphabet (IV-B). Only features, matching and, where the options ask for it,
    /// the reduction of occurrences take place; nothing is learned.
    ///
    /// # Errors
    /// As [`learn`], and [`Error::Inconsistent`](crate::Error::Inconsistent) when the options contradict those that
    /// the alphabet was learned with, or it has no words.
    pub fn describe(
        &self,
        cloud: &PointCloud,
        options: &BicAlphabetOptions,
        progress: &dyn Progress,
    ) -> Result<BicAlphabetModel> {
        self.check(options)?;
        with_stage(cloud, options, progress, |stage, report| {
            let words = self.words().to_vec();
            let matching = report.time("matching words", || Score::matching(stage, &words));
            let mut score = report.time("placing words", || Score::of(stage, words, matching));
            report.stop_reason = "the alphabet was given";
            finish(cloud, stage, &mut score, report, progress)
        })
    }
}

/// Prepares a scene, and runs `work` on it.
fn with_stage(
    cloud: &PointCloud,
    options: &BicAlphabetOptions,
    progress: &dyn Progress,
    work: impl FnOnce(&Stage<'_>, &mut Report) -> Result<BicAlphabetModel>,
) -> Result<BicAlphabetModel> {
    options.check()?;
    let mut report = Report { not_kept: lost(cloud, &[]), ..Report::default() };
    let scene = report.time("preparing the scene", || {
        Scene::new(cloud, options.deviation(), options.min_range, progress)
    })?;
    let tree = KdTree::new(&scene.positions)?;
    let features =
        report.time("extracting features", || Features::new(&scene, &tree, options, progress))?;
    let descriptors = report.time("describing features", || {
        Descriptors::new(&scene, &tree, &features, options, progress)
    })?;
    let stage = report.time("preparing the likelihood", || {
        Stage::new(&scene, &tree, &features, &descriptors, options)
    });
    report.add_figure("points", cloud.len() as f64);
    report.add_figure("points too near", scene.too_near as f64);
    report.add_figure("duplicate points", scene.duplicates as f64);
    report.add_figure("distinct points", scene.len() as f64);
    report.add_figure("features", features.len() as f64);
    report.add_figure("interest points", features.interest as f64);
    work(&stage, &mut report)
}

/// Candidates in random order, each accepted when it lowers the BIC.
///
/// Several are tried at once against the same alphabet; the first in the order that lowers the BIC is accepted and
/// those after it are tried again, so that the result is that of trying one after the other.
fn grow(stage: &Stage<'_>, report: &mut Report, progress: &dyn Progress) -> Result<Score> {
    let options = stage.options;
    let counts = &stage.descriptors.counts;
    let fits = |&f: &u32| {
        (options.min_points as usize..=MAX_WORD_POINTS).contains(&(counts[f as usize] as usize))
    };
    let mut candidates: Vec<u32> = (0..stage.features.len() as u32).filter(fits).collect();
    candidates.sort_by_cached_key(|&f| {
        (mix(options.random_state.wrapping_mul(3) ^ mix(u64::from(f) << 32)), f)
    });
    candidates.truncate(options.iterations as usize);

    let threads = rayon::current_num_threads();
    let mut benches = vec![Bench::default(); threads * MOST_PER_THREAD];
    let mut score = Score::nothing(stage);
    let mut trace: Vec<f64> = Vec::with_capacity(candidates.len());
    let mut rejections = 0;
    let mut at_once = 1;
    let mut next = 0;
    report.stop_reason = "every candidate was tried";
    while next < candidates.len() {
        progress.check()?;
        progress.update("choosing words", next as f32 / candidates.len() as f32);
        let batch = &candidates[next..(next + at_once).min(candidates.len())];
        let now = score.bic(stage);
        let found: Vec<Option<f64>> = batch
            .par_iter()
            .zip(&mut benches)
            .with_max_len(1)
            .map(|(&f, bench)| score.with(stage, &stage.word(f), now, bench))
            .collect();
        let accepted = (0..).zip(&found).find_map(|(k, bic)| Some((k, (*bic)?)));
        let rejected = accepted.map_or(found.len(), |(k, _)| k);
        let left = options.max_rejections as usize - rejections;
        if rejected >= left {
            trace.extend(std::iter::repeat_n(now, left));
            report.stop_reason = "max_rejections reached";
            break;
        }
        trace.extend(std::iter::repeat_n(now, rejected));
        next += rejected;
        match accepted {
            Some((k, bic)) => {
                score.accept(stage, stage.word(batch[k]), &benches[k]);
                trace.push(bic);
                next += 1;
                rejections = 0;
                at_once = threads;
            }
            None => {
                rejections += rejected;
                at_once = (2 * at_once).min(benches.len());
            }
        }
        if next == options.iterations as usize {
            report.stop_reason = "iterations reached";
        }
    }
    report.iterations = trace.len();
    report.objectives.push(("bic".to_owned(), trace));
    Ok(score)
}

/// Notes how good the model is, reduces it, and puts it together.
fn finish(
    cloud: &PointCloud,
    stage: &Stage<'_>,
    score: &mut Score,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<BicAlphabetModel> {
    let options = stage.options;
    let word_points: usize = score.words.iter().map(|w| w.points.len()).sum();
    report.add_figure("words", score.words.len() as f64);
    report.add_figure("word points", word_points as f64);
    let alphabet = BicAlphabet::learned(std::mem::take(&mut score.words), options)?;
    score.words = alphabet.words().to_vec();

    let note = |score: &Score, names: [&'static str; 4], report: &mut Report| -> Result<()> {
        let occurrences = occurrences(stage, score);
        // 12 bytes per point of a word, 24 + 4 per occurrence (IV).
        let bytes = 12 * word_points + 28 * occurrences.words.len();
        let start = Instant::now();
        let Fidelity { inliers, outliers } = fidelity(stage, &score.sparse, progress)?;
        report.add_time("measuring", start.elapsed().as_secs_f64());
        report.add_figure(names[0], occurrences.words.len() as f64);
        report.add_figure(names[1], bytes as f64);
        report.add_figure(names[2], inliers);
        report.add_figure(names[3], outliers);
        Ok(())
    };
    report.add_figure("bic", score.bic(stage));
    report.add_figure("log-likelihood", score.log_likelihood(stage));
    note(score, ["occurrences", "paper bytes", "inliers", "outliers"], report)?;
    if options.reduce {
        let start = Instant::now();
        reduce(stage, score, progress)?;
        report.add_time("removing occurrences", start.elapsed().as_secs_f64());
        report.add_figure("log-likelihood reduced", score.log_likelihood(stage));
        let names =
            ["occurrences reduced", "paper bytes reduced", "inliers reduced", "outliers reduced"];
        note(score, names, report)?;
    }
    let parts = occurrences(stage, score);
    let header = BicHeader {
        n_points: cloud.len() as u64,
        origin: stage.scene.origin,
        epsilon: options.epsilon(),
        low: stage.features.low,
    };
    BicAlphabetModel::learned(alphabet, parts, header, std::mem::take(report))
}

/// Features that have a word, in the order of their poses.
fn occurrences(stage: &Stage<'_>, score: &Score) -> Occurrences {
    let mut found = Occurrences::default();
    for (pose, &word) in stage.features.poses.iter().zip(&score.matching.words) {
        if (word as usize) < score.words.len() {
            found.poses.push(*pose);
            found.words.push(word);
        }
    }
    found
}
