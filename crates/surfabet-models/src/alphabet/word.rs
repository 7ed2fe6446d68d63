//! A word: a small height map with a mask, in units of its radius, so that it can occur at every scale.

/// Pixels per side of a word.
pub const PIXELS: usize = 8;

/// Heights are whole 32nds of the radius.
pub const HEIGHT_STEPS: f64 = 32.0;

/// Largest height of a pixel: half the radius.
pub const MAX_HEIGHT: i8 = 16;

/// A recurrent piece of surface over the square of two radii.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Word {
    /// Set pixels, bit `row * 8 + column`; rows go up, columns right.
    pub mask: u64,
    /// Height over the word's plane per pixel, 32nds of the radius; zero where not set.
    pub heights: [i8; PIXELS * PIXELS],
}

impl Word {
    /// The word of every alphabet: a whole plane.
    pub fn plane() -> Self {
        Self { mask: u64::MAX, heights: [0; PIXELS * PIXELS] }
    }

    /// Height at a point of the square, over the radius: bilinear between those of the four pixels around it that are
    /// set, their weights brought to a sum of one. `None` where the nearest pixel is a hole.
    ///
    /// `right` and `up` are in radii, -1 to 1.
    pub fn height(&self, right: f64, up: f64) -> Option<f64> {
        let half = PIXELS as f64 / 2.0;
        let last = PIXELS as f64 - 1.0;
        let [x, y] = [right, up].map(|c| (c + 1.0) * half - 0.5);
        let [column, row] = [x, y].map(|c| c.round().clamp(0.0, last) as usize);
        if self.mask >> (row * PIXELS + column) & 1 == 0 {
            return None;
        }
        if self.is_flat() {
            return Some(0.0);
        }
        let [left, below] = [x, y].map(|c| c.clamp(0.0, last).floor().min(last - 1.0));
        let [a, b] = [x.clamp(0.0, last) - left, y.clamp(0.0, last) - below];
        let first = below as usize * PIXELS + left as usize;
        let around = [
            (first, (1.0 - a) * (1.0 - b)),
            (first + 1, a * (1.0 - b)),
            (first + PIXELS, (1.0 - a) * b),
            (first + PIXELS + 1, a * b),
        ];
        let set = around.iter().filter(|(pixel, _)| self.mask >> pixel & 1 != 0);
        let (sum, weight) = set.fold((0.0, 0.0), |(sum, weight), &(pixel, w)| {
            (sum + w * f64::from(self.heights[pixel]), weight + w)
        });
        // The nearest pixel is set and weighs at least a quarter.
        Some(sum / weight / HEIGHT_STEPS)
    }

    /// True when no pixel rises over the plane.
    pub fn is_flat(&self) -> bool {
        self.heights.iter().all(|&h| h == 0)
    }
}
