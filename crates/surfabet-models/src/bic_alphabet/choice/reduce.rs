//! Removing redundant occurrences (III-D).
//!
//! Words are visited by falling number of occurrences, the occurrences of a word in the order of their poses, and one
//! goes when the likelihood (eq. 7 with 9) does not fall without it. The paper leaves open what counts as the
//! likelihood: with the factor 1/M, as here and as eq. 9 has it, less points of the decoded scene are worth a little
//! by themselves, so that about half of the occurrences go; without it next to none does.

use surfabet_geom::Progress;

use crate::bic_alphabet::choice::reconstruction::{Bench, Score, Stage};
use crate::error::Result;

/// Occurrences between two looks at the progress.
const BATCH: usize = 256;

/// Takes out every occurrence without which the likelihood does not fall.
pub(crate) fn reduce(stage: &Stage<'_>, score: &mut Score, progress: &dyn Progress) -> Result<()> {
    let mut of_word: Vec<Vec<u32>> = vec![Vec::new(); score.words.len()];
    for (f, &word) in (0..).zip(&score.matching.words) {
        if let Some(occurrences) = of_word.get_mut(word as usize) {
            occurrences.push(f);
        }
    }
    // Stable: of equally frequent words the older goes first.
    of_word.sort_by_key(|occurrences| std::cmp::Reverse(occurrences.len()));
    let total = stage.features.len().max(1) as f32;
    let mut bench = Bench::default();
    let mut now = score.log_likelihood(stage);
    for (k, f) in of_word.into_iter().flatten().enumerate() {
        if k % BATCH == 0 {
            progress.check()?;
            progress.update("removing occurrences", k as f32 / total);
        }
        let without = score.without(stage, f, &mut bench);
        if without >= now {
            score.remove(stage, f, &bench);
            now = without;
        }
    }
    Ok(())
}
