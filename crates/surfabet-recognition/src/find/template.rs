//! The example: samples about a pivot, and how well the scene matches them elsewhere, sample by sample.

use surfabet_geom::vector::dot;
use surfabet_geom::{KdTree, Pose};
use surfabet_models::Result;

use super::border;
use super::lengths::Lengths;
use super::motion::Motion;
use super::options::Region;
use super::scene::SearchScene;
use crate::constants::{NORMAL_COSINE, PIECE_SIZE_RATIO};
use crate::surface::color_similarity;

/// Multiplier of Fibonacci hashing: 2^64 over the golden ratio.
const SHUFFLE: u64 = 0x9e37_79b9_7f4a_7c15;

/// The example as samples about a pivot.
pub(crate) struct Template {
    /// Region of the example.
    pub region: Region,
    /// Weighted mean of the samples.
    pub pivot: [f64; 3],
    /// Samples about the pivot, in random order: any first few stand for all.
    pub points: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// Luma, orange and green chroma of each, where the example has colours.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Samples of each sample's piece.
    pub piece_sizes: Vec<f64>,
    /// Weight of each sample: [`SearchScene::weights`] in the region.
    pub weights: Vec<f64>,
    pub tree: KdTree,
    /// Standard deviation of equal surfaces.
    pub tolerance: f64,
    /// Distance of samples.
    pub spacing: f64,
    /// Of the region.
    pub diagonal: f64,
    /// Farthest sample from the pivot.
    pub reach: f64,
    /// How far from the example's samples a place has to be explained, metres; `None` for all of its region.
    pub surroundings: Option<f64>,
    /// Largest change of a size, as a share; 0 for congruent things.
    pub size_tolerance: f64,
    /// How far each sample is from where an example with colours ends that is a whole model, metres; else nothing.
    pub depths: Vec<f32>,
}

impl Template {
    /// The samples of `scene`, that of the example, in `region`; `None` when there are none.
    pub fn new(scene: &SearchScene, region: &Region, lengths: &Lengths) -> Result<Option<Self>> {
        let surface = &scene.surface;
        let inside: Vec<u32> = (0..surface.len() as u32)
            .filter(|&i| region.contains(surface.points[i as usize].map(f64::from)))
            .collect();
        let weights = scene.weights(&inside);
        let (samples, weights) = shuffled(&inside, weights);
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Ok(None);
        }
        let pivot: [f64; 3] = std::array::from_fn(|a| {
            let at = |(&i, w): (&u32, &f64)| w * f64::from(surface.points[i as usize][a]);
            samples.iter().zip(&weights).map(at).sum::<f64>() / total
        });
        let points: Vec<[f32; 3]> = samples
            .iter()
            .map(|&i| {
                let p = surface.points[i as usize];
                std::array::from_fn(|a| (f64::from(p[a]) - pivot[a]) as f32)
            })
            .collect();
        let reach = points.iter().map(|&p| f64::from(dot(p, p))).fold(0.0, f64::max).sqrt();
        let mut template = Self {
            region: *region,
            pivot,
            normals: samples.iter().map(|&i| surface.normals[i as usize]).collect(),
            piece_sizes: samples.iter().map(|&i| scene.piece_size(i as usize)).collect(),
            colors: surface
                .colors
                .as_ref()
                .map(|colors| samples.iter().map(|&i| colors[i as usize]).collect()),
            tree: KdTree::new(&points)?,
            points,
            weights,
            tolerance: lengths.tolerance,
            spacing: lengths.spacing,
            diagonal: lengths.diagonal,
            reach,
            surroundings: lengths.surroundings,
            size_tolerance: lengths.size_tolerance,
            depths: Vec::new(),
        };
        if template.surroundings.is_some() && scene.color_tolerance.is_some() {
            template.depths = border::depths(&template)?;
        }
        Ok(Some(template))
    }

    /// Where a motion takes the i-th sample.
    pub fn moved(&self, motion: &Motion, i: usize) -> [f32; 3] {
        let arm = motion.arm(self.points[i]);
        std::array::from_fn(|a| (arm[a] + self.pivot[a] + motion.shift[a]) as f32)
    }

    /// A motion about this pivot as one about another.
    pub fn about(&self, motion: &Motion, pivot: [f64; 3]) -> Motion {
        let arm = motion.arm(std::array::from_fn(|a| (pivot[a] - self.pivot[a]) as f32));
        let shift = std::array::from_fn(|a| arm[a] + self.pivot[a] + motion.shift[a] - pivot[a]);
        Motion { shift, ..*motion }
    }

    /// How near a surface comes to a sample that is `d` away from a point of it: `exp(-(h^2 + g^2) / (2 tolerance^2))`
    /// with h the distance along `normal` and g the one across it beyond the spacing of samples; 0 where the normals
    /// differ.
    pub fn nearness(&self, d: [f32; 3], normal: [f32; 3], other: [f32; 3], tolerance: f64) -> f64 {
        if dot(normal, other).abs() < NORMAL_COSINE {
            return 0.0;
        }
        let along = f64::from(dot(d, normal));
        let across = (f64::from(dot(d, d)) - along * along).max(0.0).sqrt();
        let gap = (across - self.spacing).max(0.0);
        (-0.5 * (along * along + gap * gap) / (tolerance * tolerance)).exp()
    }

    /// Similarity of the i-th sample and the j-th of the scene in the sizes of their pieces and in colour, 1 to 0.
    pub fn similarity(&self, scene: &SearchScene, i: usize, j: usize) -> f64 {
        size_similarity(self.piece_sizes[i], scene.piece_size(j))
            * self.color_similarity(scene, i, j)
    }

    /// Similarity of their colours alone; 1 where shape alone counts. Near the border of the example less counts, for words of the
    /// scene mix its colours with those beside it: their root of the order `(radius / depth)^2`.
    fn color_similarity(&self, scene: &SearchScene, i: usize, j: usize) -> f64 {
        let (Some(tolerance), Some(a), Some(b)) =
            (scene.color_tolerance, &self.colors, &scene.surface.colors)
        else {
            return 1.0;
        };
        let similarity = color_similarity(a[i], b[j], tolerance);
        match self.depths.get(i) {
            Some(depth) => {
                let share = f64::from(depth / scene.surface.color_radii[j]).min(1.0);
                similarity.powf(share * share)
            }
            None => similarity,
        }
    }

    /// How well the scene matches each of the first `n` samples after a motion, 1 to 0.
    pub fn matches(
        &self,
        scene: &SearchScene,
        motion: &Motion,
        tolerance: f64,
        n: usize,
    ) -> Vec<f32> {
        let match_of = |i: usize| {
            let p = self.moved(motion, i);
            let Some(near) = scene.tree.nearest(p) else { return 0.0 };
            if f64::from(near.squared_distance()).sqrt() > 4.0 * tolerance + self.spacing {
                return 0.0;
            }
            let q = scene.surface.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let turned = motion.turned(self.normals[i]).map(|c| c as f32);
            let normal = scene.surface.normals[near.index()];
            let similarity = self.similarity(scene, i, near.index());
            (similarity * self.nearness(d, normal, turned, tolerance)) as f32
        };
        (0..self.points.len().min(n)).map(match_of).collect()
    }

    /// A motion from the world of the example, whose coordinates are about `from`, to that of the scene about `to`: rigid, about
    /// the pivot.
    pub fn pose(&self, motion: &Motion, from: [f64; 3], to: [f64; 3]) -> Result<Pose> {
        let (s, c) = motion.yaw.sin_cos();
        let rows = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        // Where the pivot is in the one world, and where it comes to lie in the other.
        let pivot: [f64; 3] = std::array::from_fn(|a| self.pivot[a] + from[a]);
        let shift = std::array::from_fn(|a| {
            let turned: f64 = (0..3).map(|k| rows[a][k] * pivot[k]).sum();
            self.pivot[a] + to[a] - turned + motion.shift[a]
        });
        Ok(Pose::new(rows, shift)?)
    }
}

/// Samples and their weights in an order that is random but always the same.
fn shuffled(samples: &[u32], weights: Vec<f64>) -> (Vec<u32>, Vec<f64>) {
    let key = |i: u32| u64::from(i).wrapping_mul(SHUFFLE).rotate_left(32);
    let mut keyed: Vec<(u64, u32, f64)> =
        samples.iter().zip(weights).map(|(&i, weight)| (key(i), i, weight)).collect();
    keyed.sort_by_key(|k| (k.0, k.1));
    keyed.into_iter().map(|k| (k.1, k.2)).unzip()
}

/// Similarity of pieces of `a` and `b` samples, 1 to 0: `sqrt(PIECE_SIZE_RATIO * smaller / larger)`, at most 1. Parts of
/// things are hidden, but a seat is no floor.
fn size_similarity(a: f64, b: f64) -> f64 {
    (PIECE_SIZE_RATIO / a.max(b) * a.min(b)).min(1.0).sqrt()
}
