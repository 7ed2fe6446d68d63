//! The patches family on scenes whose surface is known exactly.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::geom::KdTree;
use surfabet::hscsm::{self, Placement};
use surfabet::{
    CloudParts, DecodeOptions, HscsmModel, HscsmOptions, PointCloud, Save, Sensor, Silent,
    Viewpoints,
};
use surfabet_models::Error;
use surfabet_tests::files::read;

/// Side of a pixel in all tests that do not say otherwise, metres.
const PIXEL: f64 = 0.01;

type Point = [f32; 3];

fn dot(a: Point, b: Point) -> f32 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[i] - b[i])
}

fn unit(v: Point) -> Point {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

/// A flat rectangle from a corner along two perpendicular sides.
#[derive(Clone, Copy)]
struct Rectangle {
    corner: Point,
    sides: [Point; 2],
}

impl Rectangle {
    fn normal(&self) -> Point {
        let [a, b] = self.sides;
        unit([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    }

    fn at(&self, u: f32, v: f32) -> Point {
        std::array::from_fn(|i| self.corner[i] + u * self.sides[0][i] + v * self.sides[1][i])
    }

    /// A grid of points `spacing` apart, those at the rim half a spacing inside.
    fn points(&self, spacing: f32) -> Vec<Point> {
        let counts = self.sides.map(|s| (dot(s, s).sqrt() / spacing).round() as usize);
        let part = |i: usize, n: usize| (i as f32 + 0.5) / n as f32;
        (0..counts[0] * counts[1])
            .map(|i| self.at(part(i % counts[0], counts[0]), part(i / counts[0], counts[1])))
            .collect()
    }

    fn distance(&self, p: Point) -> f32 {
        let d = sub(p, self.corner);
        let [u, v] = self.sides.map(|s| (dot(d, s) / dot(s, s)).clamp(0.0, 1.0));
        let rest = sub(p, self.at(u, v));
        dot(rest, rest).sqrt()
    }
}

fn rectangle(corner: Point, u: Point, v: Point) -> Rectangle {
    Rectangle { corner, sides: [u, v] }
}

/// A square of 0.6 m that lies askew to all axes.
fn tilted() -> Rectangle {
    let x = unit([0.9, 0.3, -0.2]);
    let n = unit([0.3, -0.2, 1.05]);
    let x = unit(sub(x, n.map(|c| c * dot(x, n))));
    let y = [n[1] * x[2] - n[2] * x[1], n[2] * x[0] - n[0] * x[2], n[0] * x[1] - n[1] * x[0]];
    rectangle([0.4, -0.7, 1.1], x.map(|c| 0.6 * c), y.map(|c| 0.6 * c))
}

fn cloud(positions: Vec<Point>) -> PointCloud {
    PointCloud::from_positions(positions).0
}

/// Points of rectangles, those of each seen from one metre in front of its middle.
fn seen_from_front(rectangles: &[Rectangle], spacing: f32) -> PointCloud {
    let mut parts = CloudParts::default();
    let mut viewpoints = Viewpoints::default();
    for (i, r) in rectangles.iter().enumerate() {
        let points = r.points(spacing);
        let (middle, normal) = (r.at(0.5, 0.5), r.normal());
        viewpoints.origins.push(std::array::from_fn(|a| f64::from(middle[a] + normal[a])));
        viewpoints.index.extend(std::iter::repeat_n(i as u32, points.len()));
        parts.positions.extend(points);
    }
    parts.viewpoints = Some(viewpoints);
    PointCloud::from_parts(parts).unwrap().0
}

fn points_of(rectangles: &[Rectangle], spacing: f32) -> PointCloud {
    cloud(rectangles.iter().flat_map(|r| r.points(spacing)).collect())
}

/// Points spread evenly over a sphere about zero: a Fibonacci lattice.
fn sphere(radius: f32, count: usize) -> Vec<Point> {
    let turn = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), turn * i as f64);
            [r * angle.cos(), r * angle.sin(), z].map(|c| c as f32 * radius)
        })
        .collect()
}

fn options() -> HscsmOptions {
    HscsmOptions { resolution: Some(PIXEL), levels: 1, iterations: 3, ..HscsmOptions::default() }
}

fn learn(cloud: &PointCloud) -> HscsmModel {
    hscsm::learn(cloud, &options(), &Silent).unwrap()
}

fn decode(model: &HscsmModel, resolution: Option<f64>) -> PointCloud {
    model.decode(DecodeOptions { resolution, ..DecodeOptions::default() }, &Silent).unwrap()
}

/// Distance from each point of one list to the nearest of the other.
fn nearest(from: &[Point], to: &[Point]) -> Vec<f64> {
    let tree = KdTree::new(to).unwrap();
    let found = tree.nearest_batch(from, &Silent).unwrap();
    found.iter().map(|n| f64::from(n.squared_distance()).sqrt()).collect()
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for v in values {
        sum += v * v;
        count += 1.0;
    }
    f64::sqrt(sum / count)
}

/// Distances of decoded points to the nearest of the rectangles that they should lie on.
fn to_surface(decoded: &PointCloud, rectangles: &[Rectangle]) -> Vec<f64> {
    let distance = |p: &Point| rectangles.iter().map(|r| r.distance(*p)).fold(f32::MAX, f32::min);
    decoded.positions().iter().map(|p| f64::from(distance(p))).collect()
}

fn assert_all_owned(model: &HscsmModel) {
    let figures = model.report().figures.unwrap();
    assert!(figures.samples > 0);
    assert_eq!(figures.samples, figures.samples_covered);
}

/// Checks full coverage: every sample owned, every input point close to a decoded one.
fn assert_covered(input: &PointCloud, model: &HscsmModel) {
    assert_all_owned(model);
    let decoded = decode(model, None);
    assert_eq!(decoded.origin(), input.origin());
    let far = largest(nearest(input.positions(), decoded.positions()));
    assert!(far < 1.5 * PIXEL, "{far}");
}

#[test]
fn a_plane_is_covered_without_holes() {
    let plane = tilted();
    let input = points_of(&[plane], 0.004);
    let model = learn(&input);
    assert_covered(&input, &model);

    let decoded = decode(&model, Some(0.5 * PIXEL));
    // Half a step of the stored mean (1 mm), and the tilt of a stored normal at the rim (1.3 mm).
    let off = decoded.positions().iter().map(|p| dot(sub(*p, plane.corner), plane.normal()));
    let off = largest(off.map(|d| f64::from(d.abs())));
    assert!(off < 0.3 * PIXEL, "{off}");
    // Flat on the plane, so that only lateral distances count.
    let flat = |p: &Point| {
        let d = dot(sub(*p, plane.corner), plane.normal());
        let n = plane.normal();
        std::array::from_fn(|i| p[i] - d * n[i])
    };
    let lateral: Vec<Point> = decoded.positions().iter().map(flat).collect();
    let hole = largest(nearest(&plane.points(0.003), &lateral));
    assert!(hole < 0.75 * PIXEL, "{hole}");
}

#[test]
fn both_faces_of_a_thin_wall_stay_where_they_are() {
    // 8 mm apart, less than a pixel, each seen from its own side.
    let front = rectangle([0.0, 0.0, 0.004], [0.5, 0.0, 0.0], [0.0, 0.4, 0.0]);
    let back = rectangle([0.0, 0.0, -0.004], [0.0, 0.4, 0.0], [0.5, 0.0, 0.0]);
    assert!(front.normal()[2] > 0.99 && back.normal()[2] < -0.99);
    let input = seen_from_front(&[front, back], 0.004);
    let model = learn(&input);
    assert_covered(&input, &model);
    let decoded = decode(&model, None);
    for sheet in [front, back] {
        let near = |p: &Point| (p[2] - sheet.corner[2]).abs() < 0.0015;
        let points: Vec<Point> = decoded.positions().iter().copied().filter(near).collect();
        let hole = largest(nearest(&sheet.points(0.004), &points));
        assert!(hole < PIXEL, "{hole}");
    }
    // The last pixels of a patch may reach past the rim of the sheet, so across the sheets alone.
    let across = decoded.positions().iter().map(|p| f64::from((p[2].abs() - 0.004).abs()));
    let across = largest(across);
    assert!(across < 0.0015, "{across}");
}

#[test]
fn sheets_apart_by_more_than_two_pixels_need_no_viewpoints() {
    let sheets = [0.0, 0.025].map(|z| rectangle([0.0, 0.0, z], [0.5, 0.0, 0.0], [0.0, 0.4, 0.0]));
    let input = points_of(&sheets, 0.004);
    let model = learn(&input);
    assert_covered(&input, &model);
    let decoded = decode(&model, None);
    let off =
        || decoded.positions().iter().map(|p| f64::from(p[2].abs().min((p[2] - 0.025).abs())));
    let (rms, worst) = (root_mean_square(off()), largest(off()));
    let strays = off().filter(|d| *d > 0.0015).count() as f64 / decoded.len() as f64;
    // A mean of both sheets would be 12.5 mm away from either.
    assert!(rms < 0.0015 && worst < PIXEL, "{rms} rms, {worst} at worst");
    assert!(strays < 0.05, "{strays} off by more than 1.5 mm");
}

#[test]
fn a_table_top_keeps_top_edge_and_underside() {
    // 3 cm thick, with one edge.
    let top = rectangle([0.0, 0.0, 0.7], [0.6, 0.0, 0.0], [0.0, 0.4, 0.0]);
    let underside = rectangle([0.0, 0.0, 0.67], [0.0, 0.4, 0.0], [0.6, 0.0, 0.0]);
    let edge = rectangle([0.6, 0.0, 0.67], [0.0, 0.4, 0.0], [0.0, 0.0, 0.03]);
    let all = [top, underside, edge];
    for input in [points_of(&all, 0.004), seen_from_front(&all, 0.004)] {
        let model = learn(&input);
        assert_covered(&input, &model);
        let errors = to_surface(&decode(&model, None), &all);
        let rms = root_mean_square(errors.iter().copied());
        assert!(rms < 0.3 * PIXEL, "{rms}");
        // Nothing in the middle between the faces.
        let worst = largest(errors);
        assert!(worst < PIXEL, "{worst}");
    }
}

#[test]
fn corners_are_not_cut() {
    let floor = rectangle([0.0; 3], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    let left = rectangle([0.0; 3], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]);
    let right = rectangle([0.0; 3], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0]);
    for walls in [&[floor, left][..], &[floor, left, right]] {
        for input in [points_of(walls, 0.004), seen_from_front(walls, 0.004)] {
            let model = learn(&input);
            assert_covered(&input, &model);
            let rms = root_mean_square(to_surface(&decode(&model, None), walls));
            assert!(rms < 0.3 * PIXEL, "{rms} at {} walls", walls.len());
        }
    }
}

/// A level square measured twice: at z = 0, and `offset` above it.
fn measured_twice(offset: f32, ranges: Option<[f32; 2]>) -> PointCloud {
    let square = rectangle([0.0; 3], [0.4, 0.0, 0.0], [0.0, 0.4, 0.0]);
    let low = square.points(0.005);
    let n = low.len();
    let mut positions = low.clone();
    positions.extend(low.iter().map(|p| [p[0], p[1], p[2] + offset]));
    let ranges = ranges.map(|r| (0..2 * n).map(|i| r[i / n]).collect());
    PointCloud::from_parts(CloudParts { positions, ranges, ..CloudParts::default() }).unwrap().0
}

#[test]
fn pixels_are_means_weighted_by_the_sensor() {
    let offset = 0.006;
    let precise = HscsmOptions { depth_tolerance: Some(0.0002), ..options() };
    let constant = HscsmOptions { sensor: Sensor::Constant, ..precise.clone() };
    let sensor = Sensor::StructuredLight;
    let (near, far) = (sensor.weight(0.5), sensor.weight(1.0));
    for (ranges, options, expected) in [
        (Some([0.5, 1.0]), &precise, offset * far / (near + far)),
        (Some([1.0, 0.5]), &precise, offset * near / (near + far)),
        (Some([0.5, 1.0]), &constant, 0.5 * offset),
        (None, &precise, 0.5 * offset),
    ] {
        let input = measured_twice(offset, ranges);
        let model = hscsm::learn(&input, options, &Silent).unwrap();
        assert_all_owned(&model);
        let decoded = decode(&model, None);
        let off = decoded.positions().iter().map(|p| f64::from((p[2] - expected).abs()));
        let off = largest(off);
        // Half a step of the stored mean is 0.1 mm; the codes add at most their tolerance.
        assert!(off < 0.0003, "{off} from {expected} with ranges {ranges:?}");
    }
}

#[test]
fn a_sphere_stays_round() {
    let input = cloud(sphere(0.3, 50_000));
    for random_state in 0..3 {
        let options = HscsmOptions { random_state, ..options() };
        let model = hscsm::learn(&input, &options, &Silent).unwrap();
        assert_covered(&input, &model);
        let decoded = decode(&model, None);
        let off = decoded.positions().iter().map(|p| f64::from(dot(*p, *p).sqrt() - 0.3));
        let rms = root_mean_square(off);
        assert!(rms < 0.3 * PIXEL, "{rms} with seed {random_state}");
    }
}

#[test]
fn noise_is_reduced() {
    let plane = tilted();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let normal = plane.normal();
    let mut points = plane.points(0.0025);
    for p in &mut points {
        let noise: f32 = rng.sample::<f32, _>(StandardNormal) * 0.003;
        (0..3).for_each(|a| p[a] += noise * normal[a]);
    }
    let off = |points: &[Point]| {
        root_mean_square(points.iter().map(|p| f64::from(dot(sub(*p, plane.corner), normal))))
    };
    let before = off(&points);
    let input = cloud(points);
    let model = learn(&input);
    assert_covered(&input, &model);
    let after = off(decode(&model, None).positions());
    // A pixel is the mean of 16 points, so that a quarter of the noise stays; to it comes what coding leaves, which ends
    // at a fifth of a pixel.
    let most = (0.25 * before).hypot(0.2 * PIXEL);
    assert!(after < most && most < before, "{after} after, {before} before");
}

/// A sphere with stripes of colour and a floor below it: enough variety for both dictionaries.
fn colored_scene() -> PointCloud {
    let mut positions = sphere(0.2, 15_000);
    positions.extend(rectangle([-0.4, -0.4, -0.2], [0.8, 0.0, 0.0], [0.0, 0.8, 0.0]).points(0.006));
    let colors = positions
        .iter()
        .map(|p| {
            let wave = |c: f32| (127.5 + 127.5 * (60.0 * c).sin()) as u8;
            [wave(p[0]), wave(p[1] + p[2]), wave(2.0 * p[2])]
        })
        .collect();
    let parts = CloudParts { positions, colors: Some(colors), ..CloudParts::default() };
    PointCloud::from_parts(parts).unwrap().0
}

#[test]
fn bytes_bring_back_the_same_model_without_colours() {
    let input = cloud(sphere(0.3, 20_000));
    let model = learn(&input);
    assert!(!model.has_color());
    let again: HscsmModel = read(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.n_points(), input.len() as u64);
    for resolution in [None, Some(0.003), Some(0.05)] {
        assert_eq!(decode(&again, resolution), decode(&model, resolution));
    }
}

fn with_levels(levels: u32) -> HscsmOptions {
    HscsmOptions { levels, patch_pixels: 4, ..options() }
}

#[test]
fn a_smooth_surface_needs_the_coarsest_level_only_and_clutter_the_finest() {
    // 64 cm square: 4 x 4 patches of 16 cm. Then squares of 1 cm, each at a height of its own within 3 cm.
    let flat = rectangle([0.0; 3], [0.64, 0.0, 0.0], [0.0, 0.64, 0.0]);
    let smooth = hscsm::learn(&points_of(&[flat], 0.0025), &with_levels(3), &Silent).unwrap();
    let area: Vec<f64> = smooth.levels().iter().map(|l| l.covered_area()).collect();
    // All of it, but for a rim of at most a finest pixel, which masks of such pixels leave to the lowest level.
    assert!((0.63 * 0.63 - 1e-6..0.64 * 0.64 + 1e-6).contains(&area[0]), "{area:?}");
    assert!(area[1] + area[2] < 0.1 * area[0], "{area:?}");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let rubble: Vec<Rectangle> = (0..1600)
        .map(|i| {
            let z = rng.random_range(0.0..0.03);
            let corner = [0.01 * (i % 40) as f32, 0.01 * (i / 40) as f32, z];
            rectangle(corner, [0.01, 0.0, 0.0], [0.0, 0.01, 0.0])
        })
        .collect();
    // Sheets of at most 2 x 5 mm hold a third of the squares.
    let strict = HscsmOptions { max_depth_deviation: Some(0.003), ..with_levels(3) };
    let rough = hscsm::learn(&points_of(&rubble, 0.0025), &strict, &Silent).unwrap();
    let area: Vec<f64> = rough.levels().iter().map(|l| l.covered_area()).collect();
    assert!(area[2] > 0.95 * area.iter().sum::<f64>(), "{area:?}");
    assert_all_owned(&rough);
}

#[test]
fn interleaved_sheets_are_not_averaged() {
    // Strips of 1 cm at two heights: above the lowest level either two sheets or none, never their mean.
    let comb: Vec<Rectangle> = (0..40)
        .map(|i| {
            let z = if i % 2 == 0 { 0.0 } else { 0.03 };
            rectangle([0.01 * i as f32, 0.0, z], [0.01, 0.0, 0.0], [0.0, 0.4, 0.0])
        })
        .collect();
    let model = hscsm::learn(&points_of(&comb, 0.0025), &with_levels(3), &Silent).unwrap();
    assert_all_owned(&model);
    let across = decode(&model, None);
    let across = across.positions().iter().map(|p| f64::from(p[2].abs().min((p[2] - 0.03).abs())));
    let rms = root_mean_square(across);
    assert!(rms < 0.3 * PIXEL, "{rms}");
}

#[test]
fn deviating_colors_go_to_the_level_below() {
    let flat = rectangle([0.0; 3], [0.64, 0.0, 0.0], [0.0, 0.32, 0.0]);
    let positions = flat.points(0.0025);
    // The left half is grey, the right one a chessboard of 1 cm: a standard deviation of 100 in pixels of 2 cm.
    let color = |p: &Point| {
        let odd = ((p[0] / 0.01) as i32 + (p[1] / 0.01) as i32) % 2 == 1;
        if p[0] < 0.32 {
            [128; 3]
        } else if odd {
            [228; 3]
        } else {
            [28; 3]
        }
    };
    let colors = Some(positions.iter().map(color).collect());
    let parts = CloudParts { positions, colors, ..CloudParts::default() };
    let input = PointCloud::from_parts(parts).unwrap().0;
    let area = |max_color_deviation: f64| {
        let options = HscsmOptions { max_color_deviation, ..with_levels(2) };
        let model = hscsm::learn(&input, &options, &Silent).unwrap();
        assert_all_owned(&model);
        model.levels().iter().map(|l| l.covered_area()).collect::<Vec<f64>>()
    };
    let half = 0.32 * 0.32;
    let (strict, open) = (area(50.0), area(150.0));
    assert!(strict[0] > 0.8 * half && strict[0] < 1.1 * half, "{strict:?}");
    assert!(strict[1] > 0.9 * half, "{strict:?}");
    assert!(open[0] > 1.6 * half, "{open:?}");
}

#[test]
fn the_deviation_of_a_pixel_is_that_of_its_points() {
    // Two sheets 4 mm apart in one cell of the samples: a standard deviation of 2 mm, which their mean hides.
    let input = measured_twice(0.004, None);
    let lower = |rho: f64| {
        let options = HscsmOptions { max_depth_deviation: Some(rho), ..with_levels(2) };
        let model = hscsm::learn(&input, &options, &Silent).unwrap();
        model.levels()[0].covered_area() / (0.4 * 0.4)
    };
    let (strict, open) = (lower(0.0015), lower(0.0025));
    assert!(strict < 0.01 && open > 0.8, "{strict}, {open}");
}

#[test]
fn faces_of_a_thin_wall_stay_apart_on_every_level() {
    let front = rectangle([0.0, 0.0, 0.003], [0.64, 0.0, 0.0], [0.0, 0.64, 0.0]);
    let back = rectangle([0.0, 0.0, -0.003], [0.0, 0.64, 0.0], [0.64, 0.0, 0.0]);
    let input = seen_from_front(&[front, back], 0.0025);
    let model = hscsm::learn(&input, &with_levels(3), &Silent).unwrap();
    assert!(model.levels()[0].covered_area() > 1.6 * 0.64 * 0.64);
    let decoded = decode(&model, None);
    let across = decoded.positions().iter().map(|p| f64::from((p[2].abs() - 0.003).abs()));
    let across = largest(across);
    assert!(across < 0.0025, "{across}");
}

#[test]
fn greedy_placement_needs_fewer_patches_further_apart() {
    let walls = [
        rectangle([0.0; 3], [0.9, 0.0, 0.0], [0.0, 0.7, 0.0]),
        rectangle([0.0; 3], [0.0, 0.7, 0.0], [0.0, 0.0, 0.6]),
        tilted(),
    ];
    let mut positions: Vec<Point> = walls.iter().flat_map(|w| w.points(0.004)).collect();
    positions.extend(sphere(0.15, 20_000).iter().map(|p| [p[0] + 0.4, p[1] + 0.3, p[2] + 0.15]));
    let input = cloud(positions);
    let placed = |placement: Placement| {
        let options = HscsmOptions { placement, iterations: 1, ..options() };
        let model = hscsm::learn(&input, &options, &Silent).unwrap();
        assert_all_owned(&model);
        let of_level = &model.report().levels[0];
        let distance =
            of_level.iter().find(|f| f.0 == "distance of neighbouring patches").unwrap().1;
        (model.len(), distance)
    };
    let (greedy, subsampled) = (placed(Placement::Greedy), placed(Placement::Subsampled));
    assert!(greedy.0 < subsampled.0 && greedy.1 > subsampled.1, "{greedy:?}, {subsampled:?}");
}

#[test]
fn levels_and_threads_change_no_byte() {
    let input = colored_scene();
    let made_by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = HscsmOptions { max_color_deviation: 60.0, ..with_levels(3) };
            let model = hscsm::learn(&input, &options, &Silent).unwrap();
            model.to_bytes().unwrap()
        })
    };
    let one = made_by(1);
    assert_eq!(one, made_by(2));
    assert_eq!(one, made_by(8));
}

#[test]
fn a_frozen_dictionary_codes_another_scene() {
    let first = learn(&colored_scene());
    let parts = CloudParts {
        positions: colored_scene().positions().iter().map(|p| [p[0], p[1], p[2] + 0.013]).collect(),
        colors: colored_scene().colors().map(<[_]>::to_vec),
        ..CloudParts::default()
    };
    let second = PointCloud::from_parts(parts).unwrap().0;
    let dictionary = first.dictionary();
    let model = hscsm::describe(&second, &options(), &dictionary, &Silent).unwrap();
    assert_all_owned(&model);
    assert_eq!(model.dictionary(), dictionary);
    assert!(model.to_bytes().unwrap().len() < learn(&second).to_bytes().unwrap().len());
    let mismatch = hscsm::describe(&second, &with_levels(2), &dictionary, &Silent).unwrap_err();
    assert!(matches!(mismatch, Error::Inconsistent(_)), "{mismatch:?}");
}

#[test]
fn colors_come_back() {
    let plane = tilted();
    let positions = plane.points(0.004);
    let color = [200, 100, 50];
    let colors = Some(vec![color; positions.len()]);
    let parts = CloudParts { positions, colors, ..CloudParts::default() };
    let model = learn(&PointCloud::from_parts(parts).unwrap().0);
    // Luma and chroma are half a step of 5 off at most, which makes 5 in red and blue, 3.75 in green.
    for found in decode(&model, None).colors().unwrap() {
        for c in 0..3 {
            assert!(found[c].abs_diff(color[c]) <= 6, "{found:?}");
        }
    }

    // The decoded points carry colours; how close they are is asserted on the constant colour above.
    let input = colored_scene();
    let generous = HscsmOptions { color_sparsity: 32, iterations: 6, ..options() };
    let model = hscsm::learn(&input, &generous, &Silent).unwrap();
    let decoded = decode(&model, Some(PIXEL));
    assert_eq!(decoded.colors().unwrap().len(), decoded.len());
    assert!(decode(&learn(&cloud(sphere(0.1, 500))), None).colors().is_none());
}

/// Half a step of the stored mean, and of a full code the root mean square error that ends coding and that of its rounding
/// (the steps are such that the latter is at most half of the tolerance); all in grey levels.
fn grey_bound(options: &HscsmOptions) -> f64 {
    let tolerance = options.color_tolerance;
    (tolerance * tolerance * 1.25).sqrt()
}

fn with_intensities(positions: Vec<Point>, of: impl Fn(&Point) -> f32) -> PointCloud {
    let intensities = Some(positions.iter().map(of).collect());
    let parts = CloudParts { positions, intensities, ..CloudParts::default() };
    PointCloud::from_parts(parts).unwrap().0
}

#[test]
fn intensities_come_back_in_the_place_of_colors() {
    // One wave of 0.3 m along x, in a unit of its own: amplitude 2000 about -500.
    let wave = |x: f32| -500.0 + 2000.0 * (std::f32::consts::TAU * x / 0.3).sin();
    let flat = rectangle([0.0; 3], [0.6, 0.0, 0.0], [0.0, 0.6, 0.0]);
    let input = with_intensities(flat.points(0.004), |p| wave(p[0]));
    let options = HscsmOptions { color_sparsity: 32, ..options() };
    let model = hscsm::learn(&input, &options, &Silent).unwrap();
    assert!(model.has_intensity() && !model.has_color());
    let limits = model.intensity().unwrap();
    assert!((limits.low + 2500.0).abs() < 1.0 && (limits.high - 1500.0).abs() < 1.0, "{limits:?}");
    let report = model.report();
    assert!(report.not_kept.is_empty(), "{:?}", report.not_kept);
    let [figures] = &report.attributes[..] else { panic!("{:?}", report.attributes) };
    assert_eq!(figures.name, "intensities");

    let again: HscsmModel = read(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.intensity(), Some(limits));
    let decoded = decode(&again, None);
    assert!(decoded.colors().is_none());
    let found = decoded.intensities().unwrap();
    let rms = root_mean_square(
        decoded.positions().iter().zip(found).map(|(p, v)| f64::from(v - wave(p[0]))),
    );
    // Beside it, points of the outer half of a patch's outermost pixels, an eighth of all, have the intensity a quarter of a
    // pixel further in: off by a root mean square of 0.09 of what the wave changes over a pixel at most, TAU / 30 of its
    // amplitude.
    let bound = grey_bound(&options) / 255.0 * 4000.0 + 0.1 * std::f64::consts::TAU / 30.0 * 2000.0;
    assert!(rms < bound, "{rms} of {bound}");
    let reported = figures.rmse.unwrap();
    assert!(reported > 0.0 && reported < bound + 0.5 * std::f64::consts::TAU / 30.0 * 2000.0);
}

#[test]
fn grey_intensities_are_coded_as_grey_colors_are() {
    // Intensities 0 to 255 have the images of the same colours, in one plane instead of three.
    let flat = rectangle([0.0; 3], [0.4, 0.0, 0.0], [0.0, 0.4, 0.0]);
    let grey = |p: &Point| (127.5 + 160.0 * (40.0 * p[0]).sin() * (30.0 * p[1]).cos()) as u8;
    let positions = flat.points(0.004);
    let colors = Some(positions.iter().map(|p| [grey(p); 3]).collect());
    let parts = CloudParts { positions: positions.clone(), colors, ..CloudParts::default() };
    let colored_input = PointCloud::from_parts(parts).unwrap().0;
    let colored = learn(&colored_input);
    let input = with_intensities(positions, |p| f32::from(grey(p)));
    let model = learn(&input);
    let limits = model.intensity().unwrap();
    assert_eq!((limits.low, limits.high), (0.0, 255.0));
    let (own, three) = (&model.levels()[0], &colored.levels()[0]);
    assert_eq!((own.color_planes(), three.color_planes()), (1, 3));
    assert_eq!((&own.poses, &own.masks, &own.depth), (&three.poses, &three.masks, &three.depth));
    let luma: Vec<i32> =
        three.color.iter().flat_map(|c| c.means.iter().step_by(3)).copied().collect();
    assert_eq!(own.color.as_ref().map(|c| &c.means), Some(&luma));
    assert_eq!(read::<HscsmModel>(&model.to_bytes().unwrap()).unwrap(), model);
    // The dictionary of colours describes intensities, with the same codes; that of intensities describes no colours.
    let described = hscsm::describe(&input, &options(), &colored.dictionary(), &Silent).unwrap();
    assert_eq!(described.levels(), colored.levels());
    assert_eq!(described.intensity(), Some(limits));
    let error =
        hscsm::describe(&colored_input, &options(), &model.dictionary(), &Silent).unwrap_err();
    assert!(error.to_string().contains("learned from intensities"), "{error}");
}

/// A plate whose points lie on every other line of a lattice of half a pixel, so that fine masks have gaps.
#[test]
fn fine_masks_keep_the_gaps_of_a_scan() {
    let flat = rectangle([0.0; 3], [0.64, 0.0, 0.0], [0.0, 0.64, 0.0]);
    // A point in the middle of every second column of pixels.
    let points: Vec<Point> = flat
        .points(PIXEL as f32)
        .into_iter()
        .filter(|p| (p[0] / PIXEL as f32) as i32 % 2 == 0)
        .collect();
    let input = cloud(points);
    let coarse = HscsmOptions { min_coverage: 0.4, ..with_levels(3) };
    let area = |options: &HscsmOptions| {
        let model = hscsm::learn(&input, options, &Silent).unwrap();
        assert!(model.levels()[0].len() > 4);
        let far = nearest(decode(&model, None).positions(), input.positions());
        (model.levels().iter().map(|l| l.covered_area()).sum::<f64>(), largest(far))
    };
    let (fine, near) = area(&coarse);
    let (filled, far) = area(&HscsmOptions {
        fine_masks: false,
        max_pixel_offset: f64::INFINITY,
        ..coarse.clone()
    });
    // Every pixel of a mask holds a point, so that there are no more of them than points: one in every second pixel of the
    // plate. There are fewer where two points share a pixel, which only those at the seams of sheets can. A mask pixel
    // of a column has its point within its diagonal.
    let of_points = 0.5 * 0.64 * 0.64;
    assert!(fine <= of_points * (1.0 + 1e-9) && fine > 0.98 * of_points, "{fine}");
    assert!(near <= 2.0_f64.sqrt() * PIXEL, "{near}");
    assert!(filled > 1.8 * fine, "{filled} {fine}");
    assert!(far >= near, "{far} {near}");
}

#[test]
fn levels_with_one_dictionary_store_it_once() {
    let input = colored_scene();
    let of = |one_dictionary| {
        let options = HscsmOptions { one_dictionary, ..with_levels(3) };
        hscsm::learn(&input, &options, &Silent).unwrap()
    };
    let (one, each) = (of(true), of(false));
    assert!(one.one_dictionary() && !each.one_dictionary());
    let dictionary = one.dictionary();
    assert!(dictionary.levels.iter().all(|l| l.depth == dictionary.levels[0].depth));
    assert!(dictionary.levels.iter().all(|l| l.color == dictionary.levels[0].color));
    // The same patches, whatever codes them.
    for (a, b) in one.levels().iter().zip(each.levels()) {
        assert_eq!((&a.poses, &a.masks), (&b.poses, &b.masks));
    }
    let bytes = one.to_bytes().unwrap();
    assert_eq!(read::<HscsmModel>(&bytes).unwrap(), one);
    // Another scene is described with it as with any other.
    let second = hscsm::describe(&input, &with_levels(3), &dictionary, &Silent).unwrap();
    assert_eq!(second.levels(), one.levels());
}

#[test]
fn the_published_method_is_free_of_what_was_added() {
    let input = colored_scene();
    let published = HscsmOptions { published: true, ..with_levels(2) };
    let model = hscsm::learn(&input, &published, &Silent).unwrap();
    assert!(!model.one_dictionary());
    for level in model.levels() {
        assert_eq!(level.mask_scale, 1);
        assert!(level.depth.means.iter().all(|&m| m == 0));
        assert!(level.color.as_ref().unwrap().means.iter().all(|&m| m == 0));
        assert!(level.depth.dictionary.n_atoms() <= 500);
    }
    assert!(model.dictionary().is_wide());
    assert_eq!(read::<HscsmModel>(&model.to_bytes().unwrap()).unwrap(), model);
    assert_covered(&input, &model);
    // It is what its switches are one by one.
    let switches = HscsmOptions {
        depth_atoms: Some(500),
        color_atoms: Some(3500),
        fine_masks: false,
        one_dictionary: false,
        growth_gate: false,
        max_pixel_offset: f64::INFINITY,
        means_apart: false,
        small_atoms: false,
        disjoint: false,
        max_training_signals: 1_000_000,
        ..with_levels(2)
    };
    assert_eq!(hscsm::learn(&input, &switches, &Silent).unwrap(), model);
}

#[test]
fn patches_that_overlap_show_what_others_own() {
    let input = points_of(&[tilted()], 0.0025);
    let set = |disjoint| {
        let options = HscsmOptions { disjoint, placement: Placement::Subsampled, ..options() };
        let model = hscsm::learn(&input, &options, &Silent).unwrap();
        let figures = model.report().figures.unwrap();
        assert_eq!(figures.samples, figures.samples_covered);
        model.levels()[0].set_pixels()
    };
    assert!(set(false) > set(true), "{} {}", set(false), set(true));
}

#[test]
fn colors_go_before_intensities() {
    let input = colored_scene();
    let both =
        CloudParts { intensities: Some(vec![3.0; input.len()]), ..input.clone().into_parts() };
    let model = learn(&PointCloud::from_parts(both).unwrap().0);
    assert!(model.has_color() && !model.has_intensity());
    assert_eq!(model.report().not_kept, ["intensities"]);
    assert_eq!(model.report().attributes[0].name, "colors");
    assert_eq!(model.to_bytes().unwrap(), learn(&input).to_bytes().unwrap());
}

#[test]
fn strange_intensities_are_kept_or_told() {
    let points = || tilted().points(0.004);
    let all = |value: f32| with_intensities(points(), |_| value);
    for value in [0.0, -7.5, f32::MAX, f32::MIN, 1e-40] {
        let model = learn(&all(value));
        assert_eq!(model.levels()[0].color.as_ref().unwrap().codes.atoms.len(), 0);
        assert!(decode(&model, None).intensities().unwrap().iter().all(|v| *v == value), "{value}");
    }
    // From the least to the largest number there is, half of the points each.
    let halves = with_intensities(points(), |p| if p[0] < 0.6 { f32::MIN } else { f32::MAX });
    let decoded = decode(&learn(&halves), None);
    for (p, v) in decoded.positions().iter().zip(decoded.intensities().unwrap()) {
        let beyond = f64::from(p[0] - 0.6);
        assert!(v.is_finite());
        assert!(beyond.abs() < 0.1 || (f64::from(*v) * beyond) > 0.0, "{p:?} {v}");
    }
}

#[test]
fn a_frozen_dictionary_takes_the_limits_of_each_cloud() {
    let flat = rectangle([0.0; 3], [0.4, 0.0, 0.0], [0.0, 0.4, 0.0]);
    let scene = |scale: f32| with_intensities(flat.points(0.004), |p| scale * (40.0 * p[0]).sin());
    let first = learn(&scene(1.0));
    let dictionary = first.dictionary();
    let model = hscsm::describe(&scene(1024.0), &options(), &dictionary, &Silent).unwrap();
    let (own, given) = (model.intensity().unwrap(), first.intensity().unwrap());
    assert_eq!((own.low, own.high), (1024.0 * given.low, 1024.0 * given.high));
    assert_eq!(model.levels(), first.levels());
    let without = learn(&points_of(&[flat], 0.004)).dictionary();
    let error = hscsm::describe(&scene(1.0), &options(), &without, &Silent).unwrap_err();
    assert!(error.to_string().contains("the cloud has intensities"), "{error}");
}

#[test]
fn nothing_is_refused_by_name() {
    let error = hscsm::learn(&cloud(Vec::new()), &options(), &Silent).unwrap_err();
    assert_eq!(error, Error::EmptyCloud);
}

#[test]
fn degenerate_clouds_come_back() {
    let line = |n: usize| (0..n).map(|i| [0.003 * i as f32, 0.001 * i as f32, 0.5]).collect();
    let clouds: [(&str, Vec<Point>); 8] = [
        ("one point", vec![[1.0, 2.0, 3.0]]),
        ("two points", vec![[0.0; 3], [0.3, 0.2, 0.1]]),
        ("two close points", vec![[0.0; 3], [0.003, 0.0, 0.002]]),
        ("a line", line(200)),
        ("a line along an axis", (0..200).map(|i| [0.0, 0.0, 0.004 * i as f32]).collect()),
        ("duplicates", vec![[-1.0, 0.5, 0.25]; 1000]),
        ("a plane", tilted().points(0.01)),
        ("far apart", vec![[-900.0, 0.0, 0.0], [900.0, 0.0, 0.0], [0.0, 900.0, -900.0]]),
    ];
    for (name, points) in clouds {
        let input = cloud(points);
        let model = learn(&input);
        assert_covered(&input, &model);
        let decoded = decode(&model, Some(PIXEL));
        let stray = largest(nearest(decoded.positions(), input.positions()));
        assert!(stray < 1.5 * PIXEL, "{name}: {stray}");
        let again: HscsmModel = read(&model.to_bytes().unwrap()).unwrap();
        assert_eq!(again.levels(), model.levels(), "{name}");
    }
}

#[test]
fn map_coordinates_keep_their_precision() {
    let corner = [451_234.567, 5_411_987.654, 312.5];
    let world: Vec<[f64; 3]> = tilted()
        .points(0.004)
        .iter()
        .map(|p| std::array::from_fn(|a| corner[a] + f64::from(p[a])))
        .collect();
    let (origin, positions) = PointCloud::split_origin(&world);
    let parts = CloudParts { origin, positions, ..CloudParts::default() };
    let input = PointCloud::from_parts(parts).unwrap().0;
    let model = learn(&input);
    assert_covered(&input, &model);
    let decoded = decode(&model, None);
    let plane = tilted();
    for i in 0..decoded.len() {
        let p = decoded.world(i);
        let local = std::array::from_fn(|a| (p[a] - corner[a]) as f32);
        let off = dot(sub(local, plane.corner), plane.normal()).abs();
        assert!(f64::from(off) < 0.3 * PIXEL, "{off}");
    }
}

#[test]
fn resolutions_from_huge_to_tiny_work_or_are_refused() {
    let input = points_of(&[tilted()], 0.01);
    let at = |resolution| {
        let options = HscsmOptions { resolution: Some(resolution), ..options() };
        hscsm::learn(&input, &options, &Silent)
    };
    let huge = at(10.0).unwrap();
    assert_eq!(huge.len(), 1);
    assert_all_owned(&huge);

    // The pixels are far smaller than the spacing: each point is on its own, and stays.
    let fine = at(0.0005).unwrap();
    let decoded = decode(&fine, None);
    assert!(largest(nearest(input.positions(), decoded.positions())) < 1.5 * 0.0005);

    let error = at(1e-8).unwrap_err();
    assert!(error.to_string().starts_with("resolution is 0.00000001, but must be at least"));
}

#[test]
fn decoding_is_possible_at_any_resolution() {
    let input = colored_scene();
    let model = learn(&input);
    let mut counts = Vec::new();
    for resolution in [0.002, 0.0035, 0.005, 0.01, 0.011, 0.02, 0.03, 0.079, 0.08, 0.2, 1.0, 100.0]
    {
        let decoded = decode(&model, Some(resolution));
        let far = largest(nearest(input.positions(), decoded.positions()));
        assert!(far <= 1.5 * resolution + PIXEL, "{far} at {resolution}");
        assert_eq!(decoded.colors().unwrap().len(), decoded.len());
        counts.push(decoded.len());
        for max_points in [0, 1, decoded.len() as u64 - 1, decoded.len() as u64] {
            let limited = DecodeOptions {
                resolution: Some(resolution),
                max_points,
                ..DecodeOptions::default()
            };
            match model.decode(limited, &Silent) {
                Ok(points) => assert!(points.len() as u64 <= max_points),
                Err(error) => assert!(
                    matches!(error, Error::TooManyPoints { limit, .. } if limit == max_points),
                    "{error:?}"
                ),
            }
        }
    }
    assert!(counts.is_sorted_by(|finer, coarser| finer >= coarser), "{counts:?}");
    // Coarser than a patch there is one point per patch.
    assert_eq!(counts.last(), Some(&model.len()));
}

#[test]
fn normals_stand_on_the_surface_and_face_the_sensor() {
    let plane = tilted();
    let with_normals = DecodeOptions { normals: true, ..DecodeOptions::default() };
    let model = learn(&seen_from_front(&[plane], 0.004));
    let decoded = model.decode(with_normals, &Silent).unwrap();
    for n in decoded.normals().unwrap() {
        assert!((dot(*n, *n) - 1.0).abs() < 1e-5);
        // Normals are stored to 1.3 degrees.
        assert!(dot(*n, plane.normal()) > 1.5_f32.to_radians().cos(), "{n:?}");
    }

    // A sphere seen from its inside.
    let positions = sphere(0.3, 50_000);
    let index = vec![0; positions.len()];
    let viewpoints = Some(Viewpoints { origins: vec![[0.0; 3]], index });
    let parts = CloudParts { positions, viewpoints, ..CloudParts::default() };
    let model = learn(&PointCloud::from_parts(parts).unwrap().0);
    let decoded = model.decode(with_normals, &Silent).unwrap();
    let normals = decoded.normals().unwrap();
    let inward: Vec<f32> =
        decoded.positions().iter().zip(normals).map(|(p, n)| -dot(unit(*p), *n)).collect();
    assert!(normals.iter().all(|n| (dot(*n, *n) - 1.0).abs() < 1e-5));
    assert!(inward.iter().all(|c| *c > 0.0));
    let mean = inward.iter().sum::<f32>() / inward.len() as f32;
    assert!(mean > 10.0_f32.to_radians().cos(), "{mean}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_cloud_is_covered(
        points in prop::collection::vec(prop::array::uniform3(-0.2_f32..0.2), 1..400),
        scale in prop_oneof![Just(1.0_f32), Just(0.1), Just(100.0)],
    ) {
        let input = cloud(points.iter().map(|p| p.map(|c| c * scale)).collect());
        assert_covered(&input, &learn(&input));
    }
}
