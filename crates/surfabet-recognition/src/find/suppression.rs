//! Of motions that take the example to one place, the best is kept.

use std::f64::consts::{FRAC_PI_8, TAU};

use super::motion::Motion;
use super::template::Template;
use crate::constants::{FINE_SAMPLES, OVERLAP, SAME_GUESS, SAME_PLACE};

impl Template {
    /// The best motions before the fine refinement, at most `most`; one place may keep several directions.
    pub fn best_guesses(&self, motions: Vec<(f64, Motion)>, most: usize) -> Vec<(f64, Motion)> {
        best_apart(motions, most, |a, b| {
            let turn = (a.yaw - b.yaw).rem_euclid(TAU);
            self.is_near(a, b, SAME_GUESS) && turn.min(TAU - turn) < FRAC_PI_8
        })
    }

    /// The best motions, at most `most`, one for each place.
    pub fn best_places(&self, motions: Vec<(f64, Motion)>, most: usize) -> Vec<(f64, Motion)> {
        best_apart(motions, most, |a, b| {
            self.is_near(a, b, SAME_PLACE) || self.overlap(a, b) > OVERLAP
        })
    }

    /// The best motions, at most `most`, one for each place of the pivot: the places may overlap.
    pub fn places_apart(&self, motions: Vec<(f64, Motion)>, most: usize) -> Vec<(f64, Motion)> {
        best_apart(motions, most, |a, b| self.is_near(a, b, SAME_PLACE))
    }

    /// Whether both take the pivot to within a share of the example's diagonal.
    fn is_near(&self, a: &Motion, b: &Motion, share: f64) -> bool {
        let squared: f64 = (0..3).map(|k| (a.shift[k] - b.shift[k]).powi(2)).sum();
        squared < (share * self.diagonal).powi(2)
    }

    /// The share of the example that `other` takes to where `motion` takes its region.
    fn overlap(&self, motion: &Motion, other: &Motion) -> f64 {
        let n = self.points.len().min(FINE_SAMPLES);
        let inside = |i: usize| {
            let p = self.moved(other, i).map(f64::from);
            let d = std::array::from_fn(|a| (p[a] - self.pivot[a] - motion.shift[a]) as f32);
            let arm = motion.arm_back(d);
            self.region.contains(std::array::from_fn(|a| arm[a] + self.pivot[a]))
        };
        (0..n).filter(|&i| inside(i)).count() as f64 / n as f64
    }
}

/// The motions of largest score, at most `most`, without those that are the same as a better one.
fn best_apart(
    mut motions: Vec<(f64, Motion)>,
    most: usize,
    is_same: impl Fn(&Motion, &Motion) -> bool,
) -> Vec<(f64, Motion)> {
    let order = |m: &Motion| [m.shift[0], m.shift[1], m.shift[2], m.yaw];
    motions.sort_by(|a, b| {
        let [p, q] = [order(&a.1), order(&b.1)];
        let ties = (0..4).map(|k| p[k].total_cmp(&q[k]));
        ties.fold(b.0.total_cmp(&a.0), std::cmp::Ordering::then)
    });
    let mut kept: Vec<(f64, Motion)> = Vec::new();
    for m in motions {
        if kept.len() == most {
            break;
        }
        if !kept.iter().any(|k| is_same(&k.1, &m.1)) {
            kept.push(m);
        }
    }
    kept
}
