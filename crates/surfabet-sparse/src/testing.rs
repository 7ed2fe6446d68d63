//! Data for the tests of this crate.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_base::Progress;

use crate::Dictionary;

/// Asks to stop from the start.
pub struct Impatient;

impl Progress for Impatient {
    fn update(&self, _: &'static str, _: f32) {}

    fn is_cancelled(&self) -> bool {
        true
    }
}

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Numbers of mean 0 and about variance 1.
pub fn noise(rng: &mut impl Rng, len: usize) -> Vec<f32> {
    (0..len).map(|_| (0..3).map(|_| rng.random_range(-1.0f32..1.0)).sum()).collect()
}

pub fn random_dictionary(rng: &mut impl Rng, n_atoms: usize, n_features: usize) -> Dictionary {
    Dictionary::normalized(n_features, noise(rng, n_atoms * n_features)).unwrap()
}

/// Weights that are 0 with probability `missing`, else 1.
pub fn mask(rng: &mut impl Rng, len: usize, missing: f64) -> Vec<f32> {
    (0..len).map(|_| if rng.random_bool(missing) { 0.0 } else { 1.0 }).collect()
}

/// Signals of `atoms_per_signal` distinct atoms with coefficients of magnitude 1 to 2.
pub fn planted(
    rng: &mut impl Rng,
    dictionary: &Dictionary,
    n_signals: usize,
    atoms_per_signal: usize,
) -> (Vec<f32>, Vec<Vec<u32>>) {
    let n = dictionary.n_features();
    let (mut values, mut supports) = (vec![0.0; n_signals * n], Vec::new());
    for row in values.chunks_exact_mut(n) {
        let mut support: Vec<u32> =
            rand::seq::index::sample(rng, dictionary.n_atoms(), atoms_per_signal)
                .into_iter()
                .map(|a| a as u32)
                .collect();
        for &atom in &support {
            let x = rng.random_range(1.0f32..2.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            for (v, d) in row.iter_mut().zip(dictionary.atom(atom as usize)) {
                *v += x * d;
            }
        }
        support.sort_unstable();
        supports.push(support);
    }
    (values, supports)
}
