//! Removing redundant occurrences (III-D).
//!
//! Words are visited by falling number of occurrences, the occurrences of a word in the order of their poses. One is
//! removed when the likelihood without it is not smaller. The paper leaves open which likelihood that is. With the factor
//! 1/M of eq. 9, fewer decoded points raise it a little by themselves, so that more than half of the occurrences go and
//! with them points that nothing else explains. Without the factor hardly any occurrence goes, unless the likelihood may
//! fall by a tolerance.

use surfabet_geom::Progress;

use super::prepared::PreparedScene;
use super::reconstruction::{Prior, Reconstruction};
use super::trial::Trial;
use crate::bic_alphabet::constants::OCCURRENCES_PER_CHECK;
use crate::error::Result;

/// Removes every occurrence without which the likelihood does not fall, or by no more than the options' tolerance.
pub(in crate::bic_alphabet) fn reduce(
    scene: &PreparedScene<'_>,
    best: &mut Reconstruction,
    progress: &dyn Progress,
) -> Result<()> {
    let mut of_word: Vec<Vec<u32>> = vec![Vec::new(); best.words.len()];
    for (f, &word) in (0..).zip(&best.matching.words) {
        if let Some(occurrences) = of_word.get_mut(word as usize) {
            occurrences.push(f);
        }
    }
    // Stable: of equally frequent words the older is visited first.
    of_word.sort_by_key(|occurrences| std::cmp::Reverse(occurrences.len()));
    let total = scene.features.len().max(1) as f32;
    let mut trial = Trial::default();
    let tolerance = scene.options.reduce_tolerance;
    let prior = if tolerance.is_some() { Prior::One } else { Prior::Uniform };
    let least = -tolerance.unwrap_or(0.0);
    let mut now = best.log_likelihood_with(scene, prior);
    for (k, f) in of_word.into_iter().flatten().enumerate() {
        if k % OCCURRENCES_PER_CHECK == 0 {
            progress.check()?;
            progress.update("removing occurrences", k as f32 / total);
        }
        let without = best.try_without(scene, f, prior, &mut trial);
        if without - now >= least {
            best.remove(scene, f, &mut trial);
            now = without;
        }
    }
    Ok(())
}
