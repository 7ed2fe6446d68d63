//! Candidate words: centroids of clustered descriptors.

use rayon::prelude::*;
use surfabet_geom::Progress;

use crate::alphabet::candidates::descriptor::{N, Patch};
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, Word};
use crate::error::Result;

/// Rounds of clustering at most.
const ROUNDS: usize = 10;

/// Descriptors that are clustered at most, spread evenly over those there are.
const SAMPLE: usize = 4096;

/// Clusters `patches` around at most `n` words beside the plane, which comes first.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(in crate::alphabet) fn clustered(
    patches: &[&Patch],
    n: usize,
    progress: &dyn Progress,
) -> Result<Vec<Word>> {
    let step = patches.len().div_ceil(SAMPLE).max(1);
    let patches: Vec<&Patch> = patches.iter().copied().step_by(step).collect();
    let mut words = farthest_first(&patches, n, progress)?;
    for _ in 0..ROUNDS {
        let next = centroids(&patches, &words, progress)?;
        if next == words {
            break;
        }
        words = next;
    }
    let plane = Word::plane();
    words.retain(|w| w.mask != 0 && *w != plane);
    words.sort();
    words.dedup();
    words.insert(0, plane);
    Ok(words)
}

/// The plane, and again and again the patch that the words so far tell worst.
fn farthest_first(patches: &[&Patch], n: usize, progress: &dyn Progress) -> Result<Vec<Word>> {
    let mut words = vec![Word::plane()];
    let mut worst = vec![f32::INFINITY; patches.len()];
    while words.len() <= n {
        progress.check()?;
        let last = Patch::of_word(&words[words.len() - 1]);
        worst.par_iter_mut().zip(patches).for_each(|(d, p)| *d = d.min(p.distance(&last)));
        let far = worst.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
        let Some((k, _)) = far.filter(|(_, d)| **d > 0.0) else { break };
        words.push(rounded(patches[k].set.map(|s| s > 0.0), patches[k].heights));
    }
    Ok(words)
}

/// The mean of the patches nearest to each word; the plane stays what it is.
fn centroids(patches: &[&Patch], words: &[Word], progress: &dyn Progress) -> Result<Vec<Word>> {
    let looks: Vec<Patch> = words.iter().map(Patch::of_word).collect();
    let nearest: Vec<usize> = patches
        .par_iter()
        .map(|p| {
            progress.check()?;
            Ok(nearest(p, &looks))
        })
        .collect::<Result<_>>()?;
    let mut sums = vec![([0.0_f32; N], [0.0_f32; N], 0.0_f32); words.len()];
    for (p, &k) in patches.iter().zip(&nearest) {
        let (heights, set, all) = &mut sums[k];
        *all += 1.0;
        for i in 0..N {
            set[i] += p.set[i];
            heights[i] += p.set[i] * p.heights[i];
        }
    }
    let mean = |(k, (heights, set, all)): (usize, &([f32; N], [f32; N], f32))| {
        if k == 0 || *all == 0.0 {
            return words[k].clone();
        }
        let heights = std::array::from_fn(|i| heights[i] / set[i].max(1.0));
        rounded(set.map(|s| 2.0 * s > *all), heights)
    };
    Ok(sums.iter().enumerate().map(mean).collect())
}

fn nearest(patch: &Patch, looks: &[Patch]) -> usize {
    let distances = looks.iter().map(|w| patch.distance(w)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k)
}

/// The `n` words nearest to a patch, the nearest first.
pub(in crate::alphabet) fn nearest_words(patch: &Patch, looks: &[Patch], n: usize) -> Vec<usize> {
    let mut all: Vec<(f32, usize)> =
        looks.iter().enumerate().map(|(k, w)| (patch.distance(w), k)).collect();
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.iter().take(n).map(|&(_, k)| k).collect()
}

fn rounded(set: [bool; N], heights: [f32; N]) -> Word {
    let most = f64::from(MAX_HEIGHT);
    let height = |i: usize| {
        let steps = (f64::from(heights[i]) * HEIGHT_STEPS).round();
        if set[i] { steps.clamp(-most, most) as i8 } else { 0 }
    };
    let mask = set.iter().enumerate().fold(0, |mask, (i, &s)| mask | u64::from(s) << i);
    Word { mask, heights: std::array::from_fn(height) }
}
