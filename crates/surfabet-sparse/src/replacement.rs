//! Atoms from data: the first dictionary, and what takes the place of atoms that do not earn theirs.

use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use surfabet_base::Progress;

use crate::codes::{SparseCodes, add_code};
use crate::dictionary::{Dictionary, normalize};
use crate::error::Result;
use crate::omp::gram;
use crate::pursuit::dot;
use crate::signals::Signals;

/// Share of a signal's energy that may be missing from its code for it to count as represented.
const REPRESENTED: f64 = 1e-9;

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

/// Which atoms repeat another: of two whose absolute cosine exceeds `max_coherence` the one used less, of
/// equals the later.
pub fn duplicates(
    dictionary: &Dictionary,
    usage: &[usize],
    max_coherence: f32,
    progress: &dyn Progress,
) -> Result<Vec<bool>> {
    let (k, n) = (dictionary.n_atoms(), dictionary.n_features());
    let mut by_feature = vec![0.0; k * n];
    for a in 0..k {
        for (f, &v) in dictionary.atom(a).iter().enumerate() {
            by_feature[f * k + a] = v;
        }
    }
    let gram = gram(dictionary, &by_feature, progress)?;
    let mut by_usage: Vec<usize> = (0..k).collect();
    by_usage.sort_by_key(|&a| (std::cmp::Reverse(usage[a]), a));
    let mut repeats = vec![false; k];
    for (rank, &a) in by_usage.iter().enumerate() {
        if repeats[a] {
            continue;
        }
        for &b in &by_usage[rank + 1..] {
            if gram[a * k + b].abs() > max_coherence {
                repeats[b] = true;
            }
        }
    }
    Ok(repeats)
}

/// Puts the residuals of the signals with the largest `errors` in the place of the atoms marked in `replace`,
/// as far as there are such signals and their residuals are unlike each other; returns which were replaced.
pub fn replace_atoms(
    dictionary: &mut Dictionary,
    replace: &[bool],
    signals: &Signals<'_>,
    codes: &SparseCodes,
    errors: &[f64],
    max_coherence: f32,
    progress: &dyn Progress,
) -> Result<Vec<bool>> {
    let before = dictionary.clone();
    let mut replaced = vec![false; dictionary.n_atoms()];
    let mut by_error: Vec<usize> =
        (0..errors.len()).filter(|&i| errors[i] > REPRESENTED * signals.energy(i)).collect();
    by_error.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(a.cmp(&b)));
    let mut candidates = by_error.into_iter();
    let mut added: Vec<usize> = Vec::new();
    for k in (0..replace.len()).filter(|&k| replace[k]) {
        for i in candidates.by_ref() {
            progress.check()?;
            let mut atom = residual(&before, signals, codes, i);
            if !normalize(&mut atom) {
                continue;
            }
            let unlike =
                |&a: &usize| dot(dictionary.atom(a), &atom).abs() <= f64::from(max_coherence);
            if added.iter().all(unlike) {
                dictionary.atom_mut(k).copy_from_slice(&atom);
                replaced[k] = true;
                added.push(k);
                break;
            }
        }
    }
    Ok(replaced)
}

/// What the code of signal `i` leaves of it; 0 where the signal is not observed, since nothing is known there.
///
/// The residual leads to a missing atom more directly than the signal, a mixture of it with atoms that are
/// there already.
fn residual(
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    codes: &SparseCodes,
    i: usize,
) -> Vec<f32> {
    let mut residual = vec![0.0; signals.n_features()];
    let (atoms, coefficients) = codes.code(i);
    add_code(dictionary, atoms, coefficients, &mut residual);
    for (r, &v) in residual.iter_mut().zip(signals.values(i)) {
        *r = v - *r;
    }
    if let Some(weights) = signals.weights(i) {
        for (r, &w) in residual.iter_mut().zip(weights) {
            if w == 0.0 {
                *r = 0.0;
            }
        }
    }
    residual
}
