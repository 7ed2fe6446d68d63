//! Lattice patches on scenes whose surface is known exactly, and their files.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::BTreeSet;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::geom::KdTree;
use surfabet::patches;
use surfabet::{
    CloudParts, DecodeOptions, PatchModel, PatchesOptions, PointCloud, Save, Silent, Viewpoints,
};
use surfabet_codec::Features;
use surfabet_models::Error;
use surfabet_tests::files::{codec_error, put_together, read, sections};

const PIXEL: f64 = 0.01;

type Point = [f32; 3];

/// Pixels of one centimetre, and nothing beside the patches.
fn options() -> PatchesOptions {
    PatchesOptions { resolution: Some(PIXEL), completeness: 0.0, ..PatchesOptions::default() }
}

fn learn(cloud: &PointCloud, options: &PatchesOptions) -> PatchModel {
    patches::learn(cloud, options, &Silent).unwrap()
}

fn plain(points: Vec<Point>) -> PointCloud {
    PointCloud::from_positions(points).0
}

fn bytes(model: &PatchModel) -> Vec<u8> {
    model.to_bytes().unwrap()
}

fn decode(model: &PatchModel, resolution: f64, as_measured: bool) -> PointCloud {
    let options =
        DecodeOptions { resolution: Some(resolution), as_measured, ..DecodeOptions::default() };
    model.decode(options, &Silent).unwrap()
}

/// Colours of the walls of [`corner`], by the axis that each stands across.
const COLORS: [[u8; 3]; 3] = [[200, 60, 40], [40, 180, 60], [60, 60, 200]];

/// A room corner: floor and two walls of 1.2 m, turned by some angle, a point every 4 mm, with noise along the
/// normal. With it the distances of a point to the three.
fn corner(noise: f64, turn: f32, seed: u64) -> (PointCloud, impl Fn(Point) -> [f32; 3]) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (sine, cosine) = turn.sin_cos();
    let rotate = move |p: Point| [cosine * p[0] - sine * p[1], sine * p[0] + cosine * p[1], p[2]];
    let back = move |p: Point| [cosine * p[0] + sine * p[1], cosine * p[1] - sine * p[0], p[2]];
    let mut parts = CloudParts::default();
    let mut colors = Vec::new();
    for i in 0..300 {
        for j in 0..300 {
            let (a, b) = (i as f32 * 0.004, j as f32 * 0.004);
            for (axis, color) in COLORS.into_iter().enumerate() {
                let off: f64 = rng.sample(StandardNormal);
                let mut p = [0.0; 3];
                p[axis] = (noise * off) as f32;
                p[(axis + 1) % 3] = a;
                p[(axis + 2) % 3] = b;
                parts.positions.push(rotate(p));
                colors.push(color);
            }
        }
    }
    parts.colors = Some(colors);
    let distances = move |p: Point| {
        let p = back(p);
        std::array::from_fn(|axis| {
            let outside = |c: f32| (c - c.clamp(0.0, 1.196)).powi(2);
            let across = outside(p[(axis + 1) % 3]) + outside(p[(axis + 2) % 3]);
            (p[axis] * p[axis] + across).sqrt()
        })
    };
    (PointCloud::from_parts(parts).unwrap().0, distances)
}

fn least(distances: [f32; 3]) -> f32 {
    distances.into_iter().fold(f32::INFINITY, f32::min)
}

fn rms(values: impl Iterator<Item = f32>) -> f64 {
    let squares: Vec<f64> = values.map(|v| f64::from(v).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn rms_to(cloud: &PointCloud, other: &PointCloud) -> f64 {
    let tree = KdTree::new(other.positions()).unwrap();
    rms(cloud.positions().iter().map(|&p| tree.nearest(p).unwrap().squared_distance().sqrt()))
}

#[test]
fn a_turned_corner_without_noise_comes_back_within_a_quarter_pixel() {
    let (cloud, distances) = corner(0.0, 0.4, 0);
    let model = learn(&cloud, &options());
    let decoded = decode(&model, 0.005, false);
    let off = rms(decoded.positions().iter().map(|&p| least(distances(p))));
    assert!(off < 0.25 * PIXEL, "{off}");
    // Points half a pixel apart are up to a quarter of one from the next along each of two axes, evenly: a sixth of
    // half a pixel's square, and the surface's own error.
    let sampling = 0.5 * PIXEL / 6.0_f64.sqrt();
    let found = rms_to(&cloud, &decoded);
    assert!((sampling..sampling + 0.25 * PIXEL).contains(&found), "{found} {sampling}");
    // Three planes of 1.44 m2 in squares of 16 cm: 56 each, and some at the rims.
    assert!((168..240).contains(&model.len()), "{}", model.len());
    // Away from the corner's edges every point has the colour of its wall, but for what is left out of coefficients that reach
    // over an edge, 10 cells away: of blocks of 8 x 8 cells and more. With a step of s = 100 a bit must save 0.15 s^2, so a
    // coefficient of 8 bits is left out up to sqrt(1.2) s, which is 13.7 in each of the cells.
    let (mut worst, mut n) = (0, 0);
    for (p, c) in decoded.positions().iter().zip(decoded.colors().unwrap()) {
        let distances = distances(*p);
        for axis in 0..3 {
            let [next, last] = [distances[(axis + 1) % 3], distances[(axis + 2) % 3]];
            if distances[axis] < 0.02 && next.min(last) > 0.2 {
                n += 1;
                let off = |k: usize| c[k].abs_diff(COLORS[axis][k]);
                worst = worst.max((0..3).map(off).max().unwrap());
            }
        }
    }
    assert!(n > decoded.len() / 2 && worst <= 13, "{worst} at {n} of {}", decoded.len());
}

#[test]
fn the_surface_is_nearer_to_the_truth_than_the_scan_and_the_filled_one_nearer_to_the_scan() {
    let noise = 0.008;
    let (cloud, distances) = corner(noise, 0.3, 1);
    let model = learn(&cloud, &options());
    let of_input = rms(cloud.positions().iter().map(|&p| least(distances(p))));
    let surface = decode(&model, 0.005, false);
    let of_surface = rms(surface.positions().iter().map(|&p| least(distances(p))));
    assert!(of_surface < 0.5 * of_input, "{of_surface} {of_input}");
    let filled = decode(&model, 0.005, true);
    assert!(filled.len() > surface.len());
    assert!(rms_to(&cloud, &filled) < 0.75 * rms_to(&cloud, &surface));
    // The thickness is that of a slab with the noise's variance, rounded to quarter pixels (18 percent of this one), and
    // to the thin side, since errors of decoded points count double.
    let (mut sum, mut area) = (0.0, 0.0);
    for leaf in model.leaves() {
        let pixel = model.lattice().pixel_of(leaf.level);
        let weight = f64::from(leaf.patch.mask.count_ones()) * pixel * pixel;
        sum += weight * f64::from(leaf.patch.thickness) * 0.25 * PIXEL / 3.0_f64.sqrt();
        area += weight;
    }
    assert!((0.7..1.0).contains(&(sum / area / noise)), "{} {noise}", sum / area);
}

#[test]
fn seams_do_not_open() {
    let (cloud, _) = corner(0.003, 0.0, 2);
    let model = learn(&cloud, &options());
    let decoded = decode(&model, 0.0025, false);
    let tree = KdTree::new(decoded.positions()).unwrap();
    // Points of the exact floor, away from its rim, across all seams.
    let holes = (0..200)
        .flat_map(|i| (0..200).map(move |j| (i, j)))
        .filter(|&(i, j)| {
            let p = [0.05 + i as f32 * 0.0055, 0.05 + j as f32 * 0.0055, 0.0];
            tree.nearest(p).unwrap().squared_distance().sqrt() > 0.005
        })
        .count();
    assert!(holes <= 40, "{holes} of 40000 places have no decoded point within 5 mm");
}

#[test]
fn every_surface_point_belongs_to_one_patch() {
    let (cloud, _) = corner(0.004, 0.2, 3);
    let model = learn(&cloud, &options());
    let mut area = 0.0;
    for leaf in model.leaves() {
        let pixel = model.lattice().pixel_of(leaf.level);
        area += f64::from(leaf.patch.mask.count_ones()) * pixel.powi(2);
    }
    // Three squares of 1.2 m; rims and edges, four of 1.2 m each, may add or lose a pixel.
    let exact = 3.0 * 1.2 * 1.2;
    assert!((area - exact).abs() < 12.0 * 1.2 * PIXEL, "{area} {exact}");
}

#[test]
fn both_faces_of_a_thin_wall_stay_apart_when_seen_from_both_sides() {
    let mut parts = CloudParts::default();
    let mut index = Vec::new();
    for i in 0..160 {
        for j in 0..160 {
            for face in 0..2 {
                let z = face as f32 * 0.012;
                parts.positions.push([i as f32 * 0.005, j as f32 * 0.005, z]);
                index.push(face);
            }
        }
    }
    let origins = vec![[0.4, 0.4, -2.0], [0.4, 0.4, 2.0]];
    parts.viewpoints = Some(Viewpoints { origins, index });
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let model = learn(&cloud, &options());
    let decoded = decode(&model, 0.005, false);
    let of = |z: f32| decoded.positions().iter().filter(|p| (p[2] - z).abs() < 0.003).count();
    let n = decoded.len();
    assert!(of(0.0) > 2 * n / 5 && of(0.012) > 2 * n / 5, "{} {} {n}", of(0.0), of(0.012));
}

#[test]
fn normals_point_to_where_the_surface_was_seen_from() {
    let mut parts = CloudParts::default();
    for i in 0..100 {
        for j in 0..100 {
            let (x, y) = (i as f32 * 0.005, j as f32 * 0.005);
            parts.positions.push([x, y, 0.2 * x]);
        }
    }
    let index = vec![0; parts.positions.len()];
    parts.viewpoints = Some(Viewpoints { origins: vec![[0.25, 0.25, -3.0]], index });
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let with_normals = DecodeOptions { normals: true, ..DecodeOptions::default() };
    let decoded = learn(&cloud, &options()).decode(with_normals, &Silent).unwrap();
    let length = (1.0_f32 + 0.04).sqrt();
    for n in decoded.normals().unwrap() {
        let along = (0.2 * n[0] - n[2]) / length;
        assert!(along > 0.97, "{n:?}");
    }
}

#[test]
fn the_bound_holds_for_every_input_point() {
    let (cloud, _) = corner(0.01, 0.7, 4);
    let mut parts = cloud.into_parts();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..50 {
        parts.positions.push(std::array::from_fn(|_| rng.random_range(-1.0..2.0)));
        parts.colors.as_mut().unwrap().push([255, 255, 0]);
    }
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let free = learn(&cloud, &options());
    for bound in [0.05, 0.02] {
        let options = PatchesOptions { max_error: Some(bound), ..options() };
        let model = learn(&cloud, &options);
        assert_eq!(model.max_error(), Some(bound));
        let again: PatchModel = read(&bytes(&model)).unwrap();
        assert_eq!(again.max_error(), Some(bound));
        let options = DecodeOptions { as_measured: true, ..DecodeOptions::default() };
        let decoded = again.decode(options, &Silent).unwrap();
        let tree = KdTree::new(decoded.positions()).unwrap();
        let largest = cloud
            .positions()
            .iter()
            .map(|&p| tree.nearest(p).unwrap().squared_distance().sqrt())
            .fold(0.0, f32::max);
        assert!(f64::from(largest) <= bound, "{largest} {bound}");
        assert!(!model.points().is_empty());
        assert!(bytes(&model).len() > bytes(&free).len());
    }
}

#[test]
fn patches_follow_the_input_where_points_beside_them_would_cost_more() {
    // Waves three pixels deep and a pixel high: without a bound the patches smooth them.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut points = Vec::new();
    for i in 0..300 {
        for j in 0..300 {
            let (x, y) = (i as f32 * 0.004, j as f32 * 0.004);
            let off: f64 = rng.sample(StandardNormal);
            let wave = 0.01 * (x / 0.02).sin() * (y / 0.03).sin();
            points.push([x, y, wave + 0.0005 * off as f32]);
        }
    }
    let cloud = plain(points);
    let bound = 0.007;
    let free = learn(&cloud, &options());
    let tree = KdTree::new(decode(&free, 0.5 * PIXEL, true).positions()).unwrap();
    let is_far =
        |p: &&Point| f64::from(tree.nearest(**p).unwrap().squared_distance()).sqrt() > bound;
    // Points would have to stand for all that is far: cells whose corners are twice the bound apart.
    let cell =
        |p: &Point| p.map(|c| (f64::from(c) / (2.0 * bound / 3.0_f64.sqrt())).floor() as i64);
    let needed: BTreeSet<[i64; 3]> = cloud.positions().iter().filter(is_far).map(cell).collect();
    let bounded = learn(&cloud, &PatchesOptions { max_error: Some(bound), ..options() });
    let kept = bounded.header().n_extra as usize;
    assert!(needed.len() > 500 && 10 * kept < needed.len(), "{kept} of {}", needed.len());
    // A point is no cheaper than two bits here.
    let all_points = bytes(&free).len() + needed.len() / 4;
    assert!(bytes(&bounded).len() < all_points, "{} {all_points}", bytes(&bounded).len());
}

#[test]
fn the_bound_forward_holds_for_every_decoded_point() {
    // Noise thickens the corner, and a sparse strip beside it invites patches to fill it.
    let (cloud, _) = corner(0.01, 0.7, 4);
    let mut parts = cloud.into_parts();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..300 {
        parts.positions.push([rng.random_range(0.7..1.1), rng.random_range(0.0..0.7), 0.0]);
        parts.colors.as_mut().unwrap().push([255, 255, 0]);
    }
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let input = KdTree::new(cloud.positions()).unwrap();
    let largest = |tree: &KdTree, positions: &[[f32; 3]]| {
        let of = |&p: &[f32; 3]| tree.nearest(p).unwrap().squared_distance().sqrt();
        f64::from(positions.iter().map(of).fold(0.0, f32::max))
    };
    let decoded = |model: &PatchModel, as_measured: bool| {
        let options = DecodeOptions { as_measured, ..DecodeOptions::default() };
        model.decode(options, &Silent).unwrap()
    };
    let free = decoded(&learn(&cloud, &options()), true);
    for bound in [0.02, 0.012] {
        assert!(largest(&input, free.positions()) > bound);
        let options =
            PatchesOptions { max_error: Some(0.03), max_error_forward: Some(bound), ..options() };
        let model = learn(&cloud, &options);
        let again: PatchModel = read(&bytes(&model)).unwrap();
        assert_eq!(again.max_error_forward(), Some(bound));
        for as_measured in [true, false] {
            let found = largest(&input, decoded(&again, as_measured).positions());
            assert!(found <= bound, "{found} {bound} {as_measured}");
        }
        let measured = decoded(&again, true);
        let backward = largest(&KdTree::new(measured.positions()).unwrap(), cloud.positions());
        assert!(backward <= 0.03, "{backward}");
        // Patches are left, not only points beside them.
        assert!(!model.is_empty());
    }
}

#[test]
fn blended_colors_are_those_of_the_samples() {
    // Waves of luma: means over cells, blended, would flatten them.
    let mut parts = CloudParts::default();
    let gray = |x: f32| (127.5 + 100.0 * (x * std::f32::consts::TAU / 0.1).sin()) as u8;
    for i in 0..250 {
        for j in 0..120 {
            let (x, y) = (i as f32 * 0.004, j as f32 * 0.004);
            parts.positions.push([x, y, 0.0]);
            parts.colors.get_or_insert_default().push([gray(x); 3]);
        }
    }
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let options = PatchesOptions { color_step: 4, color_rate: 0.01, ..options() };
    let model = learn(&cloud, &options);
    let decoded = model.decode(DecodeOptions::default(), &Silent).unwrap();
    let (mut sum, mut n) = (0.0, 0.0);
    for (p, color) in decoded.positions().iter().zip(decoded.colors().unwrap()) {
        sum += (f32::from(color[0]) - f32::from(gray(p[0]))).powi(2);
        n += 1.0;
    }
    // Cells of s = 0.02 in waves of w = 0.1: the mean over a cell keeps f = sinc(s / w) = 0.935 of the amplitude of 100, linear
    // blending f^2 of that. Means alone would be off by (1 - f^3) 100 / sqrt(2) = 13 grey levels. One step of back projection
    // adds f^4 of what is missed: 3 are left, and the rounding of colours to whole numbers.
    let rmse = (sum / n).sqrt();
    assert!(rmse < 6.0, "{rmse}");
}

/// The codings of attributes exclude one another, and none reads what another wrote as its own.
#[test]
fn attributes_are_coded_in_one_way() {
    let model = learn(&corner(0.003, 0.3, 1).0, &options());
    let file = bytes(&model);
    let parts = sections(&file);
    assert_eq!(put_together::<PatchModel>(Features::ESTIMATES, &parts), file);
    for other in [Features::BESIDE, Features::WHOLE_FIELDS] {
        let both = Features::ESTIMATES.with(other);
        let error = codec_error::<PatchModel>(&put_together::<PatchModel>(both, &parts));
        assert!(error.to_string().contains("two ways to code attributes"), "{error}");
        // Without checks of their content the streams of one coding may be some of the other's.
        if let Ok(other) = read::<PatchModel>(&put_together::<PatchModel>(other, &parts)) {
            assert_ne!(other, model);
        }
    }
}

#[test]
fn many_tasks_give_the_same_on_any_number_of_threads() {
    let (cloud, _) = corner(0.008, 0.5, 5);
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| bytes(&learn(&cloud, &options())))
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(8));
}

#[test]
fn coarser_pixels_make_smaller_files_of_larger_error() {
    let (cloud, _) = corner(0.006, 0.1, 6);
    let sizes: Vec<(usize, f64)> = [0.01, 0.02, 0.04]
        .into_iter()
        .map(|resolution| {
            let model =
                learn(&cloud, &PatchesOptions { resolution: Some(resolution), ..options() });
            (bytes(&model).len(), rms_to(&cloud, &decode(&model, resolution / 2.0, true)))
        })
        .collect();
    assert!(sizes.windows(2).all(|w| w[0].0 > w[1].0 && w[0].1 < w[1].1), "{sizes:?}");
}

#[test]
fn bytes_of_a_fixed_scene_stay() {
    // A change of the coder shows here, for better or worse: 270 000 noisy points of three walls. Another last bit of
    // a sine may move a symbol or two.
    let (cloud, _) = corner(0.008, 0.5, 5);
    let size = bytes(&learn(&cloud, &options())).len();
    assert!(size.abs_diff(728) <= 7, "{size} bytes");
}

#[test]
fn clouds_that_are_hardly_any_give_a_model_or_a_clear_error() {
    assert_eq!(patches::learn(&PointCloud::default(), &options(), &Silent), Err(Error::EmptyCloud));
    let line = (0..200).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
    let two = vec![[0.0, 0.0, 0.0], [3.0, 4.0, 5.0]];
    let same = vec![[1.0, 2.0, 3.0]; 100];
    for points in [vec![[0.5, 0.5, 0.5]], line, two, same] {
        let cloud = plain(points);
        let model = learn(&cloud, &options());
        let decoded = decode(&model, 0.005, false);
        // What is less than an area may get the pixels of the coarsest level.
        assert!(rms_to(&cloud, &decoded) < 2.0 * PIXEL, "{} points", cloud.len());
        assert!(decoded.colors().is_none());
        let again: PatchModel = read(&bytes(&model)).unwrap();
        assert_eq!(again.leaves(), model.leaves());
    }
}

#[test]
fn huge_coordinates_keep_their_millimetres() {
    let (near, _) = corner(0.0, 0.0, 7);
    let mut parts = near.clone().into_parts();
    parts.origin = [691_000.25, 5_334_000.5, 512.125];
    let far = PointCloud::from_parts(parts).unwrap().0;
    let (a, b) = (learn(&near, &options()), learn(&far, &options()));
    let (a, b) = (decode(&a, 0.005, false), decode(&b, 0.005, false));
    assert_eq!(a.positions(), b.positions());
    assert_eq!(b.origin(), far.origin());
}

#[test]
fn a_scene_too_large_for_its_pixels_is_refused() {
    let cloud = plain(vec![[0.0; 3], [900.0, 0.0, 0.0]]);
    let options = PatchesOptions { resolution: Some(1e-4), ..options() };
    let found = patches::learn(&cloud, &options, &Silent);
    assert!(matches!(found, Err(Error::InvalidParameter(error)) if error.name == "resolution"));
}
