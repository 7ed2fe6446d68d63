//! The points of a word, from its middle outwards.

use crate::bic_alphabet::words::{BicWord, MAX_WORD_POINTS, point_step};

/// Earlier points of a word, within epsilon of one of its points, that are remembered: about as many as fit about it.
const BLOCKERS: usize = 4;

/// Points from the middle on that are compared for them, which bounds the time that a dense word takes.
const LOOKED_AT: usize = 256;

/// No earlier point.
pub(super) const NO_POINT: u16 = u16::MAX;

/// A word ready to be placed: its points in metres, those nearer to the middle, where the pose is most certain, first.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Stamp {
    pub(super) points: Vec<[f32; 3]>,
    /// For each point some before it that, when kept, leave it out wherever the word stands.
    pub(super) blockers: Vec<[u16; BLOCKERS]>,
    /// Largest distance of a point from the middle, metres.
    pub(super) reach: f32,
}

impl Stamp {
    /// The points of `word` that are to keep a distance of `epsilon` metres.
    pub fn new(word: &BicWord, radius: f64, epsilon: f64) -> Self {
        let step = point_step(radius);
        let count = word.points.len().min(MAX_WORD_POINTS);
        let mut order: Vec<u16> = (0..count).map(|k| k as u16).collect();
        order.sort_unstable_by_key(|&k| (word.squared_steps(k), k));
        let ordered: Vec<[i32; 3]> =
            order.iter().map(|&k| word.points[usize::from(k)].map(i32::from)).collect();
        let points = ordered.iter().map(|p| p.map(|c| (f64::from(c) * step) as f32)).collect();
        // A thousandth less than epsilon, so that the rounding of positions in the scene does not matter.
        let limit = (0.999 * epsilon / step).powi(2);
        let blockers = (0..count).map(|k| blockers(&ordered, k, limit)).collect();
        let last = order.last().map_or(0, |&k| word.squared_steps(k));
        Self { points, blockers, reach: (f64::from(last).sqrt() * step) as f32 }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }
}

/// The first points before the `k`-th whose squared distance from it is below `limit`.
fn blockers(points: &[[i32; 3]], k: usize, limit: f64) -> [u16; BLOCKERS] {
    let squared = |p: &[i32; 3]| (0..3).map(|a| (p[a] - points[k][a]).pow(2)).sum::<i32>();
    let mut found = [NO_POINT; BLOCKERS];
    let near = (0..k.min(LOOKED_AT)).filter(|&j| f64::from(squared(&points[j])) < limit);
    for (of, j) in found.iter_mut().zip(near) {
        *of = j as u16;
    }
    found
}
