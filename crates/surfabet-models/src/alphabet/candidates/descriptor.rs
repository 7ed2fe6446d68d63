//! The descriptor of a placed plane: the surface over its square, seen along the normal (III-C).

use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::Stand;
use crate::alphabet::scene::local_points::{NearPoint, look_reach};
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, PIXELS, Word};

/// Pixels of a descriptor.
pub(in crate::alphabet) const N: usize = PIXELS * PIXELS;

/// Squared distance, per pixel and in squared radii, of a surface to a hole, and of surfaces further apart than that.
pub(in crate::alphabet) const HOLE: f32 = 0.02;

/// Heights over the radius, and per pixel 1 where there is one, else 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct Patch {
    pub set: [f32; N],
    pub heights: [f32; N],
}

impl Patch {
    /// The surface about `stand` as the points near to it tell: per pixel the layer nearest to the viewer among what
    /// lies within half a radius of the plane. A pixel is set when a point lies about its middle.
    pub fn of(stand: &Stand, near: &[NearPoint]) -> Self {
        let radius = stand.radius as f32;
        let pixel = 2.0 * radius / PIXELS as f32;
        let layer = sigma(stand.level) as f32;
        let reach = look_reach(stand);
        let most = f32::from(MAX_HEIGHT) / HEIGHT_STEPS as f32 * radius;
        let range = |c: f32| {
            let first = ((c - reach + radius) / pixel - 0.5).ceil().max(0.0) as usize;
            let last = ((c + reach + radius) / pixel - 0.5).floor().min(PIXELS as f32 - 1.0);
            first..(last + 1.0).max(0.0) as usize
        };
        let seen = || near.iter().filter(|p| p.height.abs() <= most);
        let mut top = [f32::NEG_INFINITY; N];
        for p in seen() {
            for row in range(p.up) {
                for column in range(p.right) {
                    let t = &mut top[row * PIXELS + column];
                    *t = t.max(p.height);
                }
            }
        }
        let (mut sum, mut n) = ([0.0_f32; N], [0.0_f32; N]);
        for p in seen() {
            for row in range(p.up) {
                for column in range(p.right) {
                    let k = row * PIXELS + column;
                    if p.height >= top[k] - layer {
                        sum[k] += p.height;
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
