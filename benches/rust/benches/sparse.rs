//! Matching pursuit with and without missing values, and an iteration of K-SVD.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::Silent;
use surfabet_sparse::{Dictionary, KsvdOptions, OmpOptions, Signals, ksvd, omp};

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

criterion_group!(benches, sparse);
criterion_main!(benches);
