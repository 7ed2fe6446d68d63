//! What an occurrence explains (eq. 13): the points of the scene with a sample of the word within their sigma; and its
//! outliers, the samples that explain no point.

use std::collections::HashMap;

use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::WordPose;
use crate::alphabet::scene::{LocalPoint, whole_numbers};
use crate::alphabet::word::{HEIGHT_STEPS, Word};

/// What an occurrence explains.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::alphabet) struct Coverage {
    /// Points with a sample within their sigma, ascending.
    pub points: Vec<u32>,
    /// How many points of the scan these count for.
    pub weight: u32,
    /// Samples of the word that are within the sigma of no point.
    pub outliers: u32,
}

/// Samples per side of a word, and their distance in units: the even share of the side that is nearest to `spacing`
/// times sigma.
pub(in crate::alphabet) fn sample_grid(pose: &WordPose, spacing: f64) -> (usize, f64) {
    let side = 2.0 * pose.radius;
    let n = (side / (spacing * sigma(pose.level))).round().max(1.0);
    (n as usize, side / n)
}

/// Height of every sample over the radius, row by row; not a number where the word has a hole.
fn samples(word: &Word, n: usize) -> Vec<f32> {
    let at = |i: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
    (0..n * n).map(|i| word.height(at(i % n), at(i / n)).map_or(f32::NAN, |h| h as f32)).collect()
}

/// Words as samples, made when first asked for.
pub(in crate::alphabet) struct WordSamples<'a> {
    words: &'a [Word],
    /// Heights by word and samples per side.
    known: HashMap<(usize, usize), Vec<f32>>,
    /// Buffer: which samples explain a point.
    explains: Vec<bool>,
    /// Buffer: the points that are explained.
    explained: Vec<u32>,
}

impl<'a> WordSamples<'a> {
    pub fn new(words: &'a [Word]) -> Self {
        Self { words, known: HashMap::new(), explains: Vec::new(), explained: Vec::new() }
    }

    /// What the k-th word explains with this pose, of the points about it: those with
    /// `|point - sample| <= sigma of the point`.
    pub fn coverage(
        &mut self,
        k: usize,
        pose: &WordPose,
        spacing: f64,
        points: &[LocalPoint],
    ) -> Coverage {
        let (n, step) = sample_grid(pose, spacing);
        let word = &self.words[k];
        let heights = &*self.known.entry((k, n)).or_insert_with(|| samples(word, n));
        self.explains.clear();
        self.explains.resize(n * n, false);
        let [radius, step] = [pose.radius, step].map(|c| c as f32);
        let per_step = 1.0 / step;
        let highest = word.heights.iter().fold(0, |m, h| m.max(h.abs()));
        let highest = f32::from(highest) / HEIGHT_STEPS as f32 * radius;
        self.explained.clear();
        let mut weight = 0;
        for p in points {
            if p.height.abs() > highest + p.sigma {
                continue;
            }
            let reach = p.sigma * per_step;
            // Rows or columns within sigma.
            let range = |c: f32| {
                let at = (c + radius) * per_step - 0.5;
                whole_numbers(at - reach, at + reach, n)
            };
            let most = p.sigma * p.sigma;
            let (rows, columns) = (range(p.up), range(p.right));
            let mut is_explained = false;
            if columns.is_empty() {
                continue;
            }
            for row in rows {
                let dv = (row as f32 + 0.5) * step - radius - p.up;
                let heights = &heights[row * n..][columns.clone()];
                let explains = &mut self.explains[row * n..][columns.clone()];
                for (column, (height, explains)) in
                    columns.clone().zip(heights.iter().zip(explains))
                {
                    let du = (column as f32 + 0.5) * step - radius - p.right;
                    let dh = height * radius - p.height;
                    // Never true of a hole: its height is not a number.
                    let is_near = du * du + dv * dv + dh * dh <= most;
                    is_explained |= is_near;
                    *explains |= is_near;
                }
            }
            if is_explained {
                self.explained.push(p.index);
                weight += u32::from(p.weight);
            }
        }
        self.explained.sort_unstable();
        let n_samples = heights.iter().filter(|h| !h.is_nan()).count();
        let n_explaining = self.explains.iter().filter(|&&explains| explains).count();
        let outliers = (n_samples - n_explaining) as u32;
        // Of its exact size: there are hundreds of thousands.
        Coverage { points: self.explained.clone(), weight, outliers }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn pose(level: u32) -> WordPose {
        let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        WordPose { center: [0.0; 3], rows, radius: 256.0, level }
    }

    proptest! {
        #[test]
        fn is_what_comparing_all_with_all_gives(
            points in prop::collection::vec(
                (-400.0_f32..400.0, -400.0_f32..400.0, -150.0_f32..150.0, 10.0_f32..120.0),
                0..60,
            ),
            mask in any::<u64>(),
            bump in -16_i8..=16,
            level in 8_u32..14,
        ) {
            let height = |k: usize| if mask >> k & 1 != 0 && k.is_multiple_of(3) { bump } else { 0 };
            let words = [Word { mask: mask | 1, heights: std::array::from_fn(height) }];
            let points: Vec<LocalPoint> = (0..)
                .zip(&points)
                .map(|(index, &(right, up, height, sigma))| {
                    LocalPoint { right, up, height, sigma, index, weight: (index % 3 + 1) as u16 }
                })
                .collect();
            let pose = pose(level);
            let found = WordSamples::new(&words).coverage(0, &pose, 1.0, &points);

            let (n, step) = sample_grid(&pose, 1.0);
            let at = |i: usize| (i as f64 + 0.5) * step - pose.radius;
            let samples: Vec<[f64; 3]> = (0..n * n)
                .filter_map(|i| {
                    let [u, v] = [at(i % n), at(i / n)];
                    let height = words[0].height(u / pose.radius, v / pose.radius)?;
                    Some([u, v, height * pose.radius])
                })
                .collect();
            let over = |p: &LocalPoint, s: &[f64; 3]| {
                let d = [f64::from(p.right) - s[0], f64::from(p.up) - s[1], f64::from(p.height) - s[2]];
                d.iter().map(|c| c * c).sum::<f64>().sqrt() - f64::from(p.sigma)
            };
            // Pairs on the very limit may fall on either side in single precision.
            prop_assume!(points.iter().all(|p| samples.iter().all(|s| over(p, s).abs() > 1e-2)));
            let covered = points.iter().filter(|p| samples.iter().any(|s| over(p, s) <= 0.0));
            let covered: Vec<u32> = covered.map(|p| p.index).collect();
            let outliers = samples.iter().filter(|s| points.iter().all(|p| over(p, s) > 0.0)).count();
            let weight: u32 = covered.iter().map(|index| index % 3 + 1).sum();
            prop_assert_eq!(found.weight, weight);
            prop_assert_eq!(found.points, covered);
            prop_assert_eq!(found.outliers as usize, outliers);
        }
    }
}
