//! Growing neural gas: what mathematics and the paper say of it, and what may come in a file.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet::gas::{self, DecodeOptions, GasModel, GasOptions, Search};
use surfabet::{CloudParts, Family, Model, PointCloud, Silent, Viewpoints};
use surfabet_codec::{ContainerWriter, Features};
use surfabet_geom::{KdTree, VoxelGrid};
use surfabet_models::Error;
use surfabet_tests::{
    LIMITS, Stop, assert_cuts_are_errors, assert_flipped_bits_are_noticed, assert_same_numbers,
    golden,
};

fn plain(points: Vec<[f32; 3]>) -> PointCloud {
    PointCloud::from_positions(points).0
}

fn options(n_neurons: usize) -> GasOptions {
    GasOptions { n_neurons, patterns: 100, ..GasOptions::default() }
}

fn learn(cloud: &PointCloud, options: &GasOptions) -> GasModel {
    gas::learn(cloud, options, &Silent).unwrap()
}

fn bytes(model: &GasModel) -> Vec<u8> {
    Model::from(model.clone()).to_bytes().unwrap()
}

fn read(file: &[u8]) -> Result<GasModel, surfabet::Error> {
    match Model::from_bytes(file, &LIMITS)? {
        Model::Gas(model) => Ok(model),
        other => panic!("a model of family {}", other.family()),
    }
}

/// A sphere of radius 1 with colours by hemisphere, seen from its centre or with nothing known of the side.
fn sphere(n: usize, seen: bool, seed: u64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut parts = CloudParts::default();
    let mut colors = Vec::new();
    while parts.positions.len() < n {
        let p: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let r = p.iter().map(|c| c * c).sum::<f32>().sqrt();
        if r > 0.1 && r < 1.0 {
            let p = p.map(|c| c / r);
            parts.positions.push(p);
            colors.push(if p[2] > 0.0 { [240, 40, 40] } else { [20, 60, 220] });
        }
    }
    parts.colors = Some(colors);
    if seen {
        parts.viewpoints = Some(Viewpoints { origins: vec![[0.0; 3]], index: vec![0; n] });
    }
    PointCloud::from_parts(parts).unwrap().0
}

fn mean_distance(from: &PointCloud, to: &[[f32; 3]]) -> f64 {
    let tree = KdTree::new(to).unwrap();
    let sum: f64 = from
        .positions()
        .iter()
        .map(|&p| f64::from(tree.nearest(p).unwrap().squared_distance().sqrt()))
        .sum();
    sum / from.len() as f64
}

#[test]
fn the_same_seed_gives_the_same_network_with_either_search() {
    let cloud = sphere(3000, true, 0);
    for random_state in 0..3 {
        let base = GasOptions { random_state, ..options(400) };
        let indexed = learn(&cloud, &base);
        let brute = learn(&cloud, &GasOptions { search: Search::BruteForce, ..base.clone() });
        assert_eq!(bytes(&indexed), bytes(&brute));
        assert_eq!(indexed.len(), 400);
    }
    let other = learn(&cloud, &GasOptions { random_state: 9, ..options(400) });
    assert_ne!(bytes(&other), bytes(&learn(&cloud, &options(400))));
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let cloud = sphere(20_000, false, 1);
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| {
            let model = learn(&cloud, &options(500));
            let decode = DecodeOptions { resolution: Some(0.02), ..DecodeOptions::default() };
            (bytes(&model), model.decode(decode, &Silent).unwrap())
        })
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(8));
}

#[test]
fn it_adapts_better_than_a_voxel_grid_of_as_many() {
    let cloud = sphere(40_000, false, 2);
    let model = learn(&cloud, &GasOptions { patterns: 300, ..options(500) });
    let (mut low, mut high) = (0.01, 1.0);
    for _ in 0..30 {
        let size = 0.5 * (low + high);
        let n = VoxelGrid::new(&cloud, size, &Silent).unwrap().len();
        if n <= 500 { high = size } else { low = size }
    }
    let grid = VoxelGrid::new(&cloud, high, &Silent).unwrap();
    let means = grid.means(&cloud, None, &Silent).unwrap();
    assert!(means.len() > 450);
    let (ours, theirs) =
        (mean_distance(&cloud, &model.positions()), mean_distance(&cloud, means.positions()));
    assert!(ours < theirs, "{ours} {theirs}");
    assert!((ours / model.mean_error() - 1.0).abs() < 1e-4, "{ours} {}", model.mean_error());
}

#[test]
fn a_sphere_is_one_component_whose_ways_are_arcs() {
    let cloud = sphere(30_000, false, 3);
    let model = learn(&cloud, &options(1000));
    assert_eq!(model.components().iter().max(), Some(&0));
    let distances = model.geodesic_distances(0).unwrap();
    let direction = |i: usize| {
        let p = model.position(i);
        let r = p.iter().map(|c| c * c).sum::<f32>().sqrt();
        p.map(|c| c / r)
    };
    let start = direction(0);
    for (i, &d) in distances.iter().enumerate() {
        let p = direction(i);
        let cosine: f32 = (0..3).map(|a| p[a] * start[a]).sum();
        let arc = f64::from(cosine.clamp(-1.0, 1.0).acos());
        // Chords are a little shorter than arcs, ways along edges up to a fifth longer than straight ones.
        assert!(d > 0.95 * arc - 0.05 && d < 1.25 * arc + 0.1, "{d} {arc}");
    }
    assert!(model.geodesic_distances(1000).is_err());
}

#[test]
fn two_spheres_apart_are_two_components_without_a_way_between() {
    let mut parts = sphere(5000, false, 4).into_parts();
    parts.positions.iter_mut().step_by(2).for_each(|p| p[0] += 10.0);
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let model = learn(&cloud, &GasOptions { patterns: 300, ..options(300) });
    let components = model.components();
    assert_eq!(components.iter().max(), Some(&1));
    let distances = model.geodesic_distances(0).unwrap();
    for i in 0..model.len() {
        assert_eq!(distances[i].is_finite(), components[i] == components[0]);
        // About the origin, which is half way.
        let same = (model.position(i)[0] > 0.0) == (model.position(0)[0] > 0.0);
        assert_eq!(same, components[i] == components[0]);
    }
}

#[test]
fn normals_point_to_the_sensor_or_all_to_one_side() {
    for seen in [true, false] {
        let cloud = sphere(30_000, seen, 5);
        let model = learn(&cloud, &options(600));
        let outwards = |i: usize| -> f32 {
            let (p, n) = (model.position(i), model.normal(i));
            (0..3).map(|a| p[a] * n[a]).sum()
        };
        let side = if seen { -1.0 } else { outwards(0).signum() };
        for i in 0..model.len() {
            assert!(side * outwards(i) > 0.95, "{} {i}", outwards(i));
        }
    }
}

#[test]
fn the_mesh_is_consistently_oriented_and_closes_over_a_sphere() {
    let cloud = sphere(50_000, true, 6);
    let model = learn(&cloud, &GasOptions { patterns: 300, ..options(500) });
    let mesh = model.mesh();
    let mut sides: Vec<[u32; 2]> =
        mesh.iter().flat_map(|&[i, j, k]| [[i, j], [j, k], [k, i]]).collect();
    sides.sort_unstable();
    let n = sides.len();
    sides.dedup();
    assert_eq!(sides.len(), n, "an edge passed twice in one direction");
    // Euler: a closed surface of genus 0 has 2 n - 4 triangles.
    assert!(
        mesh.len() as f64 > 0.9 * (2.0 * 500.0 - 4.0),
        "{} {}",
        mesh.len(),
        model.edges().len()
    );
    assert!(mesh.len() <= 2 * 500 - 4, "{}", mesh.len());
    let mut area = 0.0;
    for t in &mesh {
        let [p, q, r] = t.map(|i| model.position(i as usize));
        let (u, v): ([f32; 3], [f32; 3]) =
            (std::array::from_fn(|a| q[a] - p[a]), std::array::from_fn(|a| r[a] - p[a]));
        let cross =
            [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        // Seen from the centre, where the sensor stood.
        assert!((0..3).map(|a| cross[a] * p[a]).sum::<f32>() < 0.0);
        area += 0.5 * f64::from(cross.iter().map(|c| c * c).sum::<f32>().sqrt());
    }
    // Flat triangles lie within the sphere, and some holes stay open.
    let share = area / (4.0 * std::f64::consts::PI);
    assert!((0.88..1.0).contains(&share), "{share}");
}

#[test]
fn decoding_at_a_spacing_covers_the_sphere_and_keeps_its_colours() {
    let cloud = sphere(50_000, true, 7);
    let model = learn(&cloud, &options(500));
    let neurons = model.decode(DecodeOptions::default(), &Silent).unwrap();
    assert_eq!(neurons.len(), model.len());
    assert_eq!(neurons.positions(), model.positions());
    let options =
        DecodeOptions { resolution: Some(0.02), normals: true, ..DecodeOptions::default() };
    let dense = model.decode(options, &Silent).unwrap();
    let expected = 4.0 * std::f64::consts::PI / 0.02_f64.powi(2);
    assert!((dense.len() as f64 / expected - 1.0).abs() < 0.1, "{} {expected}", dense.len());
    let tree = KdTree::new(dense.positions()).unwrap();
    let far = |p: &&[f32; 3]| tree.nearest(**p).unwrap().squared_distance().sqrt() > 0.05;
    let holes = cloud.positions().iter().filter(far).count();
    assert!(holes < 50, "{holes}");
    let normals = dense.normals().unwrap();
    for ((p, c), n) in dense.positions().iter().zip(dense.colors().unwrap()).zip(normals) {
        let r = p.iter().map(|c| c * c).sum::<f32>().sqrt();
        assert!((r - 1.0).abs() < 0.02, "{r}");
        assert!((0..3).map(|a| n[a] * p[a]).sum::<f32>() < -0.9);
        if p[2].abs() > 0.2 {
            let wanted = if p[2] > 0.0 { [240, 40, 40] } else { [20, 60, 220] };
            for (found, wanted) in c.iter().zip(wanted) {
                assert!(found.abs_diff(wanted) <= 8, "{c:?} {wanted:?}");
            }
        }
    }
    let bounded = DecodeOptions { max_points: 100, ..options };
    assert!(matches!(model.decode(bounded, &Silent), Err(Error::TooManyPoints { .. })));
    let wrong = DecodeOptions { resolution: Some(-1.0), ..options };
    assert!(matches!(model.decode(wrong, &Silent), Err(Error::InvalidParameter { .. })));
}

#[test]
fn thickness_comes_back_as_measured() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let noise = rand_distr::Normal::new(0.0, 0.01).unwrap();
    let points = (0..40_000)
        .map(|_| [rng.random_range(0.0..2.0), rng.random_range(0.0..2.0), rng.sample(noise)])
        .collect();
    let model = learn(&plain(points), &options(300));
    let spread = |as_measured| {
        let options =
            DecodeOptions { resolution: Some(0.02), as_measured, ..DecodeOptions::default() };
        let cloud = model.decode(options, &Silent).unwrap();
        let sum: f64 = cloud.positions().iter().map(|p| f64::from(p[2]).powi(2)).sum();
        (sum / cloud.len() as f64).sqrt()
    };
    assert!(spread(false) < 0.004, "{}", spread(false));
    assert!((0.008..0.012).contains(&spread(true)), "{}", spread(true));
    // The neurons' counts are those of the points, to a quarter of a doubling each.
    let total: f64 = (0..model.len()).map(|i| model.count(i)).sum();
    assert!((total / 40_000.0 - 1.0).abs() < 0.05, "{total}");
}

#[test]
fn an_update_learns_the_new_scan_and_keeps_the_old_one() {
    let first = sphere(20_000, true, 9);
    let mut parts = sphere(20_000, true, 10).into_parts();
    parts.positions.iter_mut().for_each(|p| p[0] += 1.5);
    parts.viewpoints.as_mut().unwrap().origins[0] = [1.5, 0.0, 0.0];
    let second = PointCloud::from_parts(parts).unwrap().0;
    let base = GasOptions { patterns: 300, ..options(400) };
    let model = learn(&first, &base);
    let about = |c: &PointCloud, m: &GasModel| {
        let shifted = plain(c.positions_about(m.origin()));
        mean_distance(&shifted, &m.positions())
    };
    let before = about(&first, &model);
    let both = model.update(&second, Some(800), &base, &Silent).unwrap();
    assert_eq!(both.len(), 800);
    assert_eq!(both.n_points(), 40_000);
    assert!(about(&first, &both) < 1.1 * before, "{} {before}", about(&first, &both));
    assert!(about(&second, &both) < 1.2 * before, "{} {before}", about(&second, &both));
    // Left to itself it grows about as much as there is new space.
    let free = model.update(&second, None, &base, &Silent).unwrap();
    assert!((600..900).contains(&free.len()), "{}", free.len());
    assert_eq!(read(&bytes(&both)).unwrap().edges(), both.edges());
    assert!(model.update(&second, Some(399), &base, &Silent).is_err());
    assert_eq!(model.update(&PointCloud::default(), None, &base, &Silent), Err(Error::EmptyCloud));
}

#[test]
fn growth_ends_by_error_and_by_passes() {
    let cloud = sphere(20_000, false, 11);
    let by_error = learn(&cloud, &GasOptions { target_error: Some(0.1), ..options(5000) });
    assert!(by_error.len() < 1000, "{}", by_error.len());
    assert!((by_error.mean_error() / 0.1 - 1.0).abs() < 0.15, "{}", by_error.mean_error());
    assert_eq!(by_error.report().stop_reason, "mean distance reached");
    let by_passes = learn(&cloud, &GasOptions { passes: Some(0.5), ..options(5000) });
    // 10 000 signals, one neuron for each hundred, and the first two.
    assert!(by_passes.len() <= 102, "{}", by_passes.len());
    assert!(by_passes.len() > 95, "{}", by_passes.len());
    assert_eq!(by_passes.report().stop_reason, "number of signals reached");
    assert_eq!(by_passes.report().iterations, 10_000);
}

#[test]
fn clouds_that_are_hardly_any_give_a_gas_or_a_clear_error() {
    assert_eq!(gas::learn(&PointCloud::default(), &options(2), &Silent), Err(Error::EmptyCloud));
    let too_few = |points: Vec<[f32; 3]>, n| gas::learn(&plain(points), &options(n), &Silent);
    let places = |r| match r {
        Err(Error::TooFewPlaces { neurons, places }) => (neurons, places),
        other => panic!("{other:?}"),
    };
    assert_eq!(places(too_few(vec![[1.0; 3]], 2)), (2, 1));
    assert_eq!(places(too_few(vec![[1.0, 2.0, 3.0]; 100], 2)), (2, 1));
    assert_eq!(places(too_few(vec![[0.0; 3], [-0.0; 3], [0.0, -0.0, 0.0]], 2)), (2, 1));
    let line: Vec<[f32; 3]> = (0..200).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
    assert_eq!(places(too_few(line.clone(), 201)), (201, 200));
    let duplicates: Vec<[f32; 3]> = (0..500).map(|i| [(i % 3) as f32, 0.0, 0.0]).collect();
    for (points, n) in [
        (vec![[0.0; 3], [3.0, 4.0, 5.0]], 2),
        (vec![[0.0; 3], [1e-30, 0.0, 0.0]], 2),
        (line.clone(), 20),
        (line, 200),
        (duplicates, 3),
    ] {
        let model = too_few(points, n).unwrap();
        assert!((2..=n).contains(&model.len()));
        for spacing in [None, Some(0.01)] {
            let options = DecodeOptions { resolution: spacing, ..DecodeOptions::default() };
            let decoded = model.decode(options, &Silent).unwrap();
            assert!(decoded.len() >= model.len().min(decoded.len()) && decoded.colors().is_none());
        }
        let again = read(&bytes(&model)).unwrap();
        assert_eq!(again.neurons(), model.neurons());
        model.mesh();
    }
}

#[test]
fn huge_coordinates_keep_their_millimetres() {
    let near = sphere(5000, true, 12);
    let mut parts = near.clone().into_parts();
    let offset = [691_000.0, 5_334_000.0, 512.0];
    parts.origin = offset;
    parts.viewpoints.as_mut().unwrap().origins[0] = offset;
    let far = PointCloud::from_parts(parts).unwrap().0;
    let (a, b) = (learn(&near, &options(200)), learn(&far, &options(200)));
    assert_eq!(a.neurons(), b.neurons());
    assert_eq!(a.edges(), b.edges());
    assert!((0..3).all(|i| b.origin()[i] == a.origin()[i] + offset[i]));
}

#[test]
fn positions_must_fit_their_step() {
    let wide = plain(vec![[0.0; 3], [1000.0; 3]]);
    let fine = GasOptions { position_step: Some(1e-6), ..options(2) };
    assert!(matches!(gas::learn(&wide, &fine, &Silent), Err(Error::TooLarge { .. })));
}

#[test]
fn stopping_stops() {
    let found = gas::learn(&sphere(100, false, 13), &options(10), &Stop);
    assert!(matches!(found, Err(Error::Cancelled(_))));
}

/// A coloured sphere at an odd place, and a few neurons apart from it.
fn small_model() -> GasModel {
    let mut parts = sphere(2000, true, 14).into_parts();
    parts.origin = [10.0, -20.0, 5.0];
    parts.positions.iter_mut().step_by(5).for_each(|p| p[0] += 10.0);
    learn(&PointCloud::from_parts(parts).unwrap().0, &options(60))
}

#[test]
fn a_model_read_back_is_the_same() {
    let model = small_model();
    let file = bytes(&model);
    let again = read(&file).unwrap();
    assert_eq!(bytes(&again), file);
    assert_eq!(again.header(), model.header());
    assert_eq!(again.neurons(), model.neurons());
    assert_eq!(again.edges(), model.edges());
    let options =
        DecodeOptions { resolution: Some(0.05), normals: true, ..DecodeOptions::default() };
    assert_eq!(again.decode(options, &Silent), model.decode(options, &Silent));
    // Prices are what the bytes come to.
    let price: f64 = model.price().iter().sum();
    assert!((file.len() as f64 - price) < 200.0, "{} {price}", file.len());
}

#[test]
fn cut_at_any_byte_it_is_an_error() {
    assert_cuts_are_errors(&bytes(&small_model()));
}

#[test]
fn any_flipped_bit_is_an_error_or_harmless() {
    assert_flipped_bits_are_noticed(&bytes(&small_model()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn streams_of_random_bytes_never_panic(
        streams in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 5),
        meta in prop::option::of(prop::collection::vec(any::<u8>(), 0..50)),
    ) {
        // The checksums are right, so that only the content can be refused.
        let file = bytes(&small_model());
        let container = surfabet::Container::parse(&file, &LIMITS).unwrap();
        let mut forged = ContainerWriter::new(Family::Gas, Features::NONE);
        for (i, section) in container.sections().iter().enumerate() {
            let bytes = match i {
                0 => meta.clone().unwrap_or(section.bytes.to_vec()),
                _ => streams[i - 1].clone(),
            };
            forged = forged.section(section.tag, bytes);
        }
        let _ = Model::from_bytes(&forged.finish().unwrap(), &LIMITS);
    }
}

/// A line per neuron, position in the world (metres), normal, colour and sizes; then one per edge.
fn listing(model: &GasModel) -> String {
    let (cloud, colors) =
        (model.decode(DecodeOptions::default(), &Silent).unwrap(), model.colors().unwrap());
    let neuron = |i: usize| {
        let ([x, y, z], [u, v, w], [r, g, b]) = (cloud.world(i), model.normal(i), colors[i]);
        let (count, radius, thickness) = (model.count(i), model.radius(i), model.thickness(i));
        format!(
            "{x:.7} {y:.7} {z:.7} {u:.6} {v:.6} {w:.6} {r} {g} {b} {count:.4} {radius:.7} {thickness:.7}\n"
        )
    };
    let edges = model.edges().iter().map(|[a, b]| format!("{a} {b}\n"));
    (0..model.len()).map(neuron).chain(edges).collect()
}

/// Writes the golden file of this release. Run once per release, before it is published:
/// `cargo test -p surfabet-tests --test gas -- --ignored`.
#[test]
#[ignore = "writes tests/golden; files of a published release must never change"]
fn write_golden() {
    let model = small_model();
    Model::from(model.clone()).save(golden("gas_0_1.sfb")).unwrap();
    std::fs::write(golden("gas_0_1.txt"), listing(&model)).unwrap();
}

#[test]
fn files_of_release_0_1_stay_readable() {
    let file = std::fs::read(golden("gas_0_1.sfb")).unwrap();
    let model = read(&file).unwrap();
    assert_eq!(bytes(&model), file);
    assert_eq!((model.len(), model.n_points()), (60, 2000));
    assert_eq!(model.origin(), [15.0, -20.0, 5.0]);
    let expected = std::fs::read_to_string(golden("gas_0_1.txt")).unwrap();
    assert_same_numbers(&listing(&model), &expected, |_, e| 1e-6 * e.abs().max(1.0));
}
