//! Removing redundant occurrences (III-D).
//!
//! Words are visited by falling number of occurrences, the occurrences of a word in the order of their poses. One is
//! removed when the likelihood (eq. 7 with 9) without it is not smaller. The paper leaves open which likelihood that
//! is: with the factor 1/M, as here and in eq. 9, fewer decoded points raise it a little by themselves, so that more
//! than half of the occurrences go; without it hardly any does.

use surfabet_geom::Progress;

use super::prepared::PreparedScene;
use super::reconstruction::Reconstruction;
use super::trial::Trial;
use crate::bic_alphabet::constants::OCCURRENCES_PER_CHECK;
use crate::error::Result;

/// Removes every occurrence without which the likelihood does not fall.
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
    let mut now = best.log_likelihood(scene);
    for (k, f) in of_word.into_iter().flatten().enumerate() {
        if k % OCCURRENCES_PER_CHECK == 0 {
            progress.check()?;
            progress.update("removing occurrences", k as f32 / total);
        }
        let without = best.try_without(scene, f, &mut trial);
        if without >= now {
            best.remove(scene, f, &trial);
            now = without;
        }
    }
    Ok(())
}
