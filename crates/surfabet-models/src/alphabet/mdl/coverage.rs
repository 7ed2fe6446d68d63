//! What a placed word explains: the scene's points within sigma of its samples, and the samples that nothing
//! measured is near to.

use super::data::Data;
use super::lattice::sigma;
use super::placement::Stand;
use super::word::Word;

/// What a placed word explains.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Coverage {
    /// Points with a sample within their sigma, ascending.
    pub points: Vec<u32>,
    /// Samples that the word decodes to.
    pub samples: u32,
    /// Samples without a point that has them within its sigma.
    pub lone: u32,
}

/// Samples per side of a word and their distance, units: one sigma of its level, an even share of the side.
pub(super) fn raster(stand: &Stand, spacing: f64) -> (usize, f64) {
    let side = 2.0 * stand.radius;
    let n = (side / (spacing * sigma(stand.level))).round().max(1.0);
    (n as usize, side / n)
}

/// Buffers of [`Coverage::of`].
#[derive(Default)]
pub(super) struct Scratch {
    heights: Vec<f32>,
    near: Vec<bool>,
}

impl Coverage {
    /// Of `word` at `stand`, among the points `around`.
    pub fn of(
        data: &Data,
        stand: &Stand,
        word: &Word,
        spacing: f64,
        around: &[u32],
        scratch: &mut Scratch,
    ) -> Self {
        let (n, step) = raster(stand, spacing);
        let at = |i: usize| (i as f64 + 0.5) * step - stand.radius;
        scratch.heights.clear();
        for i in 0..n * n {
            let [right, up] = [i % n, i / n].map(|i| at(i) / stand.radius);
            let height = word.height(right, up).map_or(f64::NAN, |h| h * stand.radius);
            scratch.heights.push(height as f32);
        }
        scratch.near.clear();
        scratch.near.resize(n * n, false);
        let highest =
            scratch.heights.iter().filter(|h| !h.is_nan()).fold(0.0_f32, |m, h| m.max(h.abs()));
        let local = stand.local_map();
        let mut points = Vec::new();
        for &i in around {
            let sigma = data.sigma[i as usize];
            let [u, v, h] = local(data.points[i as usize]);
            let reach = stand.radius as f32 + sigma;
            if h.abs() > highest + sigma || u.abs() > reach || v.abs() > reach {
                continue;
            }
            let step = step as f32;
            let range = |c: f32| {
                let place = (c + stand.radius as f32) / step - 0.5;
                let first = (place - sigma / step).ceil().max(0.0) as usize;
                let last = (place + sigma / step).floor().min(n as f32 - 1.0);
                first..(last + 1.0).max(0.0) as usize
            };
            let mut covered = false;
            for row in range(v) {
                let dv = (row as f32 + 0.5) * step - stand.radius as f32 - v;
                for column in range(u) {
                    let du = (column as f32 + 0.5) * step - stand.radius as f32 - u;
                    let sample = row * n + column;
                    let dh = scratch.heights[sample] - h;
                    // Not for a hole: its height is not a number.
                    if du * du + dv * dv + dh * dh <= sigma * sigma {
                        covered = true;
                        scratch.near[sample] = true;
                    }
                }
            }
            if covered {
                points.push(i);
            }
        }
        points.sort_unstable();
        let samples = scratch.heights.iter().filter(|h| !h.is_nan()).count();
        let near = scratch.near.iter().filter(|&&n| n).count();
        Self { points, samples: samples as u32, lone: (samples - near) as u32 }
    }
}
