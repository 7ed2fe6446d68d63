//! The first dictionary: signals.

use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use crate::dictionary::Dictionary;
use crate::error::Result;
use crate::signals::Signals;

/// True when something of signal `i` is observed and not zero.
fn is_informative(signals: &Signals<'_>, i: usize) -> bool {
    let values = signals.values(i);
    match signals.weights(i) {
        None => values.iter().any(|&v| v != 0.0),
        Some(weights) => values.iter().zip(weights).any(|(&v, &w)| v * w != 0.0),
    }
}

/// At most `n_atoms` signals, chosen at random without repetition and scaled to norm 1; where one is not
/// observed it takes the mean of those that are.
pub fn initial_dictionary(
    signals: &Signals<'_>,
    n_atoms: usize,
    random_state: u64,
) -> Result<Dictionary> {
    let n = signals.n_features();
    let informative: Vec<usize> =
        (0..signals.len()).filter(|&i| is_informative(signals, i)).collect();
    let means = feature_means(signals);
    let n_atoms = n_atoms.min(informative.len());
    let mut rng = ChaCha8Rng::seed_from_u64(random_state);
    let mut atoms = Vec::with_capacity(n_atoms * n);
    for chosen in index::sample(&mut rng, informative.len(), n_atoms) {
        let i = informative[chosen];
        let start = atoms.len();
        atoms.extend_from_slice(signals.values(i));
        if let Some(weights) = signals.weights(i) {
            for ((a, &w), &mean) in atoms[start..].iter_mut().zip(weights).zip(&means) {
                if w == 0.0 {
                    *a = mean;
                }
            }
        }
    }
    Dictionary::normalized(n, atoms)
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
