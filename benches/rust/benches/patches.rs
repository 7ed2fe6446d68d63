//! HSCSM and patches on a lattice: the road from a simulated frame to a file and back: `cargo bench -p surfabet-benches --bench patches`.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use surfabet_benches::bench_stages;
use surfabet_codec::{Container, Limits, read, write};
use surfabet_geom::{PointCloud, Silent};
use surfabet_models::DecodeOptions;
use surfabet_models::hscsm::{self, HscsmModel, HscsmOptions};
use surfabet_models::patches::{self, PatchModel, PatchesOptions};
use surfabet_sim::{Intrinsics, RgbdOptions, RoomOptions, Scene, scan_rgbd};

/// One noisy frame of a furnished room, 320 x 240 pixels.
fn frame() -> PointCloud {
    let room = Scene::room(&RoomOptions::default()).expect("the default room stands");
    let poses = room.default_poses(1).expect("one pose");
    let camera = RgbdOptions { intrinsics: Intrinsics::kinect(320, 240), ..RgbdOptions::default() };
    let mut frames = scan_rgbd(&room, &poses, &camera, &Silent).expect("a frame per pose");
    frames.swap_remove(0).scan.cloud
}

fn hscsm_road(criterion: &mut Criterion) {
    let cloud = frame();
    let options = HscsmOptions { resolution: Some(0.02), iterations: 4, ..HscsmOptions::default() };
    let model = hscsm::learn(&cloud, &options, &Silent).expect("a cloud with points");
    let bytes = write(&model).expect("a model of our own");
    let limits = Limits::default();

    let mut group = criterion.benchmark_group("hscsm");
    group.sample_size(10).throughput(Throughput::Elements(cloud.len() as u64));
    group
        .bench_function("learn", |b| b.iter(|| hscsm::learn(black_box(&cloud), &options, &Silent)));
    group.bench_function("write", |b| b.iter(|| write(black_box(&model))));
    group.bench_function("read", |b| {
        b.iter(|| {
            let container = Container::parse(black_box(&bytes), &limits)?;
            read::<HscsmModel>(&container, &limits, None)
        });
    });
    group.bench_function("decode", |b| {
        b.iter(|| black_box(&model).decode(DecodeOptions::default(), &Silent));
    });
    group.finish();
}

/// The road of the default method, and its stages as the model's own report times them.
fn patches_road(criterion: &mut Criterion) {
    let cloud = frame();
    let options = PatchesOptions { resolution: Some(0.02), ..PatchesOptions::default() };
    let model = patches::learn(&cloud, &options, &Silent).expect("a cloud with points");
    let bytes = write(&model).expect("a model of our own");
    let limits = Limits::default();

    let mut group = criterion.benchmark_group("patches");
    group.sample_size(10).throughput(Throughput::Elements(cloud.len() as u64));
    group.bench_function("learn", |b| {
        b.iter(|| patches::learn(black_box(&cloud), &options, &Silent));
    });
    let stages = [
        "finding axes",
        "merging points",
        "growing sheets",
        "choosing patches",
        "adding attributes",
    ];
    bench_stages(&mut group, &stages, || {
        let model = patches::learn(black_box(&cloud), &options, &Silent);
        model.expect("a cloud with points").report().stages.clone()
    });
    group.bench_function("write", |b| b.iter(|| write(black_box(&model))));
    group.bench_function("read", |b| {
        b.iter(|| {
            let container = Container::parse(black_box(&bytes), &limits)?;
            read::<PatchModel>(&container, &limits, None)
        });
    });
    for as_measured in [false, true] {
        let how = if as_measured { "decode as measured" } else { "decode" };
        let options = DecodeOptions { as_measured, ..DecodeOptions::default() };
        group.bench_function(how, |b| b.iter(|| black_box(&model).decode(options, &Silent)));
    }
    group.finish();
}

criterion_group!(benches, hscsm_road, patches_road);
criterion_main!(benches);
