//! Growing neural gas: winner search, adaptation, insertion: `cargo bench -p surfabet-benches --bench gas`.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_models::gas::{BruteForce, GasOptions, Index, Network, Rates, Winners};

/// Points of six faces of a box of 5 x 4 x 2.5 m.
fn signals(n: usize) -> Vec<[f32; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let size = [5.0_f32, 4.0, 2.5];
    (0..n)
        .map(|i| {
            let mut p: [f32; 3] = std::array::from_fn(|a| rng.random_range(0.0..size[a]));
            p[i % 3] = if i % 6 < 3 { 0.0 } else { size[i % 3] };
            p
        })
        .collect()
}

/// A network of `n` neurons over the box, grown with 20 signals for each.
fn network<W: Winners>(winners: W, n: usize, signals: &[[f32; 3]]) -> Network<W> {
    let rates = Rates::from(&GasOptions { n_neurons: Some(n), ..GasOptions::default() });
    let mut network = Network::new(winners, rates, &signals[..2]);
    let mut next = signals.iter().cycle();
    while network.len() < n {
        for signal in next.by_ref().take(20) {
            network.present(*signal);
            network.decay();
        }
        network.insert();
    }
    network
}

fn winner_search(criterion: &mut Criterion) {
    let signals = signals(1 << 16);
    let mut group = criterion.benchmark_group("gas: winner and second winner");
    for n in [1000, 5000, 20_000, 50_000] {
        let positions = network(Index::new(), n, &signals).graph().positions;
        let (mut index, mut brute) = (Index::new(), BruteForce::default());
        for (id, &p) in positions.iter().enumerate() {
            index.insert(id as u32, p);
            brute.insert(id as u32, p);
        }
        let mut at = 0;
        let mut next = || {
            at = (at + 1) % signals.len();
            signals[at]
        };
        group.bench_function(BenchmarkId::new("indexed", n), |b| {
            b.iter(|| index.two_nearest(black_box(next())));
        });
        group.bench_function(BenchmarkId::new("brute force", n), |b| {
            b.iter(|| brute.two_nearest(black_box(next())));
        });
    }
    group.finish();
}

/// Steps 3 to 8 and 10: the search and all that it leads to.
fn adaptation(criterion: &mut Criterion) {
    let signals = signals(1 << 16);
    let mut group = criterion.benchmark_group("gas: a signal");
    for n in [1000, 20_000] {
        let mut network = network(Index::new(), n, &signals);
        let mut at = 0;
        group.bench_function(BenchmarkId::new("adaptation", n), |b| {
            b.iter(|| {
                at = (at + 1) % signals.len();
                network.decay();
                network.present(black_box(signals[at]))
            });
        });
    }
    group.finish();
}

/// Step 9, a thousand times.
fn insertion(criterion: &mut Criterion) {
    let signals = signals(1 << 16);
    let start = network(Index::new(), 20_000, &signals);
    criterion.bench_function("gas: a thousand insertions into 20000", |b| {
        b.iter_batched(
            || start.clone(),
            |mut network| {
                (0..1000).for_each(|_| network.insert());
                network
            },
            BatchSize::LargeInput,
        );
    });
}

criterion_group!(benches, winner_search, adaptation, insertion);
criterion_main!(benches);
