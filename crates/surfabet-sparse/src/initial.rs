//! The first dictionary: signals that the others of it explain least.
//!
//! As k-means++ (Arthur, Vassilvitskii 2007) chooses first centres: one signal after the other, each with a probability
//! in proportion to the error that those before leave of it. Signals of the real world differ in energy by orders of
//! magnitude, and a plain draw leaves out those that the objective consists of.

use pulp::Arch;
use rand::seq::index;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_base::Progress;
use surfabet_base::parallel;

use crate::codes::SIGNALS_PER_TASK;
use crate::dictionary::{Dictionary, normalize};
use crate::error::Result;
use crate::pursuit::dot;
use crate::rank_one::dot3;
use crate::signals::Signals;

/// Part of what is left of a signal that an atom must explain to be taken off it. Codes are short: without this every
/// signal would be explained by small shares of many atoms. With 0 the planted problem of `benches/peers/ksvd.py` is at
/// 126 after three iterations, with this at 98.
const LEAST_SHARE: f64 = 0.05;

/// Part of a signal's energy that is rounding.
const NOTHING_LEFT: f64 = 1e-6;

/// True when something of signal `i` is observed and not zero.
fn is_informative(signals: &Signals<'_>, i: usize) -> bool {
    let values = signals.values(i);
    match signals.weights(i) {
        None => values.iter().any(|&v| v != 0.0),
        Some(weights) => values.iter().zip(weights).any(|(&v, &w)| v * w != 0.0),
    }
}

/// At most `n_atoms` signals, scaled to norm 1; where one is not observed it takes the mean of those that are. Each is
/// drawn by the error that those before leave, and where they leave nothing from all that remain.
pub fn initial_dictionary(
    signals: &Signals<'_>,
    n_atoms: usize,
    random_state: u64,
    progress: &dyn Progress,
) -> Result<Dictionary> {
    let n = signals.n_features();
    let informative: Vec<usize> =
        (0..signals.len()).filter(|&i| is_informative(signals, i)).collect();
    let n_atoms = n_atoms.min(informative.len());
    let means = feature_means(signals);
    let mut rng = ChaCha8Rng::seed_from_u64(random_state);
    let mut rows = SignalResiduals::new(signals, &informative);
    let mut chosen = vec![false; informative.len()];
    let mut atoms = Vec::with_capacity(n_atoms * n);
    while atoms.len() < n_atoms * n {
        progress.check()?;
        let Some(row) = rows.draw(&mut rng) else { break };
        chosen[row] = true;
        let mut atom = filled(signals, informative[row], &means);
        if normalize(&mut atom) {
            rows.take_off(signals, &informative, &atom);
            atoms.extend(atom);
        }
        rows.left[row] = 0.0;
    }
    let others: Vec<usize> = (0..chosen.len()).filter(|&row| !chosen[row]).collect();
    let missing = n_atoms - atoms.len() / n;
    for other in index::sample(&mut rng, others.len(), missing.min(others.len())) {
        atoms.extend(filled(signals, informative[others[other]], &means));
    }
    Dictionary::normalized(n, atoms)
}

/// Signal `i`, with `means` where it is not observed.
fn filled(signals: &Signals<'_>, i: usize, means: &[f32]) -> Vec<f32> {
    let values = signals.values(i);
    match signals.weights(i) {
        None => values.to_vec(),
        Some(weights) => (values.iter().zip(weights).zip(means))
            .map(|((&v, &w), &mean)| if w == 0.0 { mean } else { v })
            .collect(),
    }
}

/// What the atoms chosen so far leave of the signals.
struct SignalResiduals {
    /// Signal-major.
    residuals: Vec<f32>,
    /// Weighted squared error of every signal.
    left: Vec<f64>,
    /// The error below which nothing is left.
    nothing: Vec<f64>,
}

impl SignalResiduals {
    fn new(signals: &Signals<'_>, informative: &[usize]) -> Self {
        let residuals = informative.iter().flat_map(|&i| signals.values(i)).copied().collect();
        let left: Vec<f64> = informative.iter().map(|&i| signals.energy(i)).collect();
        let nothing = left.iter().map(|e| NOTHING_LEFT * e).collect();
        Self { residuals, left, nothing }
    }

    /// A row by what is left of it; `None` where nothing is.
    fn draw(&self, rng: &mut ChaCha8Rng) -> Option<usize> {
        let total: f64 = self.left.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let mut at = rng.random_range(0.0..total);
        for (row, &left) in self.left.iter().enumerate() {
            if at < left {
                return Some(row);
            }
            at -= left;
        }
        // Rounding of the sums: the last that there is something of.
        self.left.iter().rposition(|&left| left > 0.0)
    }

    /// Takes the atom's share off every row that it explains enough of.
    fn take_off(&mut self, signals: &Signals<'_>, informative: &[usize], atom: &[f32]) {
        let n = atom.len();
        let squares: Vec<f32> = atom.iter().map(|d| d * d).collect();
        let rows = self.residuals.chunks_mut(SIGNALS_PER_TASK * n);
        let state = self.left.chunks_mut(SIGNALS_PER_TASK);
        let fixed = self.nothing.chunks(SIGNALS_PER_TASK);
        let signal = informative.chunks(SIGNALS_PER_TASK);
        let tasks = rows.zip(state).zip(fixed).zip(signal);
        parallel::for_each(tasks, |_, (((rows, left), nothing), signal)| {
            Arch::new().dispatch(|| {
                for (k, row) in rows.chunks_exact_mut(n).enumerate() {
                    if left[k] == 0.0 {
                        continue;
                    }
                    let (share, length) = match signals.weights(signal[k]) {
                        None => (dot(row, atom), 1.0),
                        Some(w) => (dot3(w, row, atom), dot(w, &squares)),
                    };
                    if share * share <= LEAST_SHARE * length * left[k] {
                        continue;
                    }
                    let x = (share / length) as f32;
                    for (r, d) in row.iter_mut().zip(atom) {
                        *r -= x * d;
                    }
                    let less = left[k] - share * share / length;
                    left[k] = if less > nothing[k] { less } else { 0.0 };
                }
            });
        });
    }
}

/// Weighted mean of every feature, 0 where it is never observed.
fn feature_means(signals: &Signals<'_>) -> Vec<f32> {
    let (mut sums, mut totals) =
        (vec![0.0f64; signals.n_features()], vec![0.0f64; signals.n_features()]);
    for i in 0..signals.len() {
        let Some(weights) = signals.weights(i) else { continue };
        for (((s, t), &v), &w) in
            sums.iter_mut().zip(&mut totals).zip(signals.values(i)).zip(weights)
        {
            *s += f64::from(v) * f64::from(w);
            *t += f64::from(w);
        }
    }
    sums.iter().zip(&totals).map(|(s, t)| if *t > 0.0 { (s / t) as f32 } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use surfabet_base::Silent;

    use super::*;
    use crate::testing::{noise, rng};

    const N: usize = 12;

    /// 300 signals of little noise, and before them one along each of the first four axes.
    fn four_among_many(seed: u64) -> Vec<f32> {
        let mut values: Vec<f32> =
            noise(&mut rng(seed), 304 * N).iter().map(|v| 1e-3 * v).collect();
        for axis in 0..4 {
            values[axis * N..][..N].fill(0.0);
            values[axis * N + axis] = -1.0 - axis as f32;
        }
        values
    }

    #[test]
    fn signals_that_the_objective_consists_of_are_always_drawn() {
        let weights: Vec<f32> = (0..304 * N).map(|v| if v % N == 9 { 0.0 } else { 2.0 }).collect();
        for seed in 0..20 {
            let values = four_among_many(seed);
            for weights in [None, Some(&weights[..])] {
                let signals = Signals::new(N, &values, weights).unwrap();
                let dictionary = initial_dictionary(&signals, 6, seed, &Silent).unwrap();
                assert_eq!(dictionary.n_atoms(), 6);
                for axis in 0..4 {
                    let most = (0..6).map(|k| dictionary.atom(k)[axis].abs()).fold(0.0, f32::max);
                    assert!(most > 0.999, "seed {seed}, axis {axis}: {most}");
                }
            }
        }
    }

    #[test]
    fn none_is_drawn_twice_and_what_is_explained_comes_last() {
        // Ten signals in each of three directions, then one of nothing.
        let mut values = vec![0.0; 31 * N];
        for i in 0..30 {
            values[i * N + i % 3] = 1.0 + i as f32;
        }
        let signals = Signals::new(N, &values, None).unwrap();
        for seed in 0..5 {
            let few = initial_dictionary(&signals, 3, seed, &Silent).unwrap();
            let mut axes: Vec<usize> =
                (0..3).map(|k| few.atom(k).iter().position(|&v| v == 1.0).unwrap()).collect();
            axes.sort_unstable();
            assert_eq!(axes, [0, 1, 2]);
            let all = initial_dictionary(&signals, 99, seed, &Silent).unwrap();
            assert_eq!(all.n_atoms(), 30);
            let along = |axis: usize| (0..30).filter(|&k| all.atom(k)[axis] == 1.0).count();
            assert_eq!([0, 1, 2].map(along), [10, 10, 10]);
        }
    }
}
