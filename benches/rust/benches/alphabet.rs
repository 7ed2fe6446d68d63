//! Alphabets, stage by stage as the models' own reports time them:
//! `cargo bench -p surfabet-benches --bench alphabet`.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use surfabet_benches::{bench_part, bench_stages, seconds};
use surfabet_codec::{Container, Limits, read, write};
use surfabet_geom::{PointCloud, Silent};
use surfabet_models::DecodeOptions;
use surfabet_models::alphabet::{AlphabetModel, AlphabetOptions};
use surfabet_models::bic_alphabet::{BicAlphabetModel, BicAlphabetOptions, learn};
use surfabet_sim::{LidarOptions, RoomOptions, Scene, scan_lidar};

/// One laser scan of a furnished room.
fn scan() -> PointCloud {
    let room = Scene::room(&RoomOptions::default()).expect("the default room stands");
    let poses = room.default_poses(1).expect("one pose");
    let options = LidarOptions::default();
    let mut scans = scan_lidar(&room, &poses, &options, &Silent).expect("a scan per pose");
    scans.swap_remove(0).cloud
}

fn bic_alphabet(criterion: &mut Criterion) {
    let cloud = scan();
    let options = BicAlphabetOptions { iterations: 100, ..BicAlphabetOptions::default() };
    let model = learn(&cloud, &options, &Silent).expect("a cloud with points");
    let alphabet = model.alphabet().clone();
    let bytes = write(&model).expect("a model of our own");
    let limits = Limits::default();

    let mut group = criterion.benchmark_group("bic_alphabet");
    group.sample_size(10).throughput(Throughput::Elements(cloud.len() as u64));
    let stages =
        ["extracting features", "describing features", "matching words", "removing occurrences"];
    bench_stages(&mut group, &stages, || {
        let described = alphabet.describe(black_box(&cloud), &options, &Silent);
        described.expect("a cloud with points").report().stages.clone()
    });
    bench_part(&mut group, "BIC step", || {
        let learned = learn(black_box(&cloud), &options, &Silent).expect("a cloud with points");
        let steps = learned.report().iterations.max(1) as f64;
        seconds(&learned.report().stages, "choosing words") / steps
    });
    group.bench_function("decode", |b| {
        b.iter(|| black_box(&model).decode(DecodeOptions::default(), &Silent));
    });
    group.bench_function("write", |b| b.iter(|| write(black_box(&model))));
    group.bench_function("read", |b| {
        b.iter(|| {
            let container = Container::parse(black_box(&bytes), &limits)?;
            read::<BicAlphabetModel>(&container, &limits, None)
        });
    });
    group.finish();
}

/// By description length, stage by stage, and both ways through a file.
fn alphabet(criterion: &mut Criterion) {
    let cloud = scan();
    let options = AlphabetOptions::default();
    let learn = || {
        surfabet_models::alphabet::learn(black_box(&cloud), &options, &Silent)
            .expect("a cloud with points")
    };
    let model = learn();
    let bytes = write(&model).expect("a model of our own");
    let limits = Limits::default();

    let mut group = criterion.benchmark_group("alphabet");
    group.sample_size(10).throughput(Throughput::Elements(cloud.len() as u64));
    let stages = ["finding planes", "clustering words", "placing words", "choosing occurrences"];
    bench_stages(&mut group, &stages, || learn().report().stages.clone());
    group.bench_function("decode", |b| {
        b.iter(|| black_box(&model).decode(DecodeOptions::default(), &Silent));
    });
    group.bench_function("write", |b| b.iter(|| write(black_box(&model))));
    group.bench_function("read", |b| {
        b.iter(|| {
            let container = Container::parse(black_box(&bytes), &limits)?;
            read::<AlphabetModel>(&container, &limits, None)
        });
    });
    group.finish();
}

criterion_group!(benches, bic_alphabet, alphabet);
criterion_main!(benches);
