//! Speed of the codec's primitives: `cargo bench -p surfabet-benches --bench codec`.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_codec::models::{Bit, SInt, Symbols, UInt};
use surfabet_codec::{Container, ContainerWriter, Decoder, Encoder, Family, Features, Limits, Tag};
use surfabet_geom::octahedral;

const BENCH: Tag = Tag::new(b"BNCH");
const COUNT: usize = 1 << 18;

/// Bits that are true with the given probability.
fn bernoulli(probability: f64) -> Vec<bool> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    (0..COUNT).map(|_| random.random_bool(probability)).collect()
}

/// Integers of the two-sided geometric distribution with the given mean magnitude.
fn laplacian(mean: f64) -> Vec<i32> {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let magnitude = |uniform: f64| (-(1.0 - uniform).ln() * mean) as i32;
    (0..COUNT)
        .map(|_| magnitude(random.random()) * if random.random_bool(0.5) { 1 } else { -1 })
        .collect()
}

/// Encodes and decodes `values` with a fresh model each time.
fn round_trip<T, M>(
    criterion: &mut Criterion,
    name: &str,
    parameter: f64,
    values: &[T],
    model: &M,
    encode: impl Fn(&mut Encoder, &mut M, &T),
    decode: impl Fn(&mut Decoder<'_>, &mut M) -> T,
) where
    T: PartialEq,
    M: Clone,
{
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(values.len() as u64));
    let encode_all = || {
        let (mut encoder, mut model) = (Encoder::new(), model.clone());
        for value in values {
            encode(&mut encoder, &mut model, value);
        }
        encoder.finish()
    };
    let bytes = encode_all();
    group.bench_function(BenchmarkId::new("encode", parameter), |b| b.iter(encode_all));
    group.bench_function(BenchmarkId::new("decode", parameter), |b| {
        b.iter(|| {
            let (mut decoder, mut model) = (Decoder::new(BENCH, black_box(&bytes)), model.clone());
            values.iter().all(|value| decode(&mut decoder, &mut model) == *value)
        });
    });
    group.finish();
}

fn entropy(criterion: &mut Criterion) {
    for probability in [0.5, 0.1, 0.01] {
        round_trip(
            criterion,
            "bit",
            probability,
            &bernoulli(probability),
            &Bit::new(),
            |encoder, model, value| encoder.bit(model, *value),
            |decoder, model| decoder.bit(model).expect("own stream"),
        );
    }
    for mean in [0.5, 4.0, 64.0] {
        round_trip(
            criterion,
            "sint",
            mean,
            &laplacian(mean),
            &SInt::new(),
            |encoder, model, value| encoder.sint(model, *value),
            |decoder, model| decoder.sint(model).expect("own stream"),
        );
        let unsigned: Vec<u32> = laplacian(mean).into_iter().map(i32::unsigned_abs).collect();
        round_trip(
            criterion,
            "uint",
            mean,
            &unsigned,
            &UInt::new(),
            |encoder, model, value| encoder.uint(model, *value),
            |decoder, model| decoder.uint(model).expect("own stream"),
        );
    }
    for size in [16, 500] {
        let symbols: Vec<u32> =
            laplacian(64.0).into_iter().map(|value| value.unsigned_abs() % size).collect();
        round_trip(
            criterion,
            "symbol",
            f64::from(size),
            &symbols,
            &Symbols::new(size).expect("a size in range"),
            |encoder, model, value| encoder.symbol(model, *value),
            |decoder, model| decoder.symbol(model).expect("own stream"),
        );
    }
    let raw: Vec<u64> = laplacian(64.0).into_iter().map(|value| value as u64 & 0xff).collect();
    round_trip(
        criterion,
        "bypass",
        8.0,
        &raw,
        &(),
        |encoder, (), value| encoder.bypass(*value, 8),
        |decoder, ()| decoder.bypass(8).expect("own stream"),
    );
}

fn unit_vectors(criterion: &mut Criterion) {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let vectors: Vec<[f32; 3]> =
        (0..COUNT).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let codes: Vec<[i32; 2]> = vectors.iter().map(|v| octahedral::encode(*v, 10)).collect();
    let mut group = criterion.benchmark_group("octahedral");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function("encode", |b| {
        b.iter(|| {
            vectors.iter().fold(0_i32, |sum, v| sum.wrapping_add(octahedral::encode(*v, 10)[0]))
        });
    });
    group.bench_function("decode", |b| {
        b.iter(|| codes.iter().fold(0.0_f32, |sum, code| sum + octahedral::decode(*code, 10)[0]));
    });
    group.finish();
}

fn container(criterion: &mut Criterion) {
    let section = vec![0x5a; 1 << 20];
    let file = ContainerWriter::new(Family::Patches, Features::NONE)
        .section(BENCH, section)
        .finish()
        .expect("one section");
    let mut group = criterion.benchmark_group("container");
    group.throughput(Throughput::Bytes(file.len() as u64));
    group.bench_function("parse", |b| {
        b.iter(|| Container::parse(black_box(&file), &Limits::default()).map(|c| c.overhead()));
    });
    group.finish();
}

criterion_group!(benches, entropy, unit_vectors, container);
criterion_main!(benches);
