//! Input signals (step 2): points of the cloud, drawn with equal probability and with replacement.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points to draw from.
pub(in crate::gas) struct Signals<'a> {
    /// Sets of points, none of them empty, each with the probability that a signal is drawn from it or one before it.
    sets: Vec<(&'a [[f32; 3]], f64)>,
    rng: ChaCha8Rng,
}

impl<'a> Signals<'a> {
    /// Signals from sets of points, each set with a share of the signals in proportion to its weight.
    pub(in crate::gas) fn new(sets: &[(&'a [[f32; 3]], f64)], random_state: u64) -> Self {
        let filled = || sets.iter().filter(|(points, weight)| !points.is_empty() && *weight > 0.0);
        let total: f64 = filled().map(|(_, weight)| weight).sum();
        let mut sum = 0.0;
        let sets = filled()
            .map(|&(points, weight)| {
                sum += weight;
                (points, sum / total)
            })
            .collect();
        Self { sets, rng: ChaCha8Rng::seed_from_u64(random_state) }
    }

    /// Two points at different places, the first neurons (step 1); `None` when all points are at one place.
    pub(in crate::gas) fn two_places(&mut self) -> Option<[[f32; 3]; 2]> {
        let (points, _) = *self.sets.last()?;
        let first = points[self.rng.random_range(0..points.len())];
        let start = self.rng.random_range(0..points.len());
        let (before, after) = points.split_at(start);
        let second = after.iter().chain(before).find(|p| **p != first)?;
        Some([first, *second])
    }

    /// Fills `signals` with the next ones.
    pub(in crate::gas) fn draw(&mut self, signals: &mut [[f32; 3]]) {
        // The last share is one but for rounding.
        let Some((&(last, _), others)) = self.sets.split_last() else { return };
        for signal in signals {
            let points = if others.is_empty() {
                last
            } else {
                let at: f64 = self.rng.random();
                others.iter().find(|(_, share)| at < *share).map_or(last, |(points, _)| points)
            };
            *signal = points[self.rng.random_range(0..points.len() as u32) as usize];
        }
    }
}
