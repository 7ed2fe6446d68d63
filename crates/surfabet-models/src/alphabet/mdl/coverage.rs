//! What a placed word explains: the scene's points within sigma of its samples, and the samples that nothing
//! measured is near to.

use std::collections::HashMap;

use super::lattice::sigma;
use super::near::NearPoint;
use super::placement::Stand;
use super::word::Word;

/// What a placed word explains.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Coverage {
    /// Points with a sample within their sigma, ascending.
    pub points: Vec<u32>,
    /// Samples without a point that has them within its sigma.
    pub lone: u32,
}

/// Samples per side of a word and their distance, units: `spacing` sigma of its level, an even share of the side.
pub(super) fn raster(stand: &Stand, spacing: f64) -> (usize, f64) {
    let side = 2.0 * stand.radius;
    let n = (side / (spacing * sigma(stand.level))).round().max(1.0);
    (n as usize, side / n)
}

/// Height of every sample over the radius, row by row; not a number where the word has a hole.
fn samples(word: &Word, n: usize) -> Vec<f32> {
    let at = |i: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
    (0..n * n).map(|i| word.height(at(i % n), at(i / n)).map_or(f32::NAN, |h| h as f32)).collect()
}

/// Words as samples, made when first asked for, and a buffer.
pub(super) struct Rasters<'a> {
    words: &'a [Word],
    known: HashMap<(usize, usize), Vec<f32>>,
    is_near: Vec<bool>,
}

impl<'a> Rasters<'a> {
    pub fn new(words: &'a [Word]) -> Self {
        Self { words, known: HashMap::new(), is_near: Vec::new() }
    }

    /// What the k-th word explains at `stand`, of the points near to it.
    pub fn coverage(
        &mut self,
        k: usize,
        stand: &Stand,
        spacing: f64,
        near: &[NearPoint],
    ) -> Coverage {
        let (n, step) = raster(stand, spacing);
        let word = &self.words[k];
        let heights = &*self.known.entry((k, n)).or_insert_with(|| samples(word, n));
        self.is_near.clear();
        self.is_near.resize(n * n, false);
        let [radius, step] = [stand.radius, step].map(|c| c as f32);
        let per_step = 1.0 / step;
        let last = n as f32 - 1.0;
        let highest = word.heights.iter().fold(0, |m, h| m.max(h.abs()));
        let highest = f32::from(highest) / super::word::HEIGHT_STEPS as f32 * radius;
        let mut points = Vec::new();
        for p in near {
            if p.height.abs() > highest + p.sigma {
                continue;
            }
            let reach = p.sigma * per_step;
            let range = |c: f32| {
                let place = (c + radius) * per_step - 0.5;
                let first = (place - reach).ceil().max(0.0);
                let end = (place + reach).floor().min(last) + 1.0;
                first as usize..end.max(0.0) as usize
            };
            let most = p.sigma * p.sigma;
            let columns = range(p.right);
            let mut covered = false;
            for row in range(p.up) {
                let dv = (row as f32 + 0.5) * step - radius - p.up;
                for column in columns.clone() {
                    let du = (column as f32 + 0.5) * step - radius - p.right;
                    let sample = row * n + column;
                    let dh = heights[sample] * radius - p.height;
                    // Never for a hole.
                    if du * du + dv * dv + dh * dh <= most {
                        covered = true;
                        self.is_near[sample] = true;
                    }
                }
            }
            if covered {
                points.push(p.index);
            }
        }
        points.sort_unstable();
        let there = heights.iter().filter(|h| !h.is_nan()).count();
        let found = self.is_near.iter().filter(|&&near| near).count();
        Coverage { points, lone: (there - found) as u32 }
    }
}
