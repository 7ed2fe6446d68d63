//! Matching pursuit with and without missing values, and an iteration of K-SVD.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use faer::MatRef;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::Silent;
use surfabet_sparse::{Dictionary, KsvdOptions, OmpOptions, Signals, ksvd, leading_atom, omp};

const FEATURES: usize = 400;
const ATOMS: usize = 500;
const SIGNALS: usize = 1000;

fn noise(rng: &mut ChaCha8Rng, len: usize) -> Vec<f32> {
    (0..len).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn sparse(criterion: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let dictionary = Dictionary::normalized(FEATURES, noise(&mut rng, ATOMS * FEATURES))
        .expect("random atoms are not zero");
    let values = noise(&mut rng, SIGNALS * FEATURES);
    let mask: Vec<f32> =
        values.iter().map(|_| if rng.random_bool(0.2) { 0.0 } else { 1.0 }).collect();
    let full = Signals::new(FEATURES, &values, None).expect("finite");
    let masked = Signals::new(FEATURES, &values, Some(&mask)).expect("finite");
    let options = OmpOptions::default();

    let mut group = criterion.benchmark_group("sparse");
    group.sample_size(10).throughput(Throughput::Elements(SIGNALS as u64));
    for (name, signals) in [("full", &full), ("masked", &masked)] {
        group.bench_function(format!("omp/{name}"), |b| {
            b.iter(|| omp(&dictionary, signals, &options, &Silent));
        });
        let options =
            KsvdOptions { n_atoms: 100, iterations: 1, convergence: 0.0, ..KsvdOptions::default() };
        group.bench_function(format!("ksvd/{name}"), |b| {
            b.iter(|| ksvd(signals, &options, &Silent, &mut |_| {}));
        });
    }
    group.finish();
}

/// The leading direction of the residuals that an atom is updated from: the Lanczos start of the update, and faer's thin
/// singular value decomposition.
fn leading(criterion: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let atom = noise(&mut rng, FEATURES);
    for signals in [30, 100, 1000] {
        let mut rows = noise(&mut rng, signals * FEATURES);
        for row in rows.chunks_mut(FEATURES) {
            let share = rng.random_range(-1.0..1.0);
            for (value, a) in row.iter_mut().zip(&atom) {
                // A fifth is missing; where a value is known, it is the atom with as much noise.
                let known = !rng.random_bool(0.2);
                *value = if known { *value + share * a } else { 0.0 };
            }
        }
        let mut start = noise(&mut rng, FEATURES);
        start.iter_mut().zip(&atom).for_each(|(s, a)| *s += a);
        let norm = start.iter().map(|s| s * s).sum::<f32>().sqrt();
        start.iter_mut().for_each(|s| *s /= norm);
        let decompose = || {
            let rows = MatRef::from_row_major_slice(&rows, signals, FEATURES);
            let svd = rows.thin_svd().expect("the residuals are finite");
            svd.V().col(0).iter().copied().collect::<Vec<f32>>()
        };
        let lanczos = || leading_atom(&rows, &start, &Silent).expect("nobody stops it");
        let explained = |atom: &[f32]| -> f64 {
            let along = |row: &[f32]| row.iter().zip(atom).map(|(r, a)| f64::from(r * a)).sum();
            rows.chunks(FEATURES).map(along).map(|p: f64| p * p).sum()
        };
        let share = explained(&lanczos()) / explained(&decompose());
        eprintln!("{signals} signals: the Lanczos start explains {share:.6} of what is possible");

        let mut group = criterion.benchmark_group(format!("leading atom of {signals}"));
        group.sample_size(10);
        group.bench_function("lanczos", |b| b.iter(lanczos));
        group.bench_function("faer thin_svd", |b| b.iter(decompose));
        group.finish();
    }
}

criterion_group!(benches, sparse, leading);
criterion_main!(benches);
