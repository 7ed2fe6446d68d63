//! Candidate words: centroids of clustered descriptors.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::descriptor::{Descriptor, N_PIXELS};
use crate::alphabet::constants::{CLUSTERING_ROUNDS, MAX_CLUSTERED};
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, Word};
use crate::error::Result;

/// Clusters `descriptors` around at most `n` words beside the plane, which comes first: farthest-first centres, then
/// Lloyd's iteration with rounded centroids.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(in crate::alphabet) fn cluster_words(
    descriptors: &[&Descriptor],
    n: usize,
    progress: &dyn Progress,
) -> Result<Vec<Word>> {
    let step = descriptors.len().div_ceil(MAX_CLUSTERED).max(1);
    let descriptors: Vec<&Descriptor> = descriptors.iter().copied().step_by(step).collect();
    let mut words = farthest_first(&descriptors, n, progress)?;
    for _ in 0..CLUSTERING_ROUNDS {
        let next = centroids(&descriptors, &words, progress)?;
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

/// The plane, and again and again the descriptor farthest from all words so far.
fn farthest_first(
    descriptors: &[&Descriptor],
    n: usize,
    progress: &dyn Progress,
) -> Result<Vec<Word>> {
    let mut words = vec![Word::plane()];
    let mut worst = vec![f32::INFINITY; descriptors.len()];
    while words.len() <= n {
        progress.check()?;
        let last = Descriptor::of_word(&words[words.len() - 1]);
        parallel::for_each_mut(&mut worst, |k, d| *d = d.min(descriptors[k].distance(&last)));
        let far = worst.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
        let Some((k, _)) = far.filter(|(_, d)| **d > 0.0) else { break };
        words.push(rounded(descriptors[k].set.map(|s| s > 0.0), descriptors[k].heights));
    }
    Ok(words)
}

/// The mean of the descriptors nearest to each word; the plane stays. A pixel is set where more than half of them have
/// a surface, at their mean height.
fn centroids(
    descriptors: &[&Descriptor],
    words: &[Word],
    progress: &dyn Progress,
) -> Result<Vec<Word>> {
    let of_words: Vec<Descriptor> = words.iter().map(Descriptor::of_word).collect();
    let nearest: Vec<usize> = parallel::try_map(descriptors, |p| -> Result<usize> {
        progress.check()?;
        Ok(nearest(p, &of_words))
    })?;
    let mut sums = vec![([0.0_f32; N_PIXELS], [0.0_f32; N_PIXELS], 0.0_f32); words.len()];
    for (p, &k) in descriptors.iter().zip(&nearest) {
        let (heights, set, all) = &mut sums[k];
        *all += 1.0;
        for i in 0..N_PIXELS {
            set[i] += p.set[i];
            heights[i] += p.set[i] * p.heights[i];
        }
    }
    let mean = |(k, (heights, set, all)): (usize, &([f32; N_PIXELS], [f32; N_PIXELS], f32))| {
        if k == 0 || *all == 0.0 {
            return words[k].clone();
        }
        let heights = std::array::from_fn(|i| heights[i] / set[i].max(1.0));
        rounded(set.map(|s| 2.0 * s > *all), heights)
    };
    Ok(sums.iter().enumerate().map(mean).collect())
}

/// The word nearest to a descriptor, the first of equally near ones.
fn nearest(descriptor: &Descriptor, words: &[Descriptor]) -> usize {
    let distances = words.iter().map(|w| descriptor.distance(w)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k)
}

/// The `n` words nearest to a descriptor, the nearest first.
pub(in crate::alphabet) fn nearest_words(
    descriptor: &Descriptor,
    words: &[Descriptor],
    n: usize,
) -> Vec<usize> {
    let mut all: Vec<(f32, usize)> =
        words.iter().enumerate().map(|(k, w)| (descriptor.distance(w), k)).collect();
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.iter().take(n).map(|&(_, k)| k).collect()
}

/// The word with these pixels, heights over the radius rounded.
fn rounded(set: [bool; N_PIXELS], heights: [f32; N_PIXELS]) -> Word {
    let most = f64::from(MAX_HEIGHT);
    let height = |i: usize| {
        let steps = (f64::from(heights[i]) * HEIGHT_STEPS).round();
        if set[i] { steps.clamp(-most, most) as i8 } else { 0 }
    };
    let mask = set.iter().enumerate().fold(0, |mask, (i, &s)| mask | u64::from(s) << i);
    Word { mask, heights: std::array::from_fn(height) }
}
