//! Alphabets chosen by BIC on scenes that are known exactly.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::bic_alphabet::{self, BicAlphabetFigures, BicHeader, BicPose, BicShape, BicWord};
use surfabet::geom::KdTree;
use surfabet::{
    BicAlphabet, BicAlphabetModel, BicAlphabetOptions, CloudParts, DecodeOptions, PointCloud, Save,
    Silent, Upright, Viewpoints,
};
use surfabet_models::Error;
use surfabet_tests::files::read;
use surfabet_tests::scenes::step;

fn learn(cloud: &PointCloud, options: &BicAlphabetOptions) -> BicAlphabetModel {
    bic_alphabet::learn(cloud, options, &Silent).unwrap()
}

fn decode(model: &BicAlphabetModel) -> PointCloud {
    model.decode(DecodeOptions::default(), &Silent).unwrap()
}

fn figures(model: &BicAlphabetModel) -> BicAlphabetFigures {
    model.report().figures.unwrap()
}

/// A room of 2 x 2 x 1.5 m seen from its middle, with boxes on the floor, in steps of 2 degrees.
fn room(seed: u64) -> CloudParts {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let eye = [0.0_f64, 0.0, 0.8];
    let boxes: Vec<[f64; 3]> = (0..6)
        .map(|k| {
            let angle = f64::from(k) + rng.random_range(-0.2..0.2);
            [0.7 * angle.cos(), 0.7 * angle.sin(), 0.1]
        })
        .collect();
    let mut parts = CloudParts::default();
    for row in -44..45 {
        for column in 0..180 {
            let (e, a) = (f64::from(row) * 0.035, f64::from(column) * 0.035);
            let d = [e.cos() * a.cos(), e.cos() * a.sin(), e.sin()];
            // The nearest plane of the room from inside, and of the boxes from outside.
            let mut range = f64::INFINITY;
            for (axis, (low, high)) in
                [(-1.0, 1.0), (-1.0, 1.0), (0.0, 1.5)].into_iter().enumerate()
            {
                let wall = if d[axis] > 0.0 { high } else { low };
                range = range.min((wall - eye[axis]) / d[axis]);
            }
            for b in &boxes {
                let (mut near, mut far) = (0.0_f64, f64::INFINITY);
                for axis in 0..3 {
                    let [s, t] = [-0.1, 0.1].map(|h| (b[axis] + h - eye[axis]) / d[axis]);
                    (near, far) = (near.max(s.min(t)), far.min(s.max(t)));
                }
                if near < far {
                    range = range.min(near);
                }
            }
            let noise: f64 = rng.sample(StandardNormal);
            let range = range + 0.002 * noise;
            parts.positions.push(std::array::from_fn(|i| (eye[i] + range * d[i]) as f32));
        }
    }
    let index = vec![0; parts.positions.len()];
    parts.viewpoints = Some(Viewpoints { origins: vec![eye], index });
    parts
}

fn cloud(parts: CloudParts) -> PointCloud {
    PointCloud::from_parts(parts).unwrap().0
}

fn options() -> BicAlphabetOptions {
    BicAlphabetOptions { iterations: 60, radius: 0.15, ..BicAlphabetOptions::default() }
}

#[test]
fn a_room_is_covered_by_few_words() {
    let cloud = cloud(room(0));
    let model = learn(&cloud, &BicAlphabetOptions { reduce: false, ..options() });
    assert!(figures(&model).inliers > 0.93, "{}", figures(&model).inliers);
    assert!(figures(&model).outliers < 0.1, "{}", figures(&model).outliers);
    // Flat, edge and corner, hardly any of them twice, for some hundred places of each.
    let words = model.alphabet().len();
    assert!((2..=6).contains(&words) && model.len() > 80 * words, "{words} at {}", model.len());
    assert_eq!(model.counts().iter().sum::<u64>(), model.len() as u64);
    let bytes: usize = model.alphabet().words().iter().map(|w| 12 * w.points.len()).sum();
    assert_eq!(figures(&model).paper_bytes, bytes + 28 * model.len());
    // The trace never rises.
    let (name, trace) = &model.report().objectives[0];
    assert_eq!((name.as_str(), trace.len()), ("bic", 60));
    assert!(trace.windows(2).all(|w| w[1] <= w[0]));
    assert_eq!(*trace.last().unwrap(), figures(&model).bic);
}

#[test]
fn decoded_points_keep_their_distance_and_are_those_measured() {
    let cloud = cloud(room(1));
    let model = learn(&cloud, &options());
    let decoded = decode(&model);
    let tree = KdTree::new(decoded.positions()).unwrap();
    let mut near = Vec::new();
    for &p in decoded.positions() {
        tree.k_nearest(p, 2, &mut near);
        assert!(near[1].squared_distance().sqrt() >= 0.03 - 1e-6);
    }
    // Inliers by their definition, with sigma at lambda 3 for the estimated resolution.
    let alpha = 0.035_f64;
    let angular_resolution = Some(alpha.to_degrees());
    let model = learn(&cloud, &BicAlphabetOptions { angular_resolution, ..options() });
    let tree = KdTree::new(decode(&model).positions()).unwrap();
    let inliers = cloud.positions().iter().filter(|p| {
        let range = [0.0, 0.0, 0.8_f64].iter().zip(*p).map(|(e, c)| (f64::from(*c) - e).powi(2));
        let sigma = 3.0 * (0.5 * alpha).tan() * range.sum::<f64>().sqrt();
        f64::from(tree.nearest(**p).unwrap().squared_distance()).sqrt() <= sigma
    });
    let share = inliers.count() as f64 / cloud.len() as f64;
    assert!((share - figures(&model).inliers_reduced.unwrap()).abs() < 2e-3, "{share}");
}

#[test]
fn an_alphabet_describes_another_scene() {
    let alphabet = learn(&cloud(room(2)), &options()).alphabet().clone();
    let model = alphabet.describe(&cloud(room(3)), &options(), &Silent).unwrap();
    assert_eq!(model.alphabet(), &alphabet);
    assert!(figures(&model).inliers > 0.9, "{}", figures(&model).inliers);
    let other = BicAlphabetOptions { radius: 0.2, ..options() };
    let found = alphabet.describe(&cloud(room(3)), &other, &Silent);
    assert!(matches!(found, Err(Error::Inconsistent(_))), "{found:?}");
}

#[test]
fn the_same_bytes_for_any_number_of_threads_and_any_order() {
    let parts = room(4);
    let cloud = cloud(parts.clone());
    let with = |n: usize, cloud: &PointCloud| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| learn(cloud, &options()).to_bytes().unwrap())
    };
    let one = with(1, &cloud);
    assert_eq!(one, with(2, &cloud));
    assert_eq!(one, with(8, &cloud));
    let mut turned = parts;
    turned.positions.reverse();
    assert_eq!(one, with(2, &PointCloud::from_parts(turned).unwrap().0));
}

#[test]
fn fewer_rejections_end_it_sooner() {
    let cloud = cloud(room(5));
    let model = learn(&cloud, &BicAlphabetOptions { max_rejections: 3, ..options() });
    assert_eq!(model.report().stop_reason, "max_rejections reached");
    let trace = &model.report().objectives[0].1;
    let n = trace.len();
    assert!(n < 60 && trace[n - 3..].iter().all(|b| *b == trace[n - 1]));
    // The same candidates in the same order, only not all of them.
    let full = learn(&cloud, &options());
    assert_eq!(trace[..], full.report().objectives[0].1[..n]);
}

#[test]
fn clouds_that_are_hardly_any_give_a_model_or_a_clear_error() {
    let empty = bic_alphabet::learn(&PointCloud::default(), &options(), &Silent);
    assert_eq!(empty, Err(Error::EmptyCloud));
    let line: Vec<[f32; 3]> = (0..200).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
    for points in [vec![[0.5; 3]], vec![[1.0; 3]; 50], vec![[0.0; 3], [3.0, 4.0, 5.0]], line] {
        let (cloud, _) = PointCloud::from_positions(points);
        for rule in [Upright::WorldX, Upright::WorldZ, Upright::ViewDirection] {
            let model = learn(&cloud, &BicAlphabetOptions { upright: rule, ..options() });
            let again: BicAlphabetModel = read(&model.to_bytes().unwrap()).unwrap();
            assert_eq!(decode(&again), decode(&model));
        }
    }
}

#[test]
fn huge_coordinates_keep_their_millimetres() {
    let near = cloud(room(6));
    let mut parts = near.clone().into_parts();
    let shift = [691_000.25, 5_334_000.5, 512.125];
    parts.origin = shift;
    let viewpoints = parts.viewpoints.as_mut().unwrap();
    viewpoints.origins[0] = std::array::from_fn(|a| viewpoints.origins[0][a] + shift[a]);
    let far = learn(&cloud(parts), &options());
    let near = learn(&near, &options());
    assert_eq!(decode(&far).positions(), decode(&near).positions());
    assert_eq!(decode(&far).origin(), shift);
}

#[test]
fn every_rule_of_what_is_up_comes_back() {
    for upright in [Upright::WorldX, Upright::WorldZ, Upright::ViewDirection] {
        let options =
            BicAlphabetOptions { upright, iterations: 20, ..BicAlphabetOptions::default() };
        let model = learn(&step(), &options);
        let again: BicAlphabetModel = read(&model.to_bytes().unwrap()).unwrap();
        assert_eq!(again, model);
        assert_eq!(again.alphabet().upright(), upright);
        assert_eq!(decode(&again), decode(&model));
    }
}

prop_compose! {
    fn any_model()(
        upright in prop::sample::select(vec![Upright::WorldX, Upright::WorldZ, Upright::ViewDirection]),
        words in prop::collection::vec(prop::collection::vec(prop::array::uniform3(-127_i8..=127), 1..20), 1..8),
        heights in prop::collection::vec(any::<i8>(), 4),
        poses in prop::collection::vec(
            (prop::array::uniform3(-3000_i32..3000), prop::array::uniform2(-127_i8..=127), any::<u8>(), any::<prop::sample::Index>()),
            0..60,
        ),
        origin in prop::array::uniform3(-1e7..1e7),
        n_points: u64,
    ) -> BicAlphabetModel {
        let shape = BicShape { radius: 0.1, descriptor_pixels: 2, upright };
        let words: Vec<BicWord> = words
            .into_iter()
            .map(|mut points| {
                points.sort_unstable();
                BicWord { points, descriptor: heights.clone() }
            })
            .collect();
        let alphabet = BicAlphabet::new(shape, words).unwrap();
        let low = [-94; 3];
        let mut all: Vec<(BicPose, u32)> = poses
            .into_iter()
            .map(|(position, normal, roll, word)| {
                let roll = if upright == Upright::ViewDirection { roll } else { 0 };
                (BicPose { position, normal, roll }, word.index(alphabet.len()) as u32)
            })
            .collect();
        let key = |p: &BicPose| {
            let cell = p.position.map(|c| u64::from((c.div_euclid(32) + 94) as u32));
            (surfabet::geom::morton::encode(cell), *p)
        };
        all.sort_by_key(|(p, _)| key(p));
        all.dedup_by_key(|(p, _)| *p);
        let (poses, words) = all.into_iter().unzip();
        let header = BicHeader { n_points, origin, epsilon: 0.02, low };
        BicAlphabetModel::new(header, alphabet, poses, words, false).unwrap()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_valid_model_comes_back(model in any_model()) {
        let bytes = model.to_bytes().unwrap();
        prop_assert_eq!(read::<BicAlphabetModel>(&bytes).unwrap(), model);
    }
}
