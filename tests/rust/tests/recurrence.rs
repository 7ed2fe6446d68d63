//! What recurs in a scene is coded once: instances, on scenes of which it is known what recurs.
#![allow(missing_docs, clippy::unwrap_used)]

use std::sync::OnceLock;

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::geom::KdTree;
use surfabet::patches::{self, Motion};
use surfabet::{CloudParts, DecodeOptions, PatchModel, PatchesOptions, PointCloud, Save, Silent};
use surfabet_codec::Tag;
use surfabet_models::{Error, Region};
use surfabet_tests::contract;
use surfabet_tests::files::read;

type Point = [f32; 3];

const PIXEL: f64 = 0.01;

fn options() -> PatchesOptions {
    PatchesOptions { resolution: Some(PIXEL), recurrence: true, ..PatchesOptions::default() }
}

fn learn(cloud: &PointCloud, options: &PatchesOptions) -> PatchModel {
    patches::learn(cloud, options, &Silent).unwrap()
}

fn size(model: &PatchModel) -> usize {
    model.to_bytes().unwrap().len()
}

fn decode(model: &PatchModel, as_measured: bool) -> PointCloud {
    let options = DecodeOptions { as_measured, normals: true, ..DecodeOptions::default() };
    model.decode(options, &Silent).unwrap()
}

/// Boxes of a chest that no turn and no mirror takes to itself: lowest and highest corners, metres.
const CHEST: [[Point; 2]; 5] = [
    [[0.0, 0.0, 0.0], [0.5, 0.3, 0.2]],
    [[0.05, 0.04, 0.2], [0.2, 0.26, 0.45]],
    [[0.3, 0.1, 0.2], [0.42, 0.22, 0.32]],
    [[0.5, 0.05, 0.0], [0.64, 0.12, 0.1]],
    [[0.1, 0.3, 0.0], [0.18, 0.42, 0.27]],
];

/// Points on the sides and tops of the chest, one every 4 mm, with noise, and their colours.
fn chest(noise: f64, seed: u64) -> (Vec<Point>, Vec<[u8; 3]>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut points, mut colors) = (Vec::new(), Vec::new());
    for [low, high] in CHEST {
        for (axis, at) in [(0, low), (0, high), (1, low), (1, high), (2, high)] {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let steps = |a: usize| ((high[a] - low[a]) / 0.004) as usize;
            for i in 0..steps(u) {
                for j in 0..steps(v) {
                    let off: f64 = rng.sample(StandardNormal);
                    let mut p = [0.0; 3];
                    p[axis] = at[axis] + (noise * off) as f32;
                    p[u] = low[u] + i as f32 * 0.004;
                    p[v] = low[v] + j as f32 * 0.004;
                    colors.push(color(p));
                    points.push(p);
                }
            }
        }
    }
    (points, colors)
}

/// Stripes along all axes.
fn color(p: Point) -> [u8; 3] {
    [0, 1, 2].map(|a| 40 + 150 * ((p[a] / 0.06).floor() as i32).rem_euclid(2) as u8)
}

/// A chest at each of some places: mirrored, quarter turns, shift. Noise of 1 mm; its seed is the number of the chest, or
/// the same for all.
fn chests(places: &[(bool, u8, Point)], own_noise: bool) -> PointCloud {
    let mut parts = CloudParts::default();
    let mut all = Vec::new();
    for (i, &(mirrored, quarters, shift)) in (0..).zip(places) {
        let (points, colors) = chest(0.001, if own_noise { i } else { 0 });
        let placed = points.into_iter().map(|[x, y, z]| {
            let mut p = [if mirrored { -x } else { x }, y];
            for _ in 0..quarters {
                p = [-p[1], p[0]];
            }
            [p[0] + shift[0], p[1] + shift[1], z + shift[2]]
        });
        parts.positions.extend(placed);
        all.extend(colors);
    }
    parts.colors = Some(all);
    PointCloud::from_parts(parts).unwrap().0
}

/// Places of four chests at shifts that are no whole pixels, turned, and one of them mirrored.
const PLACES: [(bool, u8, Point); 4] = [
    (false, 0, [0.0, 0.0, 0.0]),
    (false, 0, [1.2137, 0.0551, 0.0]),
    (false, 1, [2.7333, 0.1217, 0.0]),
    (true, 2, [4.0071, 0.8049, 0.0]),
];

/// The model of four chests, learned once.
fn four() -> &'static PatchModel {
    static MODEL: OnceLock<PatchModel> = OnceLock::new();
    MODEL.get_or_init(|| learn(&chests(&PLACES, true), &options()))
}

fn rms(from: &PointCloud, to: &PointCloud) -> f64 {
    let tree = KdTree::new(to.positions()).unwrap();
    let squared = |&p: &Point| f64::from(tree.nearest(p).unwrap().squared_distance());
    (from.positions().iter().map(squared).sum::<f64>() / from.len() as f64).sqrt()
}

#[test]
fn turned_and_mirrored_copies_with_noise_of_their_own_take_few_bytes() {
    let cloud = chests(&PLACES, true);
    let one = size(&learn(&chests(&PLACES[..1], true), &options()));
    let plain = learn(&cloud, &PatchesOptions { recurrence: false, ..options() });
    let model = four();
    assert!(plain.instances().all.is_empty());
    assert!(model.instances().all.len() >= 3);
    assert!(size(model) < 5 * one / 2, "{} bytes, one takes {one}", size(model));
    assert!(size(model) < size(&plain) * 7 / 10, "{} of {}", size(model), size(&plain));
    // The copies are as near to the scan as what is coded.
    let pairs = |model: &PatchModel| {
        let decoded = decode(model, true);
        [rms(&decoded, &cloud), rms(&cloud, &decoded)]
    };
    let (with, without) = (pairs(model), pairs(&plain));
    for (with, without) in with.into_iter().zip(without) {
        assert!(with < 1.1 * without, "{with} and {without} m");
    }
}

#[test]
fn an_instance_gives_what_its_patches_decode_to_with_attributes_and_normals() {
    let model = four();
    let lattice = model.lattice();
    let rotation = lattice.orientation.rotation();
    let to_lattice = |p: [f64; 3]| -> Point {
        std::array::from_fn(|a| {
            ((0..3).map(|k| rotation[k][a] * p[k]).sum::<f64>() / lattice.pixel_size) as f32
        })
    };
    for as_measured in [false, true] {
        let cloud = decode(model, as_measured);
        let (normals, colors) = (cloud.normals().unwrap(), cloud.colors().unwrap());
        let local = |i: usize| to_lattice(cloud.positions()[i].map(f64::from));
        let places: Vec<Point> = (0..cloud.len()).map(local).collect();
        let tree = KdTree::new(&places).unwrap();
        let instances = model.instances();
        let mut found = 0;
        for instance in &instances.all {
            let motion = Motion::new(instance.place, instances.axis);
            // Every third point of a patch that is given again has a twin where the motion takes it.
            let own: Vec<usize> = (0..cloud.len()).step_by(3).collect();
            for i in own {
                let twin = tree.nearest(motion.of_position(places[i])).unwrap();
                if twin.squared_distance() < 1e-4 && colors[twin.index()] == colors[i] {
                    let normal = to_lattice(normals[i].map(f64::from));
                    let moved = motion.of_direction(normal);
                    let other = to_lattice(normals[twin.index()].map(f64::from));
                    let off: f32 = (0..3).map(|a| (moved[a] - other[a]).powi(2)).sum();
                    found += usize::from(off.sqrt() < 0.01 / lattice.pixel_size as f32);
                }
            }
        }
        let copied =
            instances.n_patches() as f64 / (instances.n_patches() as usize + model.len()) as f64;
        assert!(
            found as f64 > 0.6 * copied * cloud.len() as f64 / 3.0,
            "{found} of {}",
            cloud.len()
        );
    }
}

#[test]
fn a_part_is_the_whole_cropped() {
    let model = four();
    for as_measured in [false, true] {
        let whole = decode(model, as_measured);
        let region = Region::new([1.3, 0.0, 0.05], [2.6, 0.3, 0.25]).unwrap();
        let options = DecodeOptions { as_measured, normals: true, ..DecodeOptions::default() };
        let part = surfabet::SurfaceModel::decode_within(model, &region, options, &Silent).unwrap();
        assert!(!part.is_empty() && part.len() < whole.len());
        assert_eq!(part, region.crop(&whole).unwrap());
    }
}

#[test]
fn both_bounds_hold_with_instances() {
    let cloud = chests(&PLACES, true);
    let (bound, forward) = (0.008, 0.015);
    let options =
        PatchesOptions { max_error: Some(bound), max_error_forward: Some(forward), ..options() };
    let model = learn(&cloud, &options);
    assert!(!model.instances().all.is_empty());
    let model: PatchModel = read(&model.to_bytes().unwrap()).unwrap();
    let farthest = |from: &PointCloud, to: &PointCloud| {
        let tree = KdTree::new(to.positions()).unwrap();
        let squared = |&p: &Point| f64::from(tree.nearest(p).unwrap().squared_distance());
        from.positions().iter().map(squared).fold(0.0, f64::max).sqrt()
    };
    let measured = decode(&model, true);
    assert!(farthest(&cloud, &measured) <= bound);
    assert!(farthest(&measured, &cloud) <= forward);
    assert!(farthest(&decode(&model, false), &cloud) <= forward);
}

#[test]
fn exact_copies_take_little_more_than_one_at_no_more_error() {
    let places: [(bool, u8, Point); 6] =
        std::array::from_fn(|i| (false, 0, [1.1137 * i as f32, 0.0531 * i as f32, 0.0]));
    let one = size(&learn(&chests(&places[..1], false), &options()));
    let cloud = chests(&places, false);
    let plain = learn(&cloud, &PatchesOptions { recurrence: false, ..options() });
    let model = learn(&cloud, &options());
    assert!(10 * size(&model) < 16 * one, "{} bytes, one takes {one}", size(&model));
    let decoded = [&model, &plain].map(|model| decode(model, true));
    let [with, without] = decoded.map(|decoded| [rms(&decoded, &cloud), rms(&cloud, &decoded)]);
    for (with, without) in with.into_iter().zip(without) {
        assert!(with < 1.05 * without, "{with} and {without} m");
    }
}

#[test]
fn enough_of_the_input_is_near_with_instances() {
    let cloud = chests(&PLACES, true);
    let wanted = PatchesOptions { completeness: 0.999, ..options() };
    let model = learn(&cloud, &wanted);
    assert!(!model.instances().all.is_empty());
    let measured = decode(&model, true);
    let tree = KdTree::new(measured.positions()).unwrap();
    // Two spacings.
    let is_near = |p: &&Point| tree.nearest(**p).unwrap().squared_distance() <= 0.008 * 0.008;
    let near = cloud.positions().iter().filter(is_near).count();
    assert!(near as f64 >= 0.999 * cloud.len() as f64, "{near} of {}", cloud.len());
}

#[test]
fn exact_copies_share_points_beside_the_patches() {
    let cloud = chests(&PLACES[..2], false);
    let model = learn(&cloud, &PatchesOptions { max_error: Some(0.005), ..options() });
    let instances = model.instances();
    assert!(instances.n_points() > 0, "{:?}", model.report());
    let measured = decode(&model, true);
    let tree = KdTree::new(measured.positions()).unwrap();
    for &p in cloud.positions() {
        assert!(f64::from(tree.nearest(p).unwrap().squared_distance()).sqrt() <= 0.005);
    }
}

#[test]
fn the_limit_of_points_counts_instances() {
    let model = four();
    let n = decode(model, false).len() as u64;
    let options = DecodeOptions { max_points: n / 2, ..DecodeOptions::default() };
    let Err(Error::TooManyPoints { limit, .. }) = model.decode(options, &Silent) else {
        panic!("more points than allowed")
    };
    assert_eq!(limit, n / 2);
}

#[test]
fn a_file_gives_instances_back_and_threads_change_nothing() {
    let file = four().to_bytes().unwrap();
    let again: PatchModel = read(&file).unwrap();
    assert_eq!(again, *four());
    assert_eq!(again.to_bytes().unwrap(), file);
    assert_eq!(decode(&again, true), decode(four(), true));
    let cloud = chests(&PLACES, true);
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| learn(&cloud, &options())).to_bytes().unwrap(), file);
    }
}

#[test]
fn what_does_not_recur_has_the_bytes_of_a_model_without() {
    let cloud = chests(&PLACES[..1], true);
    let plain = learn(&cloud, &PatchesOptions { recurrence: false, ..options() });
    let model = learn(&cloud, &options());
    assert!(size(&model) <= size(&plain));
    if model.instances().all.is_empty() {
        assert_eq!(model.to_bytes().unwrap(), plain.to_bytes().unwrap());
    }
}

#[test]
fn damaged_instances_are_refused_or_harmless() {
    let model = learn(&chests(&PLACES[..2], true), &options());
    assert!(!model.instances().all.is_empty());
    contract::damage_of_a_section_is_refused_or_harmless(&model, Tag::new(b"INST"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn a_copy_is_found_wherever_it_stands(
        x in 0.9_f32..3.0, y in -2.0_f32..2.0, quarters in 0_u8..4, mirrored: bool,
    ) {
        let places = [PLACES[0], (mirrored, quarters, [x + 0.7, y, 0.0])];
        let cloud = chests(&places, true);
        let model = learn(&cloud, &options());
        let plain = learn(&cloud, &PatchesOptions { recurrence: false, ..options() });
        prop_assert!(size(&model) <= size(&plain));
        let again = model.instances().n_patches() as f64;
        let share = again / (again + model.len() as f64);
        prop_assert!(share > 0.35, "{share} at {x} {y} {quarters} {mirrored}");
    }
}
