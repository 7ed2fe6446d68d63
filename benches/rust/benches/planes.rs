//! Planes: the steps of a fit, learning, the file, decoding: `cargo bench -p surfabet-benches --bench planes`.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_codec::{Container, Limits, read, write};
use surfabet_geom::{PointCloud, Silent};
use surfabet_models::DecodeOptions;
use surfabet_models::planes::{Fit, PlaneModel, PlanesOptions, Points, learn};

const POINTS: usize = 200_000;

/// Walls and floors of 4 x 4 rooms of 5 x 4 x 2.5 m with 5 mm of noise.
fn rooms(n: usize) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let size = [5.0_f32, 4.0, 2.5];
    let positions = (0..n)
        .map(|i| {
            let mut p: [f32; 3] = std::array::from_fn(|a| rng.random_range(0.0..size[a]));
            let noise: f32 = (0..12).map(|_| rng.random_range(-0.005_f32..0.005)).sum();
            p[i % 3] = if i % 6 < 3 { 0.0 } else { size[i % 3] } + 0.5 * noise;
            // Rooms stand apart by 0.3 m, so that their walls have two sides.
            p[0] += (size[0] + 0.3) * rng.random_range(0..4_u8) as f32;
            p[1] += (size[1] + 0.3) * rng.random_range(0..4_u8) as f32;
            p
        })
        .collect();
    PointCloud::from_positions(positions).0
}

/// The steps of an iteration, each from a state in which it has something to do.
fn steps(criterion: &mut Criterion) {
    let options = PlanesOptions { initial_patches: 30, ..PlanesOptions::default() };
    let points = Points::new(&rooms(POINTS), None).unwrap();
    let mut fit = Fit::new(&points, &options, &Silent).unwrap();
    for _ in 0..3 {
        fit.iterate(&Silent).unwrap();
    }
    let responsibilities = fit.e_step(&Silent).unwrap();
    let planes = fit.m_step(&responsibilities);
    let mut group = criterion.benchmark_group("planes: a step, 200000 points");
    group.sample_size(20);
    group.bench_function("E-step", |b| b.iter(|| fit.e_step(&Silent).unwrap()));
    group.bench_function("M-step", |b| b.iter(|| fit.m_step(black_box(&responsibilities))));
    group.bench_function("trimming", |b| {
        b.iter_batched(
            || (fit.clone(), planes.clone()),
            |(mut fit, planes)| {
                fit.trim(&planes, &responsibilities);
                fit
            },
            BatchSize::LargeInput,
        );
    });
    group.bench_function("split", |b| {
        b.iter_batched(
            || fit.clone(),
            |mut fit| {
                fit.split(&Silent).unwrap();
                fit
            },
            BatchSize::LargeInput,
        );
    });
    let mut split = fit.clone();
    split.split(&Silent).unwrap();
    group.bench_function("merge", |b| {
        b.iter_batched(
            || split.clone(),
            |mut fit| {
                fit.merge(&Silent).unwrap();
                fit
            },
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

fn whole(criterion: &mut Criterion) {
    let cloud = rooms(POINTS);
    let options = PlanesOptions::default();
    let model = learn(&cloud, None, &options, &Silent).unwrap();
    let file = write(&model).unwrap();
    let limits = Limits::default();
    let decode = DecodeOptions { resolution: Some(0.02), ..DecodeOptions::default() };
    let mut group = criterion.benchmark_group("planes: 200000 points");
    group.sample_size(10);
    group.bench_function("learn", |b| {
        b.iter(|| learn(black_box(&cloud), None, &options, &Silent).unwrap());
    });
    group.bench_function("segment", |b| b.iter(|| model.segment(&cloud, &Silent).unwrap()));
    group.bench_function("write", |b| b.iter(|| write(black_box(&model)).unwrap()));
    group.bench_function("read", |b| {
        b.iter(|| {
            let container = Container::parse(black_box(&file), &limits).unwrap();
            read::<PlaneModel>(&container, &limits, None).unwrap()
        });
    });
    group.bench_function("decode at 20 mm", |b| b.iter(|| model.decode(decode, &Silent).unwrap()));
    group.bench_function("mesh", |b| b.iter(|| model.mesh()));
    group.finish();
}

criterion_group!(benches, steps, whole);
criterion_main!(benches);
