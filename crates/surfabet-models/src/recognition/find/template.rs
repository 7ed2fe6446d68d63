//! The example: samples about a pivot, and how like them another place is, sample by sample.

use surfabet_geom::{KdTree, Pose};

use super::options::Region;
use super::scene::{Motion, Place};
use crate::error::Result;
use crate::vector::dot;

/// Normals of one and the same surface differ by less, |cosine|.
pub(super) const ALIKE: f32 = 0.6;

/// Equal pieces seen from two places may differ in size by this factor at no cost.
const SEEN: f64 = 1.5;

/// What to look for: samples about a pivot.
pub(super) struct Template {
    pub region: Region,
    pub pivot: [f64; 3],
    pub points: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// Which samples of the scene they are.
    pub samples: Vec<u32>,
    /// Samples of each sample's piece.
    pub sizes: Vec<f64>,
    /// The share of each sample's piece that lies in the region.
    pub weights: Vec<f64>,
    pub tree: KdTree,
    pub tolerance: f64,
    pub color_tolerance: Option<f64>,
    pub spacing: f64,
    pub diagonal: f64,
    /// Farthest sample from the pivot.
    pub reach: f64,
}

impl Template {
    pub fn new(
        scene: &Place,
        region: &Region,
        tolerance: f64,
        color_tolerance: Option<f64>,
        diagonal: f64,
    ) -> Result<Option<Self>> {
        let surface = scene.surface;
        let mut inside: Vec<u32> = (0..surface.len() as u32)
            .filter(|&i| region.contains(surface.points[i as usize].map(f64::from)))
            .collect();
        let weights = scene.shares(&inside);
        // A fixed shuffle, so that any first so many stand for all.
        let mut shuffled: Vec<(u64, u32, f64)> = inside
            .iter()
            .zip(weights)
            .map(|(&i, w)| (u64::from(i).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32), i, w))
            .collect();
        shuffled.sort_by_key(|s| (s.0, s.1));
        inside = shuffled.iter().map(|s| s.1).collect();
        let weights: Vec<f64> = shuffled.iter().map(|s| s.2).collect();
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Ok(None);
        }
        let pivot: [f64; 3] = std::array::from_fn(|a| {
            let at = |(&i, w): (&u32, &f64)| w * f64::from(surface.points[i as usize][a]);
            inside.iter().zip(&weights).map(at).sum::<f64>() / total
        });
        let points: Vec<[f32; 3]> = inside
            .iter()
            .map(|&i| {
                let p = surface.points[i as usize];
                std::array::from_fn(|a| (f64::from(p[a]) - pivot[a]) as f32)
            })
            .collect();
        let reach = points.iter().map(|&p| f64::from(dot(p, p))).fold(0.0, f64::max).sqrt();
        Ok(Some(Self {
            region: *region,
            pivot,
            normals: inside.iter().map(|&i| surface.normals[i as usize]).collect(),
            color_tolerance,
            sizes: inside.iter().map(|&i| scene.size(i as usize)).collect(),
            tree: KdTree::new(&points)?,
            points,
            weights,
            samples: inside,
            tolerance,
            spacing: surface.spacing,
            diagonal,
            reach,
        }))
    }

    pub fn moved(&self, motion: &Motion, i: usize) -> [f32; 3] {
        let turned = motion.turned(self.points[i]);
        std::array::from_fn(|a| (turned[a] + self.pivot[a] + motion.shift[a]) as f32)
    }

    /// How near a surface with a normal comes to a point that is `d` away from one of its samples, and whether the
    /// normals are alike: 1 to 0.
    pub fn nearness(&self, d: [f32; 3], normal: [f32; 3], other: [f32; 3], tolerance: f64) -> f64 {
        if dot(normal, other).abs() < ALIKE {
            return 0.0;
        }
        let along = f64::from(dot(d, normal));
        let beside = (f64::from(dot(d, d)) - along * along).max(0.0).sqrt();
        let gap = (beside - self.spacing).max(0.0);
        (-0.5 * (along * along + gap * gap) / (tolerance * tolerance)).exp()
    }

    /// How alike the i-th sample and the j-th of the scene are in the sizes of their pieces and in colour, 1 to 0.
    pub fn alike(&self, scene: &Place, i: usize, j: usize) -> f64 {
        let size = alike(self.sizes[i], scene.size(j));
        let colors = |t| scene.surface.alike(self.samples[i] as usize, j, t);
        size * self.color_tolerance.map_or(1.0, colors)
    }

    /// How near the scene comes to each of the first `n` samples there, 1 to 0.
    pub fn matches(&self, scene: &Place, motion: &Motion, tolerance: f64, n: usize) -> Vec<f32> {
        let near = |i: usize| {
            let p = self.moved(motion, i);
            let Some(near) = scene.tree.nearest(p) else { return 0.0 };
            if f64::from(near.squared_distance()).sqrt() > 4.0 * tolerance + self.spacing {
                return 0.0;
            }
            let q = scene.surface.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let turned = motion.turned(self.normals[i]).map(|c| c as f32);
            let normal = scene.surface.normals[near.index()];
            let like = self.alike(scene, i, near.index());
            (like * self.nearness(d, normal, turned, tolerance)) as f32
        };
        (0..self.points.len().min(n)).map(near).collect()
    }

    /// In world coordinates.
    pub fn pose(&self, motion: &Motion, origin: [f64; 3]) -> Result<Pose> {
        let (s, c) = motion.yaw.sin_cos();
        let rows = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        // About the pivot in the world.
        let pivot: [f64; 3] = std::array::from_fn(|a| self.pivot[a] + origin[a]);
        let shift = std::array::from_fn(|a| {
            let turned: f64 = (0..3).map(|k| rows[a][k] * pivot[k]).sum();
            pivot[a] - turned + motion.shift[a]
        });
        Ok(Pose::new(rows, shift)?)
    }
}

/// How alike pieces of so many samples are, 1 to 0: parts of things are hidden, but a seat is no floor.
fn alike(a: f64, b: f64) -> f64 {
    (SEEN / a.max(b) * a.min(b)).min(1.0).sqrt()
}
