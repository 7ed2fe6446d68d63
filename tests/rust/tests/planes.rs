//! Planes: what mathematics and the paper say of them, and what may come in a file.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use surfabet::geom::KdTree;
use surfabet::planes::{
    self, DIRECTIONS, MAX_COORDINATE, MAX_MODEL_TILES, PARTS, PlaneModel, PlanesHeader,
    PlanesOptions, StoredPatch,
};
use surfabet::{DecodeOptions, Limits, Model, PointCloud, Save, ScalarScale, Silent};
use surfabet_models::Error;
use surfabet_tests::assert_stops_when_asked;
use surfabet_tests::files::{LIMITS, read};
use surfabet_tests::scenes::room;

fn plain(points: Vec<[f32; 3]>) -> PointCloud {
    PointCloud::from_positions(points).0
}

fn learn(cloud: &PointCloud) -> PlaneModel {
    planes::learn(cloud, None, &PlanesOptions::default(), &Silent).unwrap()
}

fn bytes(model: &PlaneModel) -> Vec<u8> {
    model.to_bytes().unwrap()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

#[test]
fn a_box_is_six_planes_seen_from_within() {
    let cloud = room(30_000, 0);
    let model = learn(&cloud);
    assert_eq!(model.len(), 6);
    let middle = minus([1.5, 1.0, 0.75], model.origin());
    let mut area = 0.0;
    for (i, patch) in model.patches().iter().enumerate() {
        let frame = &patch.frame;
        let largest = frame.normal.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        assert!(largest > 0.9999, "{:?}", frame.normal);
        assert!(dot(frame.normal, minus(middle, frame.center)) > 0.5);
        // The noise of 5 mm, rounded to a quarter of a doubling.
        let rounding = 0.125_f64.exp2();
        assert!((0.005 / rounding..0.005 * rounding).contains(&patch.standard_deviation));
        area += patch.tiles.area();
        let axis = (0..3).find(|&a| frame.normal[a].abs() > 0.9).unwrap();
        let wanted = [[200, 60, 40], [40, 180, 60], [60, 60, 200]][axis];
        // Tiles at the sides hold a few points of the next face.
        let right = |c: &&[u8; 3]| (0..3).all(|k| i32::abs(i32::from(c[k]) - wanted[k]) < 12);
        let colors = model.colors(i);
        let share = colors.iter().filter(right).count() as f64 / colors.len() as f64;
        assert!(share > 0.8, "{share}");
    }
    // Tiles at the rims, 52 m, reach out or are missing by half their side at most.
    let rims = 52.0 * 0.5 * model.grid_size();
    assert!((area - 27.0).abs() < rims, "{area} {rims}");
    let outliers = model.header().n_outliers as f64 / cloud.len() as f64;
    assert!(outliers < 0.02, "{outliers}");
    let labels = model.labels().unwrap();
    assert_eq!(model.segment(&cloud, &Silent).unwrap(), labels);
    assert_eq!(
        read::<PlaneModel>(&bytes(&model)).unwrap().segment(&cloud, &Silent).unwrap(),
        labels
    );
}

#[test]
fn supported_points_are_projected_and_the_rest_left_out() {
    let cloud = room(20_000, 1);
    let model = learn(&cloud);
    let labels = model.labels().unwrap();
    let projected = model.project(&cloud, &Silent).unwrap();
    let kept: Vec<usize> = (0..cloud.len()).filter(|&i| labels[i] != u32::MAX).collect();
    assert_eq!(projected.len(), kept.len());
    let local = cloud.positions_about(model.origin());
    for (k, &i) in kept.iter().enumerate() {
        let frame = &model.patches()[labels[i] as usize].frame;
        let on = projected.positions()[k].map(f64::from);
        assert!(dot(minus(on, frame.center), frame.normal).abs() < 1e-5);
        // Straight along the normal.
        let moved = minus(on, local[i].map(f64::from));
        let across = cross(moved, frame.normal);
        assert!(dot(across, across).sqrt() < 1e-5);
    }
    assert_eq!(projected.colors().unwrap().len(), kept.len());
}

/// Areas of the polygons around a patch: shoelace about the first corner; holes count less than nothing.
fn area_around(model: &PlaneModel, i: usize) -> f64 {
    let normal = model.patches()[i].frame.normal;
    let of = |ring: Vec<[f64; 3]>| {
        let about = |k: usize| minus(ring[k % ring.len()], ring[0]);
        let doubled = |k: usize| dot(cross(about(k), about(k + 1)), normal);
        0.5 * (0..ring.len()).map(doubled).sum::<f64>()
    };
    model.polygons(i).into_iter().map(of).sum()
}

/// Areas of the triangles of each patch, all of which face where the normal points.
fn areas_of_triangles(model: &PlaneModel) -> Vec<f64> {
    let mesh = model.mesh();
    let mut areas = vec![0.0; model.len()];
    for (t, &patch) in mesh.triangles.iter().zip(&mesh.patches) {
        let [p, q, r] = t.map(|i| mesh.vertices[i as usize]);
        let normal = model.patches()[patch as usize].frame.normal;
        let doubled = dot(cross(minus(q, p), minus(r, p)), normal);
        assert!(doubled > 0.0);
        areas[patch as usize] += 0.5 * doubled;
    }
    areas
}

#[test]
fn polygons_and_triangles_have_the_area_of_the_supported_tiles() {
    let model: PlaneModel = read(&bytes(&learn(&room(20_000, 2)))).unwrap();
    let triangles = areas_of_triangles(&model);
    for (i, patch) in model.patches().iter().enumerate() {
        let (area, around) = (patch.tiles.area(), area_around(&model, i));
        assert!((around / area - 1.0).abs() < 1e-9, "{around} {area}");
        assert!((triangles[i] / area - 1.0).abs() < 1e-9, "{} {area}", triangles[i]);
    }
}

#[test]
fn decoding_covers_the_supported_tiles_at_any_spacing() {
    let cloud = room(30_000, 3);
    let model = learn(&cloud);
    let area: f64 = model.patches().iter().map(|p| p.tiles.area()).sum();
    for spacing in [0.03, 0.01] {
        let options =
            DecodeOptions { resolution: Some(spacing), normals: true, ..DecodeOptions::default() };
        let decoded = model.decode(options, &Silent).unwrap();
        // At least as dense as asked for, and at most one more row and column per tile.
        let wanted = area / (spacing * spacing);
        let most: f64 = model
            .patches()
            .iter()
            .map(|p| p.tiles.n_supported() as f64 * (p.tiles.edge() / spacing + 1.0).powi(2))
            .sum();
        let found = decoded.len() as f64;
        assert!(found >= wanted && found <= most, "{wanted} {found} {most}");
        assert!(decoded.normals().is_some() && decoded.colors().is_some());
        assert!(model.segment(&decoded, &Silent).unwrap().iter().all(|&l| l != u32::MAX));
    }
    let thick = DecodeOptions { as_measured: true, ..DecodeOptions::default() };
    let (thick, thin) = (
        model.decode(thick, &Silent).unwrap(),
        model.decode(DecodeOptions::default(), &Silent).unwrap(),
    );
    assert_eq!(thick.len(), thin.len());
    let squares: f64 = thick
        .positions()
        .iter()
        .zip(thin.positions())
        .map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>())
        .sum();
    // Every patch as thick as the model says: its variance, by the points that the patch gets.
    let labels = model.segment(&thin, &Silent).unwrap();
    let variances = labels.iter().map(|&l| model.patches()[l as usize].standard_deviation.powi(2));
    let ratio = (squares / variances.sum::<f64>()).sqrt();
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn patches_placed_at_random_or_not_are_the_same_on_any_number_of_threads() {
    let cloud = room(40_000, 4);
    for initial_patches in [0, 5] {
        let options = PlanesOptions { initial_patches, ..PlanesOptions::default() };
        let with = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| {
                let model = planes::learn(&cloud, None, &options, &Silent).unwrap();
                let decoded = model.decode(DecodeOptions::default(), &Silent).unwrap();
                (bytes(&model), model.labels().unwrap().to_vec(), decoded)
            })
        };
        let one = with(1);
        assert_eq!(one, with(2));
        assert_eq!(one, with(8));
    }
}

#[test]
fn clouds_without_anything_flat_give_a_model_without_patches() {
    let empty = PointCloud::default();
    let found = planes::learn(&empty, None, &PlanesOptions::default(), &Silent);
    assert_eq!(found, Err(Error::EmptyCloud));
    for points in [
        vec![[1.0; 3]],
        vec![[1.0; 3]; 100],
        vec![[0.0; 3], [1.0, 2.0, 3.0]],
        (0..500).map(|i| [i as f32 * 0.01, i as f32 * 0.02, 0.0]).collect(),
    ] {
        let model = learn(&plain(points.clone()));
        assert!(model.is_empty(), "{} patches", model.len());
        assert_eq!(model.header().n_outliers as usize, points.len());
        assert!(model.labels().unwrap().iter().all(|&l| l == u32::MAX));
        let again: PlaneModel = read(&bytes(&model)).unwrap();
        assert_eq!(again, model);
        assert!(again.decode(DecodeOptions::default(), &Silent).unwrap().is_empty());
        assert!(again.mesh().triangles.is_empty());
    }
}

#[test]
fn huge_coordinates_keep_their_millimetres() {
    let near = room(10_000, 5);
    let mut parts = near.clone().into_parts();
    let offset = [691_000.0, 5_334_000.0, 512.0];
    parts.origin = offset;
    let origins = &mut parts.viewpoints.as_mut().unwrap().origins;
    origins[0] = std::array::from_fn(|a| origins[0][a] + offset[a]);
    let far = PointCloud::from_parts(parts).unwrap().0;
    let (a, b) = (learn(&near), learn(&far));
    assert_eq!(a.stored(), b.stored());
    assert_eq!(a.labels(), b.labels());
    assert!((0..3).all(|i| b.origin()[i] == a.origin()[i] + offset[i]));
}

/// Squares of a metre with points every 2 cm, two millimetres of noise, and `apart` metres between their corners along x.
fn squares(apart: f32) -> PointCloud {
    let point = |i: u32| {
        let (row, column) = (i % 50, i / 50 % 50);
        let noise = 0.002 * ((f64::from(i) * 0.754_877).fract() as f32 - 0.5);
        [0.02 * row as f32 + apart * (i / 2500) as f32, 0.02 * column as f32, noise]
    };
    plain((0..5000).map(point).collect())
}

#[test]
fn a_wide_scene_has_coarser_positions_and_a_wider_one_is_refused_by_name() {
    let planes_of = |apart: f32| {
        let options = PlanesOptions { min_grid_size: Some(0.04), ..PlanesOptions::default() };
        planes::learn(&squares(apart), None, &options, &Silent)
    };
    for apart in [100.0, 20_000.0] {
        let model = planes_of(apart).unwrap();
        assert_eq!(model.len(), 2, "{apart}");
        let again: PlaneModel = read(&bytes(&model)).unwrap();
        let decoded = again.decode(DecodeOptions::default(), &Silent).unwrap();
        let tree = KdTree::new(decoded.positions()).unwrap();
        let about =
            |p: &[f32; 3]| std::array::from_fn(|a| (f64::from(p[a]) - again.origin()[a]) as f32);
        let squared = |p: &[f32; 3]| tree.nearest(about(p)).unwrap().squared_distance();
        let far = squares(apart).positions().iter().map(squared).fold(0.0, f32::max);
        // Tiles begin anywhere: a tile and a half.
        assert!(far < 0.06_f32.powi(2), "{apart}: {}", far.sqrt());
    }
    let found = planes_of(200_000.0);
    let named = matches!(&found, Err(Error::InvalidParameter(p)) if p.name == "min_grid_size");
    assert!(named, "{found:?}");
}

#[test]
fn wrong_weights_are_named() {
    let cloud = plain(vec![[0.0; 3], [1.0; 3], [0.0, 1.0, 0.0]]);
    for weights in [vec![1.0; 2], vec![1.0, f32::NAN, 1.0], vec![-1.0; 3], vec![0.0; 3]] {
        let found = planes::learn(&cloud, Some(&weights), &PlanesOptions::default(), &Silent);
        let named = matches!(&found, Err(Error::InvalidParameter(p)) if p.name == "weights");
        assert!(named, "{found:?}");
    }
}

#[test]
fn segmenting_stops_whenever_asked() {
    let cloud = room(20_000, 6);
    let model = learn(&cloud);
    assert_stops_when_asked(|p| model.segment(&cloud, p));
}

/// A patch that a file may hold, with a mask drawn at random.
fn stored(
    pose: [i32; 6],
    shape: [u32; 2],
    sizes: [u8; 5],
    seed: u64,
    colored: bool,
) -> StoredPatch {
    let n = (shape[0] * shape[1]) as usize;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let share = rng.random_range(0.2..1.0);
    let supported: Vec<bool> = (0..n).map(|i| i == 0 || rng.random_bool(share)).collect();
    let n_supported = supported.iter().filter(|s| **s).count() as i16;
    StoredPatch {
        position: [pose[0], pose[1], pose[2]],
        normal: [pose[3] as i16, pose[4] as i16],
        direction: pose[5] as u16,
        doublings: sizes[0],
        shape,
        last: [sizes[1], sizes[2]],
        deviation: sizes[3],
        count: sizes[4],
        supported,
        colors: (0..if colored { n_supported } else { 0 })
            .map(|i| [i % 512, -(i % 513), i % 100 - 50])
            .collect(),
        intensities: (0..if colored { i32::from(n_supported) } else { 0 })
            .map(|i| i * 7919 % (1 << 20))
            .collect(),
    }
}

fn header(patches: &[StoredPatch], colored: bool) -> PlanesHeader {
    PlanesHeader {
        n_points: 1000,
        n_outliers: 10,
        origin: [1e6, -5.0, 0.25],
        exponent: -10,
        grid_size: 0.1,
        color_step: colored.then_some(8),
        intensity: colored.then_some(ScalarScale { low: -1.5, high: 1e6, step: 1.0 }),
        n_patches: patches.len() as u64,
    }
}

fn any_patch(colored: bool) -> impl Strategy<Value = StoredPatch> {
    let far = MAX_COORDINATE;
    let coordinate = || prop_oneof![-far..=far, -50..50_i32, Just(far), Just(-far)];
    let normal = || prop_oneof![-32767..=32767_i32, -3..3_i32, Just(32767), Just(-32767)];
    let pose =
        ((coordinate(), coordinate(), coordinate()), (normal(), normal()), 0..DIRECTIONS as i32);
    let shape =
        prop_oneof![[1..40_u32, 1..40_u32], [1..2_u32, 1..2000_u32], [1..2000_u32, 1..2_u32]];
    let sizes = (0..=40_u8, 1..=PARTS, 1..=PARTS, any::<u8>(), any::<u8>());
    (pose, shape, sizes, any::<u64>()).prop_map(move |(pose, shape, sizes, seed)| {
        let ((x, y, z), (u, v), direction) = pose;
        let (doublings, last_x, last_y, deviation, count) = sizes;
        let sizes = [doublings, last_x, last_y, deviation, count];
        stored([x, y, z, u, v, direction], shape, sizes, seed, colored)
    })
}

fn any_patches() -> impl Strategy<Value = (bool, Vec<StoredPatch>)> {
    any::<bool>()
        .prop_flat_map(|colored| (Just(colored), prop::collection::vec(any_patch(colored), 0..40)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn whatever_patches_there_are_come_back((colored, patches) in any_patches()) {
        let model = PlaneModel::from_stored(header(&patches, colored), patches.clone()).unwrap();
        let file = bytes(&model);
        let again: PlaneModel = read(&file).unwrap();
        prop_assert_eq!(again.stored(), &patches[..]);
        prop_assert_eq!(again.header(), model.header());
        prop_assert_eq!(bytes(&again), file);
        // Nothing that a file may hold makes trouble later.
        let triangles = areas_of_triangles(&again);
        for (i, of_triangles) in triangles.into_iter().enumerate() {
            let (area, around) = (again.patches()[i].tiles.area(), area_around(&again, i));
            prop_assert!((around / area - 1.0).abs() < 1e-5, "{} {}", around, area);
            prop_assert!((of_triangles / area - 1.0).abs() < 1e-5, "{} {}", of_triangles, area);
            again.colors(i);
        }
        again.segment(&room(100, 8), &Silent).unwrap();
        let spacing = DecodeOptions { resolution: Some(1e9), ..DecodeOptions::default() };
        let _ = again.decode(spacing, &Silent);
    }
}

#[test]
fn stored_patches_that_contradict_themselves_are_refused() {
    let good = stored([0, 0, 0, 5, 5, 7], [3, 2], [0, 8, 3, 4, 5], 4, false);
    let of = |patch: StoredPatch| {
        let patches = vec![patch];
        PlaneModel::from_stored(header(&patches, false), patches)
    };
    assert!(of(good.clone()).is_ok());
    for wrong in [
        StoredPatch { position: [MAX_COORDINATE + 1, 0, 0], ..good.clone() },
        StoredPatch { direction: DIRECTIONS as u16, ..good.clone() },
        StoredPatch { doublings: 41, ..good.clone() },
        StoredPatch { shape: [3, 3], ..good.clone() },
        StoredPatch { shape: [0, 2], supported: Vec::new(), ..good.clone() },
        StoredPatch { last: [0, 8], ..good.clone() },
        StoredPatch { last: [8, 9], ..good.clone() },
        StoredPatch { supported: vec![false; 6], ..good.clone() },
        StoredPatch { colors: vec![[0; 3]], ..good.clone() },
    ] {
        assert!(matches!(of(wrong.clone()), Err(Error::Inconsistent(_))), "{wrong:?}");
    }
}

#[test]
fn headers_outside_their_domains_are_refused() {
    let patches = vec![stored([0, 0, 0, 5, 5, 7], [3, 2], [0, 8, 3, 4, 5], 4, true)];
    let good = header(&patches, true);
    let of = |header: &PlanesHeader| PlaneModel::from_stored(header.clone(), patches.clone());
    assert!(of(&good).is_ok());
    for wrong in [
        PlanesHeader { origin: [f64::NAN, 0.0, 0.0], ..good.clone() },
        PlanesHeader { exponent: 61, ..good.clone() },
        PlanesHeader { exponent: -61, ..good.clone() },
        PlanesHeader { grid_size: 0.0, ..good.clone() },
        PlanesHeader { grid_size: f64::INFINITY, ..good.clone() },
        PlanesHeader { color_step: Some(65), ..good.clone() },
        PlanesHeader { color_step: None, ..good.clone() },
        PlanesHeader { n_outliers: good.n_points + 1, ..good.clone() },
        PlanesHeader { n_patches: good.n_patches + 1, ..good.clone() },
    ] {
        assert!(matches!(of(&wrong), Err(Error::Inconsistent(_))), "{wrong:?}");
    }
}

#[test]
fn a_small_file_cannot_ask_for_much_memory() {
    // Masks without a gap cost next to nothing: patches of the largest size.
    let side = 4096;
    let patch = |i: i32| StoredPatch {
        position: [i, 0, 0],
        shape: [side, side],
        last: [8, 8],
        supported: vec![true; (side * side) as usize],
        ..StoredPatch::default()
    };
    let patches: Vec<StoredPatch> = (0..3).map(patch).collect();
    let tiles = u64::from(side * side);
    assert!(2 * tiles <= MAX_MODEL_TILES && 3 * tiles > MAX_MODEL_TILES);
    let found = PlaneModel::from_stored(header(&patches, false), patches.clone());
    assert!(matches!(found, Err(Error::Inconsistent(_))));
    let model = PlaneModel::from_stored(header(&patches[..2], false), patches[..2].to_vec());
    let file = bytes(&model.unwrap());
    assert!(file.len() < 5000, "{}", file.len());
    assert!(Model::from_bytes(&file, &Limits::default()).is_ok());
    let Err(error) = Model::from_bytes(&file, &LIMITS) else { panic!("read beyond the limits") };
    assert!(error.to_string().contains("more than 1000000 tiles"), "{error}");
}
