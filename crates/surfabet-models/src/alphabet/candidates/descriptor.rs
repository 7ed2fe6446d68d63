//! The descriptor of a pose: the heights of the surface over its square, seen along the normal (III-C).

use std::ops::Range;

use crate::alphabet::constants::HOLE;
use crate::alphabet::lattice::sigma;
use crate::alphabet::placement::WordPose;
use crate::alphabet::scene::{LocalPoint, descriptor_reach, whole_numbers};
use crate::alphabet::word::{HEIGHT_STEPS, MAX_HEIGHT, PIXELS, Word};

/// Pixels of a descriptor.
pub(in crate::alphabet) const N_PIXELS: usize = PIXELS * PIXELS;

/// Heights over the radius, and per pixel 1 where there is a surface, else 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::alphabet) struct Descriptor {
    pub set: [f32; N_PIXELS],
    pub heights: [f32; N_PIXELS],
}

impl Descriptor {
    /// The surface about `pose` from the points there. A pixel is set when a point within half a radius of the plane
    /// reaches it. Its height is the mean of the layer nearest to the viewer: of the points at most sigma below the
    /// highest.
    pub fn of_points(pose: &WordPose, points: &[LocalPoint]) -> Self {
        let radius = pose.radius as f32;
        let pixel = 2.0 * radius / PIXELS as f32;
        let layer = sigma(pose.level) as f32;
        let reach = descriptor_reach(pose);
        let most = f32::from(MAX_HEIGHT) / HEIGHT_STEPS as f32 * radius;
        let pixels_about = |c: f32| {
            let first = (c - reach + radius) / pixel - 0.5;
            let last = (c + reach + radius) / pixel - 0.5;
            let pixels = whole_numbers(first, last, PIXELS);
            // At most 8.
            pixels.start as u8..pixels.end as u8
        };
        // Heights, with the pixels that each reaches.
        let seen: Vec<(f32, Range<u8>, Range<u8>)> = points
            .iter()
            .filter(|p| p.height.abs() <= most)
            .map(|p| (p.height, pixels_about(p.up), pixels_about(p.right)))
            .collect();
        let mut top = [f32::NEG_INFINITY; N_PIXELS];
        for (height, rows, columns) in &seen {
            for row in rows.clone() {
                for column in columns.clone() {
                    let t = &mut top[usize::from(row) * PIXELS + usize::from(column)];
                    *t = if *height > *t { *height } else { *t };
                }
            }
        }
        let (mut sum, mut n) = ([0.0_f32; N_PIXELS], [0.0_f32; N_PIXELS]);
        for (height, rows, columns) in &seen {
            for row in rows.clone() {
                for column in columns.clone() {
                    let k = usize::from(row) * PIXELS + usize::from(column);
                    if *height >= top[k] - layer {
                        sum[k] += height;
                        n[k] += 1.0;
                    }
                }
            }
        }
        let set = n.map(|n| f32::from(u8::from(n > 0.0)));
        let heights = std::array::from_fn(|k| sum[k] / n[k].max(1.0) / radius);
        Self { set, heights }
    }

    /// The descriptor of the surface that a word stands for.
    pub fn of_word(word: &Word) -> Self {
        Self {
            set: std::array::from_fn(|k| f32::from(u8::from(word.mask >> k & 1 != 0))),
            heights: word.heights.map(|h| f32::from(h) / HEIGHT_STEPS as f32),
        }
    }

    /// Squared distance, a sum over the pixels: `min((a - b)^2, HOLE)` where both are set, [`HOLE`] where one is.
    pub fn distance(&self, other: &Self) -> f32 {
        (0..N_PIXELS)
            .map(|k| {
                let d = self.heights[k] - other.heights[k];
                let both = self.set[k] * other.set[k];
                let one = self.set[k] + other.set[k] - 2.0 * both;
                both * (d * d).min(HOLE) + one * HOLE
            })
            .sum()
    }
}
