//! Candidate words sampled from the scene, each accepted when it lowers the BIC (III, III-A).

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::prepared::PreparedScene;
use super::reconstruction::Reconstruction;
use super::trial::Trial;
use crate::bic_alphabet::constants::CANDIDATES_PER_THREAD;
use crate::bic_alphabet::pose::mix;
use crate::bic_alphabet::words::MAX_WORD_POINTS;
use crate::error::Result;

/// The alphabet that was chosen, and how.
pub(in crate::bic_alphabet) struct ChosenWords {
    pub best: Reconstruction,
    /// The BIC after each candidate; `None` when the alphabet was given.
    pub bics: Option<Vec<f64>>,
    /// Why no more candidates were tried.
    pub stop_reason: &'static str,
}

/// Tries candidates in random order until there are no more, or `max_rejections` in a row did not lower the BIC.
///
/// Several are tried at once against the same alphabet; the first in the order that lowers the BIC is accepted and
/// those after it are tried again, so that the result is that of trying one after the other.
pub(in crate::bic_alphabet) fn choose_words(
    scene: &PreparedScene<'_>,
    progress: &dyn Progress,
) -> Result<ChosenWords> {
    let options = scene.options;
    let candidates = candidates(scene);
    let threads = rayon::current_num_threads();
    let mut trials = vec![Trial::default(); threads * CANDIDATES_PER_THREAD];
    let mut best = Reconstruction::empty(scene);
    let mut bics: Vec<f64> = Vec::with_capacity(candidates.len());
    let (mut next, mut at_once, mut rejections) = (0, 1, 0);
    let mut stop_reason = "every candidate was tried";
    while next < candidates.len() {
        progress.check()?;
        progress.update("choosing words", next as f32 / candidates.len() as f32);
        let batch = &candidates[next..(next + at_once).min(candidates.len())];
        let now = best.bic(scene);
        let tried = try_all(&best, scene, batch, now, &mut trials);
        let accepted = (0..).zip(&tried).find_map(|(k, bic)| Some((k, (*bic)?)));
        let rejected = accepted.map_or(tried.len(), |(k, _)| k);
        let left = options.max_rejections as usize - rejections;
        if rejected >= left {
            bics.extend(std::iter::repeat_n(now, left));
            stop_reason = "max_rejections reached";
            break;
        }
        bics.extend(std::iter::repeat_n(now, rejected));
        next += rejected;
        match accepted {
            Some((k, bic)) => {
                best.accept(scene, scene.word(batch[k]), &mut trials[k]);
                bics.push(bic);
                next += 1;
                rejections = 0;
                at_once = threads;
            }
            None => {
                rejections += rejected;
                at_once = (2 * at_once).min(trials.len());
            }
        }
        if next == options.iterations as usize {
            stop_reason = "iterations reached";
        }
    }
    Ok(ChosenWords { best, bics: Some(bics), stop_reason })
}

/// The features to take words at: at most `iterations` of those with enough points, in an order drawn by the seed.
fn candidates(scene: &PreparedScene<'_>) -> Vec<u32> {
    let options = scene.options;
    let sizes = options.min_points as usize..=MAX_WORD_POINTS;
    let fits = |&f: &u32| sizes.contains(&(scene.descriptors.counts[f as usize] as usize));
    let mut candidates: Vec<u32> = (0..scene.features.len() as u32).filter(fits).collect();
    candidates.sort_by_cached_key(|&f| {
        (mix(options.random_state.wrapping_mul(3) ^ mix(u64::from(f) << 32)), f)
    });
    candidates.truncate(options.iterations as usize);
    candidates
}

/// The BIC with each candidate's word, where it is below `limit`. `trials` then hold what those candidates change.
fn try_all(
    best: &Reconstruction,
    scene: &PreparedScene<'_>,
    candidates: &[u32],
    limit: f64,
    trials: &mut [Trial],
) -> Vec<Option<f64>> {
    let mut found = vec![None; candidates.len()];
    parallel::for_each(candidates.iter().zip(trials).zip(&mut found), |_, ((&f, trial), found)| {
        *found = best.try_word(scene, &scene.word(f), limit, trial);
    });
    found
}
