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

/// Samples of a row that are compared with a point at a time: four single precision numbers fill a register of any x86-64
/// and ARM64, and sigma reaches about three samples.
const LANES: usize = 4;

/// The samples of a word: rows of `n` heights over the radius, not a number where the word has a hole, each row followed by
/// [`LANES`] - 1 that are none.
struct Heights {
    rows: Vec<f32>,
    /// How many are numbers.
    count: u32,
}

/// Length of a row of `n` samples in memory.
fn row_length(n: usize) -> usize {
    n + LANES - 1
}

impl Heights {
    fn new(word: &Word, n: usize) -> Self {
        let at = |i: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
        let height = |row: usize, column: usize| {
            let height = if column < n { word.height(at(column), at(row)) } else { None };
            height.map_or(f32::NAN, |h| h as f32)
        };
        let columns = row_length(n);
        let rows: Vec<f32> = (0..n * columns).map(|i| height(i / columns, i % columns)).collect();
        let count = rows.iter().filter(|h| !h.is_nan()).count() as u32;
        Self { rows, count }
    }
}

/// Words as samples, made when first asked for.
pub(in crate::alphabet) struct WordSamples<'a> {
    words: &'a [Word],
    /// Heights by word and samples per side.
    known: HashMap<(usize, usize), Heights>,
    /// Which samples explain a point, all bits of those that do; laid out as the heights.
    explains: Vec<u32>,
    /// The points that are explained, in the order in which they were given.
    explained: Vec<u32>,
    weight: u32,
    outliers: u32,
}

impl<'a> WordSamples<'a> {
    pub fn new(words: &'a [Word]) -> Self {
        Self {
            words,
            known: HashMap::new(),
            explains: Vec::new(),
            explained: Vec::new(),
            weight: 0,
            outliers: 0,
        }
    }

    /// Finds what the k-th word explains with this pose of the points about it: those with
    /// `|point - sample| <= sigma of the point`. Gives the weight and the outliers of the coverage.
    pub fn cover(
        &mut self,
        k: usize,
        pose: &WordPose,
        spacing: f64,
        points: &[LocalPoint],
    ) -> [u32; 2] {
        let (n, step) = sample_grid(pose, spacing);
        let word = &self.words[k];
        let heights = self.known.entry((k, n)).or_insert_with(|| Heights::new(word, n));
        self.explains.clear();
        self.explains.resize(heights.rows.len(), 0);
        let [radius, step] = [pose.radius, step].map(|c| c as f32);
        let highest = word.heights.iter().fold(0, |m, h| m.max(h.abs()));
        let highest = f32::from(highest) / HEIGHT_STEPS as f32 * radius;
        let grid = Grid { n, radius, step, per_step: 1.0 / step };
        self.explained.clear();
        self.weight = 0;
        for p in points {
            if p.height.abs() <= highest + p.sigma
                && grid.is_explained(p, &heights.rows, &mut self.explains)
            {
                self.explained.push(p.index);
                self.weight += u32::from(p.weight);
            }
        }
        let n_explaining = self.explains.iter().filter(|&&explains| explains != 0).count();
        self.outliers = heights.count - n_explaining as u32;
        [self.weight, self.outliers]
    }

    /// What the word explains that was asked for last.
    pub fn coverage(&mut self) -> Coverage {
        self.explained.sort_unstable();
        // Of its exact size: there are hundreds of thousands.
        let points = self.explained.clone();
        Coverage { points, weight: self.weight, outliers: self.outliers }
    }
}

/// A square of `n` x `n` samples.
struct Grid {
    n: usize,
    radius: f32,
    step: f32,
    per_step: f32,
}

impl Grid {
    /// Whether a sample is within sigma of the point; marks all that are.
    #[inline(always)]
    fn is_explained(&self, p: &LocalPoint, heights: &[f32], explains: &mut [u32]) -> bool {
        let Self { n, radius, step, per_step } = *self;
        let reach = p.sigma * per_step;
        // Rows or columns within sigma.
        let range = |c: f32| {
            let at = (c + radius) * per_step - 0.5;
            whole_numbers(at - reach, at + reach, n)
        };
        let most = p.sigma * p.sigma;
        let (rows, columns) = (range(p.up), range(p.right));
        let mut near = [0; LANES];
        for first in columns.clone().step_by(LANES) {
            // Squared distances along the row; none beyond the last column is near.
            let along: [f32; LANES] = std::array::from_fn(|lane| {
                let column = first + lane;
                let du = (column as f32 + 0.5) * step - radius - p.right;
                if column < columns.end { du * du } else { f32::INFINITY }
            });
            for row in rows.clone() {
                let dv = (row as f32 + 0.5) * step - radius - p.up;
                let at = row * row_length(n) + first;
                let heights = &heights[at..at + LANES];
                let explains = &mut explains[at..at + LANES];
                for lane in 0..LANES {
                    let dh = heights[lane] * radius - p.height;
                    // Never true of a hole: its height is not a number.
                    let is_near = along[lane] + dv * dv + dh * dh <= most;
                    let bits = if is_near { u32::MAX } else { 0 };
                    explains[lane] |= bits;
                    near[lane] |= bits;
                }
            }
        }
        near.iter().fold(0, |all, bits| all | bits) != 0
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
            let mut samples = WordSamples::new(&words);
            let counts = samples.cover(0, &pose, 1.0, &points);
            let found = samples.coverage();
            prop_assert_eq!(counts, [found.weight, found.outliers]);

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
