//! Neighbours, normals, voxel grid and metrics on a million points of a noisy, generated room.
#![allow(missing_docs)]

use std::num::NonZero;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kiddo::batch::Executor;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::{
    EvaluateOptions, KdTree, Moments, Neighborhood, PointCloud, Silent, VoxelGrid,
    estimate_normals, evaluate,
};

const POINTS: usize = 1_000_000;

/// The walls, floor and ceiling of a 5 x 4 x 2.5 m room with noise of a centimetre, face by face.
fn room(points: usize, seed: u64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let size = [5.0_f32, 4.0, 2.5];
    let positions = (0..points)
        .map(|i| {
            let face = i * 6 / points;
            let mut p: [f32; 3] = std::array::from_fn(|a| rng.random_range(0.0..size[a]));
            p[face / 2] = if face.is_multiple_of(2) { 0.0 } else { size[face / 2] };
            p[face / 2] += rng.random_range(-0.01_f32..0.01);
            p
        })
        .collect();
    PointCloud::from_positions(positions).0
}

fn neighbours(c: &mut Criterion) {
    let cloud = room(POINTS, 1);
    let points = cloud.positions();
    let tree = KdTree::new(points).expect("the points are finite");
    let mut group = c.benchmark_group("kdtree");
    group.sample_size(10).throughput(Throughput::Elements(POINTS as u64));
    group.bench_function("build", |b| b.iter(|| KdTree::new(points)));
    group.bench_function("nearest", |b| b.iter(|| tree.nearest_batch(points, &Silent)));
    group.bench_function("16 nearest", |b| b.iter(|| tree.k_nearest_batch(points, 16, &Silent)));
    group.bench_function("within 1 cm", |b| b.iter(|| tree.within_batch(points, 0.01, &Silent)));
    group.finish();
}

/// The same searches by kiddo.
fn kiddo(c: &mut Criterion) {
    let cloud = room(POINTS, 1);
    let points = cloud.positions();
    let build = || ImmutableKdTree::<f32, 3>::new_from_slice_parallel(points);
    let tree = build().expect("the points are finite and distinct enough");
    let executor = Executor::parallel();
    let queries = || tree.query_batch(points).with_executor(&executor);
    let mut group = c.benchmark_group("kiddo");
    group.sample_size(10).throughput(Throughput::Elements(POINTS as u64));
    group.bench_function("build", |b| b.iter(build));
    group.bench_function("nearest", |b| {
        b.iter(|| queries().nearest_one::<SquaredEuclidean<f32>>().execute());
    });
    group.bench_function("16 nearest", |b| {
        let n = NonZero::new(16).expect("16 is not zero");
        b.iter(|| queries().nearest_n::<SquaredEuclidean<f32>>(n).execute());
    });
    group.bench_function("within 1 cm", |b| {
        b.iter(|| queries().within::<SquaredEuclidean<f32>>(1e-4).execute());
    });
    group.finish();
}

fn surfaces(c: &mut Criterion) {
    let cloud = room(POINTS, 1);
    let mut group = c.benchmark_group("surfaces");
    group.sample_size(10).throughput(Throughput::Elements(POINTS as u64));
    group.bench_function("normals, 16 neighbours", |b| {
        b.iter(|| estimate_normals(&cloud, Neighborhood::Nearest(16), &Silent));
    });
    group.bench_function("voxel means, 2 cm", |b| {
        b.iter(|| VoxelGrid::new(&cloud, 0.02, &Silent)?.means(&cloud, None, &Silent));
    });
    group.bench_function("moments", |b| {
        b.iter(|| {
            let mut moments = Moments::new();
            for p in cloud.positions() {
                moments.add(p.map(f64::from), 1.0);
            }
            moments
        });
    });
    group.finish();
}

fn metrics(c: &mut Criterion) {
    let (reference, decoded) = (room(POINTS, 1), room(POINTS / 4, 2));
    let options = EvaluateOptions::default();
    let mut group = c.benchmark_group("metrics");
    group.sample_size(10).throughput(Throughput::Elements((POINTS + POINTS / 4) as u64));
    group.bench_function("evaluate", |b| {
        b.iter(|| evaluate(&reference, &decoded, &options, &Silent));
    });
    group.finish();
}

criterion_group!(benches, neighbours, kiddo, surfaces, metrics);
criterion_main!(benches);
