//! Alphabets by description length, on scenes whose surface is known exactly.
#![allow(missing_docs, clippy::unwrap_used)]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::alphabet;
use surfabet::geom::KdTree;
use surfabet::{
    Alphabet, AlphabetModel, AlphabetOptions, CloudParts, DecodeOptions, PointCloud, Save, Silent,
    Viewpoints,
};
use surfabet_models::Error;
use surfabet_tests::assert_stops_when_asked;
use surfabet_tests::files::read;
use surfabet_tests::scenes::windows;

/// Angle between the beams of the scanner below, radians.
const ALPHA: f64 = 0.03;

type Point = [f32; 3];

/// A box room of 4 x 3 x 2.5 m, scanned from its middle: distances along beams, with noise.
fn room(noise: f64, seed: u64) -> CloudParts {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let half = [2.0, 1.5, 1.25];
    let mut positions = Vec::new();
    let rows = (std::f64::consts::PI / ALPHA) as i32;
    for row in 1..rows {
        let elevation = f64::from(row) * ALPHA - 0.5 * std::f64::consts::PI;
        for column in 0..2 * rows {
            let azimuth = f64::from(column) * ALPHA + 0.3;
            let beam =
                [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
            let reach = (0..3).map(|a| half[a] / beam[a].abs()).fold(f64::INFINITY, f64::min);
            let off: f64 = rng.sample(StandardNormal);
            positions.push(beam.map(|c| (c * (reach + noise * off)) as f32));
        }
    }
    let viewpoints = Viewpoints { origins: vec![[0.0; 3]], index: vec![0; positions.len()] };
    CloudParts { positions, viewpoints: Some(viewpoints), ..CloudParts::default() }
}

fn cloud(parts: CloudParts) -> PointCloud {
    PointCloud::from_parts(parts).unwrap().0
}

fn options() -> AlphabetOptions {
    let angular_resolution = Some(ALPHA.to_degrees());
    AlphabetOptions { angular_resolution, noise: Some(0.0), ..AlphabetOptions::default() }
}

fn learn(cloud: &PointCloud, options: &AlphabetOptions) -> AlphabetModel {
    alphabet::learn(cloud, options, &Silent).unwrap()
}

fn decode(model: &AlphabetModel) -> PointCloud {
    model.decode(DecodeOptions::default(), &Silent).unwrap()
}

/// Shares of explained points and of decoded points that explain nothing (eq. 13).
fn inliers_outliers(cloud: &PointCloud, decoded: &PointCloud) -> (f64, f64) {
    let sigma = |p: &Point| {
        let range = p.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
        3.0 * (0.5 * ALPHA).tan() * range
    };
    let p = cloud.positions();
    let q = decoded.positions_about(cloud.origin());
    let [of_p, of_q] = [KdTree::new(p).unwrap(), KdTree::new(&q).unwrap()];
    let found = p
        .iter()
        .filter(|p| f64::from(of_q.nearest(**p).unwrap().squared_distance()).sqrt() <= sigma(p));
    let lone = q.iter().filter(|q| {
        let nearest = of_p.nearest(**q).unwrap();
        f64::from(nearest.squared_distance()).sqrt() > sigma(&p[nearest.index()])
    });
    (found.count() as f64 / p.len() as f64, lone.count() as f64 / q.len() as f64)
}

#[test]
fn a_scanned_room_is_a_handful_of_planes() {
    let scan = cloud(room(0.005, 0));
    let model = learn(&scan, &options());
    let decoded = decode(&model);
    let (inliers, outliers) = inliers_outliers(&scan, &decoded);
    assert!(inliers > 0.98, "{inliers}");
    assert!(outliers < 0.05, "{outliers}");
    // 59 square metres in words of up to 2.56: 23 at least, and as many again for the rims of each scale.
    assert!((23..100).contains(&model.len()), "{}", model.len());
    // Position, two slopes, offset and word of each in 3 to 8 bytes, the header included.
    let bytes = model.to_bytes().unwrap().len();
    assert!((3 * model.len()..8 * model.len()).contains(&bytes), "{bytes}");
    for o in model.occurrences() {
        let towards: f64 = (0..3).map(|a| -o.center[a] * o.rows[2][a]).sum();
        assert!(towards > 0.0, "{o:?} looks away from the sensor");
    }
}

#[test]
fn order_threads_and_duplicates_do_not_matter() {
    let parts = room(0.01, 1);
    let scan = cloud(parts.clone());
    let file = learn(&scan, &options()).to_bytes().unwrap();
    for n in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        assert_eq!(pool.install(|| learn(&scan, &options())).to_bytes().unwrap(), file);
    }
    let mut turned = parts.clone();
    turned.positions.reverse();
    assert_eq!(learn(&cloud(turned), &options()).to_bytes().unwrap(), file);
    let mut twice = parts;
    twice.positions.extend(twice.positions.clone());
    twice.viewpoints.as_mut().unwrap().index = vec![0; twice.positions.len()];
    let twice = learn(&cloud(twice), &options());
    assert_eq!(twice.n_points(), 2 * scan.len() as u64);
    let places = |m: &AlphabetModel| m.occurrences().map(|o| o.center).collect::<Vec<_>>();
    assert_eq!(places(&twice), places(&learn(&scan, &options())));
}

#[test]
fn far_from_the_origin_nothing_changes() {
    let near = room(0.005, 2);
    let mut far = near.clone();
    let origin = [500_000.0, 5_400_000.0, 300.0];
    far.origin = origin;
    far.viewpoints.as_mut().unwrap().origins = vec![origin];
    let [near, far] = [near, far].map(|parts| learn(&cloud(parts), &options()));
    assert_eq!(near.len(), far.len());
    for (a, b) in near.occurrences().zip(far.occurrences()) {
        for (k, shift) in origin.iter().enumerate() {
            assert!((a.center[k] + shift - b.center[k]).abs() < 1e-6);
        }
    }
}

fn fine() -> AlphabetOptions {
    let angular_resolution = Some(0.005_f64.to_degrees());
    AlphabetOptions { angular_resolution, noise: Some(0.0), ..AlphabetOptions::default() }
}

#[test]
fn what_recurs_becomes_words_and_pays() {
    let wall = windows(3, 24);
    let cost = |m: &AlphabetModel| *m.report().objectives[0].1.last().unwrap();
    let planes = learn(&wall, &AlphabetOptions { max_words: 0, ..fine() });
    let words = learn(&wall, &fine());
    assert_eq!(planes.alphabet().words().len(), 1);
    assert!(words.alphabet().words().len() > 1);
    assert!(cost(&words) < cost(&planes), "{} {}", cost(&words), cost(&planes));
    // Every word is used, the more frequent first.
    let mut counts = vec![0; words.alphabet().words().len()];
    words.occurrences().for_each(|o| counts[usize::from(o.word)] += 1);
    assert!(counts[1..].iter().all(|&n| n > 0), "{counts:?}");
}

#[test]
fn an_alphabet_describes_another_scene() {
    let learned = learn(&windows(3, 24), &fine());
    let other = windows(8, 24);
    let words = learned.alphabet();
    let described = alphabet::describe(&other, words, &fine(), &Silent).unwrap();
    assert!(described.shares_vocabulary());
    assert_eq!(described.alphabet(), words);
    let cost = |m: &AlphabetModel| *m.report().objectives[0].1.last().unwrap();
    let plane = Alphabet::plane(words.radius(), words.scales()).unwrap();
    let by_planes = alphabet::describe(&other, &plane, &fine(), &Silent).unwrap();
    assert!(cost(&described) < cost(&by_planes));
}

#[test]
fn colour_and_intensity_come_back_as_means() {
    let mut parts = room(0.0, 4);
    let of = |p: &Point| if p[0] > 1.99 { ([200, 50, 20], 0.8) } else { ([30, 90, 160], 0.2) };
    parts.colors = Some(parts.positions.iter().map(|p| of(p).0).collect());
    parts.intensities = Some(parts.positions.iter().map(|p| of(p).1).collect());
    let model = learn(&cloud(parts), &options());
    let decoded = decode(&model);
    let [mut right, mut all] = [0, 0];
    let channels = decoded.colors().unwrap().iter().zip(decoded.intensities().unwrap());
    for (p, (color, intensity)) in decoded.positions_about([0.0; 3]).iter().zip(channels) {
        // Away from the edges of the one wall, where words see both colours.
        if p[0] > 1.9 && p[1].abs() < 1.0 && p[2].abs() < 0.8 {
            all += 1;
            let near = (0..3).all(|c| color[c].abs_diff([200, 50, 20][c]) <= 12);
            right += i32::from(near && (intensity - 0.8).abs() < 0.02);
        }
    }
    assert!(all > 100 && f64::from(right) > 0.9 * f64::from(all), "{right} of {all}");
}

#[test]
fn degenerate_clouds_give_an_answer_or_an_error() {
    let of = |positions: Vec<Point>| {
        let (cloud, _) = PointCloud::from_positions(positions);
        alphabet::learn(&cloud, &AlphabetOptions::default(), &Silent)
    };
    assert!(matches!(of(vec![]), Err(Error::EmptyCloud)));
    assert!(matches!(of(vec![[f32::NAN; 3]; 5]), Err(Error::EmptyCloud)));
    let line = (0..500).map(|i| [i as f32 * 0.01; 3]).collect();
    let far = vec![[0.0; 3], [1e7, 0.0, 0.0]];
    for positions in [vec![[1.0, 2.0, 3.0]], vec![[0.5; 3]; 100], line] {
        let model = of(positions).unwrap();
        assert_eq!(read::<AlphabetModel>(&model.to_bytes().unwrap()).unwrap(), model);
    }
    // Sigma follows the spacing, and the radius sigma: even these two have their cells.
    assert!(of(far).is_ok());
    let (pair, _) = PointCloud::from_positions(vec![[0.0; 3], [1e7, 0.0, 0.0]]);
    let small = AlphabetOptions { radius: Some(0.1), ..AlphabetOptions::default() };
    let found = alphabet::learn(&pair, &small, &Silent);
    assert!(matches!(found, Err(Error::InvalidParameter(error)) if error.name == "radius"));
}

#[test]
fn stops_when_asked_to() {
    let scan = windows(6, 6);
    let asked = assert_stops_when_asked(|progress| alphabet::learn(&scan, &fine(), progress));
    // In two passes of improvement, every occurrence is one question before its variants and one after.
    let occurrences = learn(&scan, &fine()).len();
    assert!(asked > 4 * occurrences, "{asked} for {occurrences}");
}
