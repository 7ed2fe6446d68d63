//! The points of a word at its poses (eq. 2), with the rank that decides which of two near points is kept.

use crate::bic_alphabet::pose::Frame;
use crate::bic_alphabet::words::{BicWord, point_step};

/// A point of an occurrence, in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::bic_alphabet) struct PlacedPoint {
    pub position: [f32; 3],
    /// Squared distance from the word's middle (16 bits), occurrence (32 bits), number in the word (16 bits). Smaller
    /// comes first; no two points have the same.
    pub rank: u64,
    /// The feature or occurrence that it belongs to.
    pub owner: u32,
}

/// A word ready to be placed: its points that may appear (see [`BicWord::thinned`]) in metres, with what they
/// contribute to the rank.
#[derive(Debug, Clone)]
pub(in crate::bic_alphabet) struct Stamp {
    points: Vec<([f32; 3], u64)>,
}

impl Stamp {
    pub fn new(word: &BicWord, radius: f64, epsilon: f64) -> Self {
        let step = point_step(radius);
        let metres = |k: u16| word.points[usize::from(k)].map(|c| (f64::from(c) * step) as f32);
        let kept = word.thinned(radius, epsilon);
        let points = kept
            .into_iter()
            .map(|k| (metres(k), u64::from(word.squared_steps(k)) << 48 | u64::from(k)))
            .collect();
        Self { points }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Appends `T_j s` (eq. 2) for the frames `T_j` of `owners`, which ascend, in the order of the ranks.
    pub fn place(&self, frames: &[Frame], owners: &[u32], out: &mut Vec<PlacedPoint>) {
        out.reserve(self.len() * owners.len());
        for same_distance in self.points.chunk_by(|a, b| a.1 >> 48 == b.1 >> 48) {
            for &owner in owners {
                let frame = &frames[owner as usize];
                out.extend(same_distance.iter().map(|&(q, rank)| PlacedPoint {
                    position: frame.place(q),
                    rank: rank | u64::from(owner) << 16,
                    owner,
                }));
            }
        }
    }
}
