//! What a placed word explains: the scene's points within sigma of its samples, and the samples that nothing
//! measured is near to.

use std::collections::HashMap;

use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::Stand;
use crate::alphabet::scene::local_points::NearPoint;
use crate::alphabet::word::Word;

/// What a placed word explains.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::alphabet) struct Coverage {
    /// Points with a sample within their sigma, ascending.
    pub points: Vec<u32>,
    /// Samples without a point that has them within its sigma.
    pub lone: u32,
}

/// Samples per side of a word and their distance, units: `spacing` sigma of its level, an even share of the side.
pub(in crate::alphabet) fn raster(stand: &Stand, spacing: f64) -> (usize, f64) {
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
pub(in crate::alphabet) struct Rasters<'a> {
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
        let highest = f32::from(highest) / super::super::word::HEIGHT_STEPS as f32 * radius;
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stand(level: u32) -> Stand {
        let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Stand { center: [0.0; 3], rows, radius: 256.0, level }
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
            let near: Vec<NearPoint> = (0..)
                .zip(&points)
                .map(|(index, &(right, up, height, sigma))| {
                    NearPoint { right, up, height, sigma, index }
                })
                .collect();
            let stand = stand(level);
            let found = Rasters::new(&words).coverage(0, &stand, 1.0, &near);

            let (n, step) = raster(&stand, 1.0);
            let at = |i: usize| (i as f64 + 0.5) * step - stand.radius;
            let samples: Vec<[f64; 3]> = (0..n * n)
                .filter_map(|i| {
                    let [u, v] = [at(i % n), at(i / n)];
                    let height = words[0].height(u / stand.radius, v / stand.radius)?;
                    Some([u, v, height * stand.radius])
                })
                .collect();
            let over = |p: &NearPoint, s: &[f64; 3]| {
                let d = [f64::from(p.right) - s[0], f64::from(p.up) - s[1], f64::from(p.height) - s[2]];
                d.iter().map(|c| c * c).sum::<f64>().sqrt() - f64::from(p.sigma)
            };
            // Pairs on the very limit may fall on either side in single precision.
            prop_assume!(near.iter().all(|p| samples.iter().all(|s| over(p, s).abs() > 1e-2)));
            let covered = near.iter().filter(|p| samples.iter().any(|s| over(p, s) <= 0.0));
            let covered: Vec<u32> = covered.map(|p| p.index).collect();
            let lone = samples.iter().filter(|s| near.iter().all(|p| over(p, s) > 0.0)).count();
            prop_assert_eq!(found.points, covered);
            prop_assert_eq!(found.lone as usize, lone);
        }
    }
}
