//! The surface that a model stands for, as evenly spaced oriented samples, and the smooth pieces that it falls into.

use rayon::prelude::*;
use surfabet_geom::{KdTree, Neighbor, Progress};

use crate::alphabet::model::{AlphabetModel, Occurrence};
use crate::alphabet::word::{PIXELS, Word};
use crate::color::to_ycocg;
use crate::disjoint::root;
use crate::error::{Result, check_points};
use crate::vector::{self, dot, minus};

/// Distance of raw samples over the spacing of those that are kept, so that no place is skipped.
const RAW: f64 = 0.7;

/// Samples up to so many spacings apart can belong to one piece.
const REACH: f64 = 2.1;

/// Least cosine between normals of neighbours in one piece.
const SMOOTH: f32 = 0.94;

/// Farthest that a neighbour in one piece lies from the other's plane, spacings.
const STEP: f64 = 0.35;

/// Luma, which changes with the light, may differ by so many times as much as chroma.
const LIGHT: f64 = 3.0;

/// Most samples.
const LIMIT: u64 = 20_000_000;

/// Samples, one per cube of the spacing's side and per axis that normals are nearest to.
pub(super) struct Surface {
    /// Metres from the corner of the lattice.
    pub points: Vec<[f32; 3]>,
    /// Unit normals, towards the sensor where one is known.
    pub normals: Vec<[f32; 3]>,
    /// The occurrence that each sample is of, or one of several.
    pub occurrences: Vec<u32>,
    /// Luma, orange and green chroma, 0 to 255, where the model has colours.
    pub colors: Option<Vec<[f32; 3]>>,
    /// The same of all occurrences.
    pub hues: Option<Vec<[f32; 3]>>,
    /// Metres.
    pub spacing: f64,
}

impl Surface {
    /// # Errors
    /// [`crate::Error::TooManyPoints`], [`crate::Error::Cancelled`].
    pub fn of(model: &AlphabetModel, spacing: f64, progress: &dyn Progress) -> Result<Self> {
        let occurrences: Vec<Occurrence> = model.occurrences().collect();
        let origin = model.header().origin;
        let per_side = |radius: f64| (2.0 * radius / (RAW * spacing)).ceil().max(1.0);
        let most: f64 = occurrences.iter().map(|o| per_side(o.radius).powi(2)).sum();
        check_points(spacing, most, LIMIT)?;
        let raw: Vec<Vec<Raw>> = occurrences
            .par_iter()
            .enumerate()
            .map(|(k, o)| {
                progress.check()?;
                let word = &model.alphabet().words()[usize::from(o.word)];
                let n = per_side(o.radius) as u64;
                let at = |i: u64| (2 * i + 1) as f64 / n as f64 - 1.0;
                let mut samples = Vec::new();
                for i in 0..n * n {
                    let [right, up] = [at(i % n), at(i / n)];
                    let Some(height) = word.height(right, up) else { continue };
                    let place = [right, up, height].map(|c| c * o.radius);
                    let along =
                        |v: [f64; 3], a: usize| (0..3).map(|k| o.rows[k][a] * v[k]).sum::<f64>();
                    let point = std::array::from_fn(|a| o.center[a] - origin[a] + along(place, a));
                    let [x, y] = slopes(word, right, up);
                    let length = (x * x + y * y + 1.0).sqrt();
                    let normal = std::array::from_fn(|a| along([-x, -y, 1.0], a) / length);
                    samples.push(Raw::new(point, normal, k as u32, spacing));
                }
                Ok(samples)
            })
            .collect::<Result<_>>()?;
        let mut raw = raw.concat();
        progress.check()?;
        // Within a cube the order is that of the occurrences.
        raw.par_sort_by_key(|r| r.key);
        let to_hue = |rgb: &[u8; 3]| to_ycocg(rgb.map(f32::from));
        let hues: Option<Vec<[f32; 3]>> =
            model.colors().map(|colors| colors.iter().map(to_hue).collect());
        let mut surface = Self {
            points: Vec::new(),
            normals: Vec::new(),
            occurrences: Vec::new(),
            colors: hues.as_ref().map(|_| Vec::new()),
            hues,
            spacing,
        };
        for same in raw.chunk_by(|a, b| a.key == b.key) {
            let first = &same[0];
            let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
            for r in same {
                // Both sides of a thin thing can fall into one cube.
                let dot: f64 = (0..3).map(|a| first.normal[a] * r.normal[a]).sum();
                (0..3).for_each(|a| point[a] += r.point[a]);
                (0..3).for_each(|a| normal[a] += dot.signum() * r.normal[a]);
            }
            let length = vector::length(normal);
            surface.points.push(point.map(|c| (c / same.len() as f64) as f32));
            surface.normals.push(normal.map(|c| (c / length) as f32));
            surface.occurrences.push(first.occurrence);
            if let (Some(hues), Some(colors)) = (&surface.hues, &mut surface.colors) {
                colors.push(blend(same, hues, &occurrences));
            }
        }
        Ok(surface)
    }

    /// How alike two samples are in colour, 1 to 0, at a deviation of the chromas of `tolerance` grey levels; 1
    /// without colours.
    pub fn alike(&self, i: usize, j: usize, tolerance: f64) -> f64 {
        self.colors.as_ref().map_or(1.0, |colors| alike(colors[i], colors[j], tolerance))
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// The smooth piece that each sample belongs to, by the lowest sample in it; and the samples of that piece.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn pieces(&self, tree: &KdTree, progress: &dyn Progress) -> Result<(Vec<u32>, Vec<u32>)> {
        let reach = (REACH * self.spacing) as f32;
        let step = (STEP * self.spacing) as f32;
        let links: Vec<Vec<[u32; 2]>> = (0..self.len())
            .into_par_iter()
            .with_min_len(256)
            .map_init(Vec::new, |near: &mut Vec<Neighbor>, i| {
                if i % 1024 == 0 {
                    progress.check()?;
                }
                tree.within(self.points[i], reach, near);
                let smooth = |j: usize| {
                    let [a, b] = [self.normals[i], self.normals[j]];
                    let d: [f32; 3] =
                        std::array::from_fn(|k| self.points[j][k] - self.points[i][k]);
                    let [cosine, up, down] = [dot(a, b), dot(a, d), dot(b, d)];
                    cosine.abs() > SMOOTH && up.abs().max(down.abs()) < step
                };
                let later = near.iter().map(|n| n.index()).filter(|&j| j > i && smooth(j));
                Ok(later.map(|j| [i as u32, j as u32]).collect())
            })
            .collect::<Result<_>>()?;
        let mut parent: Vec<u32> = (0..self.len() as u32).collect();
        for [i, j] in links.into_iter().flatten() {
            let [a, b] = [root(&mut parent, i), root(&mut parent, j)];
            // The lowest sample stands for the piece, whatever the order of joining.
            parent[a.max(b) as usize] = a.min(b);
        }
        let piece: Vec<u32> = (0..self.len() as u32).map(|i| root(&mut parent, i)).collect();
        let mut size = vec![0; self.len()];
        piece.iter().for_each(|&p| size[p as usize] += 1);
        Ok((piece, size))
    }
}

/// How alike two colours are, 1 to 0.
pub(super) fn alike(a: [f32; 3], b: [f32; 3], tolerance: f64) -> f64 {
    let [luma, orange, green] = minus(a, b).map(f64::from);
    let squared = (luma / LIGHT).powi(2) + orange * orange + green * green;
    (-0.5 * squared / (tolerance * tolerance)).exp()
}

/// Mean colour of samples at one place; those of small words know it better.
fn blend(same: &[Raw], hues: &[[f32; 3]], occurrences: &[Occurrence]) -> [f32; 3] {
    let (mut sum, mut all) = ([0.0; 3], 0.0);
    for r in same {
        let k = r.occurrence as usize;
        let weight = occurrences[k].radius.powi(-2) as f32;
        (0..3).for_each(|c| sum[c] += weight * hues[k][c]);
        all += weight;
    }
    sum.map(|c| c / all)
}

#[derive(Clone, Copy)]
struct Raw {
    key: ([i32; 3], u8),
    point: [f64; 3],
    normal: [f64; 3],
    occurrence: u32,
}

impl Raw {
    fn new(point: [f64; 3], normal: [f64; 3], occurrence: u32, spacing: f64) -> Self {
        let cube = point.map(|c| (c / spacing).floor() as i32);
        let axis = (0..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m });
        Self { key: (cube, axis as u8), point, normal, occurrence }
    }
}

/// Rise of a word's height to the right and up.
fn slopes(word: &Word, right: f64, up: f64) -> [f64; 2] {
    if word.is_flat() {
        return [0.0; 2];
    }
    let pixel = 2.0 / PIXELS as f64;
    let rise = |dx: f64, dy: f64| {
        let ahead = word.height((right + dx).min(1.0), (up + dy).min(1.0));
        let behind = word.height((right - dx).max(-1.0), (up - dy).max(-1.0));
        let run = ((right + dx).min(1.0) - (right - dx).max(-1.0))
            + ((up + dy).min(1.0) - (up - dy).max(-1.0));
        match (ahead, behind) {
            (Some(a), Some(b)) => (a - b) / run,
            _ => 0.0,
        }
    };
    [rise(0.5 * pixel, 0.0), rise(0.0, 0.5 * pixel)]
}
