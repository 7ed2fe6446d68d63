//! The box tree beside parry's hierarchy, as planes and the BIC alphabet use it, on a generated room.
//!
//! Both trees are built over the same boxes. Planes ask which boxes of 64 points a slab meets; the likelihood of the BIC
//! alphabet asks which boxes of 8 points, each wider by its reach, a sphere meets.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use parry3d::bounding_volume;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet_geom::{Aabb, BoxTree, arrange, boxes_of};

const POINTS: usize = 400_000;
const QUERIES: usize = 2_000;

/// Points per box for planes, and for the likelihood.
const LEAVES: [usize; 2] = [64, 8];

/// Radius of a sphere and of a slab, metres.
const RADIUS: f32 = 0.1;
const REACH: f64 = 0.02;

/// The walls, floor and ceiling of a room with noise of a centimetre, in the order of the tree.
fn room(leaf: usize) -> Vec<[f32; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let size = [5.0_f32, 4.0, 2.5];
    let positions: Vec<[f32; 3]> = (0..POINTS)
        .map(|i| {
            let face = i % 6;
            let mut p: [f32; 3] = std::array::from_fn(|a| rng.random_range(0.0..size[a]));
            p[face / 2] = if face.is_multiple_of(2) { 0.0 } else { size[face / 2] };
            p[face / 2] += rng.random_range(-0.01_f32..0.01);
            p
        })
        .collect();
    let mut order: Vec<u32> = (0..POINTS as u32).collect();
    arrange(&mut order, &positions, leaf);
    order.into_iter().map(|i| positions[i as usize]).collect()
}

fn parry(boxes: &[Aabb]) -> Bvh {
    let corner = |[x, y, z]: [f32; 3]| Vector::new(x, y, z);
    let leaves: Vec<bounding_volume::Aabb> =
        boxes.iter().map(|b| bounding_volume::Aabb::new(corner(b.low), corner(b.high))).collect();
    Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves)
}

fn of_node(node: &BvhNode) -> Aabb {
    let (low, high) = (node.mins(), node.maxs());
    Aabb { low: [low.x, low.y, low.z], high: [high.x, high.y, high.z] }
}

/// Does a slab about the plane through `center` with this normal meet the box?
fn meets_slab(b: &Aabb, center: [f64; 3], normal: [f64; 3]) -> bool {
    let (middle, half) = b.middle();
    let height: f64 = (0..3).map(|a| (middle[a] - center[a]) * normal[a]).sum();
    let extent: f64 = (0..3).map(|a| half[a] * normal[a].abs()).sum();
    height.abs() <= REACH + extent
}

fn meets_sphere(b: &Aabb, center: [f32; 3]) -> bool {
    b.squared_distance(center) <= RADIUS * RADIUS
}

fn box_tree(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for leaf in LEAVES {
        let points = room(leaf);
        let boxes = boxes_of(&points, leaf);
        let centers: Vec<[f32; 3]> =
            (0..QUERIES).map(|_| points[rng.random_range(0..POINTS)]).collect();
        let normals: Vec<[f64; 3]> = (0..QUERIES)
            .map(|_| {
                let n: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                let length = n.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
                n.map(|c| c / length)
            })
            .collect();
        let (ours, theirs) = (BoxTree::new(boxes.clone()), parry(&boxes));

        let mut group = c.benchmark_group(format!("boxes of {leaf} points"));
        group.sample_size(10);
        group.throughput(Throughput::Elements(boxes.len() as u64));
        group.bench_function("build/surfabet", |b| b.iter(|| BoxTree::new(boxes.clone())));
        group.bench_function("build/parry", |b| b.iter(|| parry(&boxes)));
        group.throughput(Throughput::Elements(QUERIES as u64));
        let mut found: Vec<u32> = Vec::new();
        group.bench_function("sphere/surfabet", |b| {
            b.iter(|| {
                found.clear();
                centers.iter().for_each(|&q| ours.leaves_where(|b| meets_sphere(b, q), &mut found));
                found.len()
            });
        });
        let n_found = found.len();
        group.bench_function("sphere/parry", |b| {
            b.iter(|| {
                found.clear();
                for &q in &centers {
                    found.extend(theirs.leaves(|n| meets_sphere(&of_node(n), q)));
                }
                found.len()
            });
        });
        assert!(found.is_empty() || n_found == 0 || found.len() == n_found);
        let slabs = || centers.iter().zip(&normals).take(QUERIES / 20);
        group.throughput(Throughput::Elements(QUERIES as u64 / 20));
        group.bench_function("slab/surfabet", |b| {
            b.iter(|| {
                found.clear();
                for (&q, &n) in slabs() {
                    ours.leaves_where(|b| meets_slab(b, q.map(f64::from), n), &mut found);
                }
                found.len()
            });
        });
        group.bench_function("slab/parry", |b| {
            b.iter(|| {
                found.clear();
                for (&q, &n) in slabs() {
                    found.extend(theirs.leaves(|b| meets_slab(&of_node(b), q.map(f64::from), n)));
                }
                found.len()
            });
        });
        group.finish();
    }
}

criterion_group!(benches, box_tree);
criterion_main!(benches);
