//! The descriptor of a placed plane: the surface over its square, seen along the normal (III-C).

use super::data::Data;
use super::lattice::sigma;
use super::placement::Stand;
use super::word::{HEIGHT_STEPS, MAX_HEIGHT, PIXELS, Word};

/// Pixels of a descriptor.
pub(super) const N: usize = PIXELS * PIXELS;

/// Squared distance, per pixel and in squared radii, of a surface to a hole, and of surfaces further apart than that.
pub(super) const HOLE: f32 = 0.02;

/// Heights over the radius, and per pixel 1 where there is one, else 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Patch {
    pub set: [f32; N],
    pub heights: [f32; N],
}

impl Patch {
    /// The surface about `stand` as the points `around` tell it: per pixel the layer nearest to the viewer among what
    /// lies within half a radius of the plane. A pixel is set when a point lies within sigma of its middle.
    pub fn of(data: &Data, stand: &Stand, around: &[u32]) -> Self {
        let radius = stand.radius as f32;
        let pixel = 2.0 * radius / PIXELS as f32;
        let layer = sigma(stand.level) as f32;
        let reach = (0.5 * pixel).max(0.7 * layer);
        let most = f32::from(MAX_HEIGHT) / HEIGHT_STEPS as f32 * radius;
        let local = stand.local_map();
        let range = |c: f32| {
            let first = ((c - reach + radius) / pixel - 0.5).ceil().max(0.0) as usize;
            let last = ((c + reach + radius) / pixel - 0.5).floor().min(PIXELS as f32 - 1.0);
            first..(last + 1.0).max(0.0) as usize
        };
        let mut seen: Vec<[f32; 3]> = Vec::new();
        let mut top = [f32::NEG_INFINITY; N];
        for &i in around {
            let p = local(data.points[i as usize]);
            if p[2].abs() > most || p[0].abs() > radius + reach || p[1].abs() > radius + reach {
                continue;
            }
            seen.push(p);
            for row in range(p[1]) {
                for column in range(p[0]) {
                    let t = &mut top[row * PIXELS + column];
                    *t = t.max(p[2]);
                }
            }
        }
        let (mut sum, mut n) = ([0.0_f32; N], [0.0_f32; N]);
        for [u, v, h] in seen {
            for row in range(v) {
                for column in range(u) {
                    let k = row * PIXELS + column;
                    if h >= top[k] - layer {
                        sum[k] += h;
                        n[k] += 1.0;
                    }
                }
            }
        }
        let set = n.map(|n| f32::from(u8::from(n > 0.0)));
        let heights = std::array::from_fn(|k| sum[k] / n[k].max(1.0) / radius);
        Self { set, heights }
    }

    /// What a word looks like without noise.
    pub fn of_word(word: &Word) -> Self {
        Self {
            set: std::array::from_fn(|k| f32::from(u8::from(word.mask >> k & 1 != 0))),
            heights: word.heights.map(|h| f32::from(h) / HEIGHT_STEPS as f32),
        }
    }

    /// Squared distance: of the heights where both are set, [`HOLE`] where only one is.
    pub fn distance(&self, other: &Self) -> f32 {
        (0..N)
            .map(|k| {
                let d = self.heights[k] - other.heights[k];
                let both = self.set[k] * other.set[k];
                let one = self.set[k] + other.set[k] - 2.0 * both;
                both * (d * d).min(HOLE) + one * HOLE
            })
            .sum()
    }
}
