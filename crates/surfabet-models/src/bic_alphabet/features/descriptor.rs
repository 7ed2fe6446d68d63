//! Descriptors: range-image patches seen along the normal, in integers (III-C).
//!
//! The patch is orthographic, upright, and covers the inscribed circle of a square of two radii; a pixel holds the
//! height of the surface above the feature's plane. The paper interpolates a range image; here a pixel is a weighted
//! mean of the points about it, with a bandwidth that follows their spacing, since a feature far away has only a few.
//!
//! Only what is visible along the normal counts: no point that a sensor behind the feature's plane saw, such as the
//! other side of a wall, and of the points about a pixel none far below the highest.

use surfabet_base::parallel;
use surfabet_geom::{KdTree, Progress};

use super::Features;
use crate::bic_alphabet::constants::{BANDWIDTH, FEATURES_PER_TASK, VISIBLE_DEPTH};
use crate::bic_alphabet::options::BicAlphabetOptions;
use crate::bic_alphabet::pose::Frame;
use crate::error::Result;
use crate::scans::Scene;

/// Height steps per radius.
pub(in crate::bic_alphabet) const HEIGHTS: i32 = 64;

/// A pixel without a point.
pub(in crate::bic_alphabet) const EMPTY: i8 = i8::MIN;

/// Descriptors of many features, a row of pixels each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::bic_alphabet) struct Descriptors {
    pub pixels: usize,
    pub values: Vec<i8>,
    /// Points within the radius of each feature.
    pub counts: Vec<u32>,
}

impl Descriptors {
    /// Describes every feature.
    pub fn new(
        scene: &Scene,
        tree: &KdTree,
        features: &Features,
        options: &BicAlphabetOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let centers = pixel_centers(options.descriptor_pixels, options.radius() as f32);
        let pixels = centers.len();
        let mut values = vec![EMPTY; features.len() * pixels];
        let mut counts = vec![0; features.len()];
        let squared_radius = (options.radius() * options.radius()) as f32;
        let chunks = values.chunks_mut(FEATURES_PER_TASK * pixels);
        parallel::try_for_each(
            chunks.zip(counts.chunks_mut(FEATURES_PER_TASK)),
            |chunk, (values, counts)| -> Result<()> {
                progress.check()?;
                let mut sampler = Sampler::new(&centers, options);
                for (k, (row, count)) in values.chunks_mut(pixels).zip(counts).enumerate() {
                    let frame = &features.frames[chunk * FEATURES_PER_TASK + k];
                    let near = &mut sampler.near;
                    tree.within(frame.origin, sampler.reach, near);
                    let of_word = near.iter().filter(|n| n.squared_distance() < squared_radius);
                    *count = of_word.count() as u32;
                    let faces =
                        near.iter().map(|n| n.index()).filter(|&i| is_front(scene, frame, i));
                    sampler.points.clear();
                    sampler.points.extend(faces.map(|i| frame.local(scene.positions[i])));
                    sampler.describe(row);
                }
                Ok(())
            },
        )?;
        Ok(Self { pixels, values, counts })
    }

    /// Squared distances of all descriptors to `to`.
    pub fn distances(&self, to: &[i8], penalty: i32, out: &mut Vec<u32>) {
        out.clear();
        out.extend(
            self.values.chunks_exact(self.pixels).map(|d| descriptor_distance(d, to, penalty)),
        );
    }
}

/// True unless point `i` was seen from behind the plane through it along a frame's normal.
fn is_front(scene: &Scene, frame: &Frame, i: usize) -> bool {
    let Some(&viewpoint) = scene.viewpoints.get(i) else { return true };
    let (p, normal) = (scene.positions[i], frame.rows[2]);
    (0..3).map(|a| (viewpoint[a] - p[a]) * normal[a]).sum::<f32>() > 0.0
}

/// `|a - b|^2` in squared height steps; a pixel empty in one of both counts as a difference of `penalty` steps, one
/// empty in both as none.
#[inline]
pub(in crate::bic_alphabet) fn descriptor_distance(a: &[i8], b: &[i8], penalty: i32) -> u32 {
    let squared = penalty * penalty;
    let mut sum = 0;
    for (&a, &b) in a.iter().zip(b) {
        let difference = i32::from(a) - i32::from(b);
        let one_empty = (a == EMPTY) != (b == EMPTY);
        sum += if one_empty { squared } else { difference * difference };
    }
    sum as u32
}

/// The difference that a pixel empty in one of two descriptors counts as, in height steps.
pub(in crate::bic_alphabet) fn penalty_steps(empty_penalty: f64) -> i32 {
    (empty_penalty * f64::from(HEIGHTS)).round() as i32
}

/// Centres of the pixels within the circle, right and up, metres.
pub(in crate::bic_alphabet) fn pixel_centers(side: u32, radius: f32) -> Vec<[f32; 2]> {
    let at = |k: u32| (2.0 * (k as f32 + 0.5) / side as f32 - 1.0) * radius;
    let all = (0..side * side).map(|k| [at(k % side), at(k / side)]);
    all.filter(|[u, v]| u * u + v * v <= radius * radius).collect()
}

/// Describes features one after the other.
struct Sampler<'a> {
    centers: &'a [[f32; 2]],
    radius: f32,
    cell: f32,
    reach: f32,
    near: Vec<surfabet_geom::Neighbor>,
    points: Vec<[f32; 3]>,
}

impl<'a> Sampler<'a> {
    fn new(centers: &'a [[f32; 2]], options: &BicAlphabetOptions) -> Self {
        let radius = options.radius() as f32;
        let cell = 2.0 * radius / options.descriptor_pixels as f32;
        Self { centers, radius, cell, reach: radius + cell, near: Vec::new(), points: Vec::new() }
    }

    /// Fills a row of pixels from `points`.
    ///
    /// The height at `(u, v)` is `sum w h / sum w` over the points at `(x, y)` with height h, with the weight
    /// `w = (1 - d^2 / b^2)^2` at a distance d below the bandwidth b, as far as h is not [`VISIBLE_DEPTH`] bandwidths
    /// below the highest of them.
    fn describe(&self, row: &mut [i8]) {
        let square = |p: &[f32; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        let count = self.points.iter().filter(|p| square(p) < self.radius * self.radius).count();
        let spacing = self.radius * (std::f32::consts::PI / count.max(1) as f32).sqrt();
        let bandwidth = self.cell.max(BANDWIDTH * spacing);
        let narrow = 1.0 / (bandwidth * bandwidth);
        let scale = HEIGHTS as f32 / self.radius;
        for (pixel, [u, v]) in row.iter_mut().zip(self.centers) {
            let near = self.points.iter().filter_map(|p| {
                let (du, dv) = (p[0] - u, p[1] - v);
                let t = 1.0 - (du * du + dv * dv) * narrow;
                (t > 0.0).then_some((t * t, p[2]))
            });
            let highest = near.clone().map(|(_, h)| h).fold(f32::NEG_INFINITY, f32::max);
            let hidden = highest - VISIBLE_DEPTH * bandwidth;
            let (mut sum, mut weights) = (0.0_f32, 0.0_f32);
            for (weight, h) in near.filter(|(_, h)| *h >= hidden) {
                sum += weight * h;
                weights += weight;
            }
            if weights > 0.0 {
                let height = (sum / weights * scale).round();
                *pixel = height.clamp(-HEIGHTS as f32, HEIGHTS as f32) as i8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{CloudParts, PointCloud, Silent, Viewpoints};

    use super::*;
    use crate::scans::Deviation;

    fn describe(points: Vec<[f32; 3]>) -> Vec<i8> {
        let options = BicAlphabetOptions { radius: Some(0.1), ..BicAlphabetOptions::default() };
        let centers = pixel_centers(8, 0.1);
        let sampler = Sampler { points, ..Sampler::new(&centers, &options) };
        let mut row = vec![EMPTY; centers.len()];
        sampler.describe(&mut row);
        row
    }

    fn grid(height: impl Fn(f32, f32) -> Option<f32>) -> Vec<[f32; 3]> {
        let at = |k: i32| (k % 41 - 20) as f32 * 0.006;
        (0..41 * 41)
            .filter_map(|k| {
                let (u, v) = (at(k), at(k / 41));
                height(u, v).map(|z| [u, v, z])
            })
            .collect()
    }

    #[test]
    fn pixels_are_those_of_the_circle() {
        assert_eq!(pixel_centers(8, 0.1).len(), 52);
        assert_eq!(pixel_centers(2, 0.1).len(), 4);
    }

    #[test]
    fn a_plane_is_all_zero_and_a_step_has_two_heights() {
        assert!(describe(grid(|_, _| Some(0.0))).iter().all(|&h| h == 0));
        let step = describe(grid(|u, _| Some(if u > 0.0 { 0.05 } else { 0.0 })));
        for (h, [u, _]) in step.iter().zip(pixel_centers(8, 0.1)) {
            if u.abs() > 0.03 {
                assert_eq!(*h, if u > 0.0 { 32 } else { 0 });
            }
        }
    }

    #[test]
    fn what_a_surface_hides_does_not_count() {
        let top = grid(|u, v| Some(0.1 * u - 0.3 * v));
        let below = grid(|_, _| Some(-0.08));
        assert_eq!(describe([top.clone(), below].concat()), describe(top.clone()));
        // Nor does its other side, which another sensor saw.
        let back: Vec<[f32; 3]> = top.iter().map(|p| [p[0], p[1], p[2] - 0.01]).collect();
        let frame =
            Frame { origin: [0.0; 3], rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
        let viewpoints = Viewpoints {
            origins: vec![[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]],
            index: [vec![0; top.len()], vec![1; back.len()]].concat(),
        };
        let positions = [top, back].concat();
        let parts = CloudParts { positions, viewpoints: Some(viewpoints), ..CloudParts::default() };
        let (cloud, _) = PointCloud::from_parts(parts).unwrap();
        let scene = Scene::new(&cloud, Deviation::default(), 0.0, &Silent).unwrap();
        for i in 0..scene.len() {
            assert_eq!(is_front(&scene, &frame, i), scene.viewpoints[i][2] > 0.0);
        }
    }

    #[test]
    fn beyond_an_edge_pixels_are_empty_and_cost_the_penalty() {
        let plane = describe(grid(|_, _| Some(0.0)));
        let edge = describe(grid(|u, _| (u < 0.0).then_some(0.0)));
        let empty = edge.iter().filter(|&&h| h == EMPTY).count();
        assert!((16..=26).contains(&empty), "{empty}");
        assert_eq!(descriptor_distance(&plane, &edge, 32), 32 * 32 * empty as u32);
        assert_eq!(descriptor_distance(&edge, &edge, 32), 0);
    }
}
