//! Lazy greedy cover: the candidates that shorten the description most, without redundant ones (III-D).
//!
//! With S the chosen candidates, P(c) the points that c explains, and P(S) those that any in S explains, the length to
//! be minimised is
//!
//! ```text
//! L(S) = inlier * (number of points not in P(S)) + sum over c in S of cost(c)
//! cost(c) = occurrence[scale of c] + word[word of c] + outlier * (outliers of c)
//! ```
//!
//! with the prices of [`Prices`].

use std::collections::{BinaryHeap, HashSet};

use surfabet_geom::Progress;

use super::prices::Prices;
use crate::alphabet::candidates::Candidate;
use crate::error::Result;

/// How many of the chosen candidates explain each point.
pub(in crate::alphabet) struct CoverCounts {
    counts: Vec<Count>,
    /// Weights of the points that none explains, zero for the others: what most sums are of, without a branch per point.
    open: Vec<u16>,
}

#[derive(Clone, Copy)]
struct Count {
    /// How many candidates explain the point.
    explained: u16,
    /// How many points of the scan it counts for.
    weight: u16,
}

impl CoverCounts {
    /// No candidate explains any of the points with these weights.
    pub fn new(weights: &[u16]) -> Self {
        let counts = weights.iter().map(|&weight| Count { explained: 0, weight }).collect();
        Self { counts, open: weights.to_vec() }
    }

    pub fn add(&mut self, points: &[u32]) {
        for &i in points {
            self.counts[i as usize].explained += 1;
            self.open[i as usize] = 0;
        }
    }

    pub fn remove(&mut self, points: &[u32]) {
        for &i in points {
            let count = &mut self.counts[i as usize];
            count.explained -= 1;
            if count.explained == 0 {
                self.open[i as usize] = count.weight;
            }
        }
    }

    /// Whether a candidate explains point `i`.
    pub fn is_explained(&self, i: u32) -> bool {
        self.counts[i as usize].explained > 0
    }

    /// How many of `points` no candidate explains, with their weights.
    pub fn n_open(&self, points: &[u32]) -> f32 {
        points.iter().map(|&i| u64::from(self.open[i as usize])).sum::<u64>() as f32
    }

    /// How many of `points` exactly one candidate explains, with their weights.
    pub fn n_explained_once(&self, points: &[u32]) -> f32 {
        let weight = |c: Count| u64::from(c.explained == 1) * u64::from(c.weight);
        points.iter().map(|&i| weight(self.counts[i as usize])).sum::<u64>() as f32
    }

    /// How many points of the scene are not explained, with their weights.
    pub fn n_unexplained(&self) -> f32 {
        self.open.iter().map(|&weight| u64::from(weight)).sum::<u64>() as f32
    }
}

/// A candidate with its gain when that was last computed, above 0; ordered by gain, of equal ones the first candidate on
/// top: positive floats order like their bits.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct CandidateGain(u64);

impl CandidateGain {
    fn new(gain: f32, candidate: u32) -> Self {
        Self(u64::from(gain.to_bits()) << 32 | u64::from(!candidate))
    }

    fn gain(&self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    fn candidate(&self) -> u32 {
        !(self.0 as u32)
    }
}

/// Chooses candidates one by one, always the one with the largest gain, as long as that is above 0:
///
/// ```text
/// gain(c | S) = L(S) - L(S + c) = inlier * |P(c) without P(S)| - cost(c)
/// ```
///
/// Gives ascending indices, and the counts of these candidates. A gain only falls as others are chosen, so an old gain is
/// an upper bound: only the top of the heap is computed anew.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn cover(
    candidates: &[Candidate],
    prices: &Prices,
    weights: &[u16],
    progress: &dyn Progress,
) -> Result<(Vec<u32>, CoverCounts)> {
    let mut counts = CoverCounts::new(weights);
    let candidates: Vec<&Candidate> = candidates.iter().collect();
    let mut chosen = add_best(&candidates, prices, &mut counts, progress)?;
    remove_redundant(&candidates, prices, &mut chosen, &mut counts, progress)?;
    chosen.sort_unstable();
    Ok((chosen, counts))
}

/// Chooses candidates one by one, beside those that are counted already, and counts them; in the order in which they
/// were chosen.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(in crate::alphabet) fn add_best(
    candidates: &[&Candidate],
    prices: &Prices,
    counts: &mut CoverCounts,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    // Beside one another, as candidates are not.
    let cost: Vec<f32> = candidates.iter().map(|c| prices.cost(c)).collect();
    let points: Vec<&[u32]> = candidates.iter().map(|c| &c.coverage.points[..]).collect();
    let entry = |(k, (c, cost)): (usize, (&&Candidate, &f32))| {
        let gain = prices.inlier * c.coverage.weight as f32 - cost;
        (gain > 0.0).then(|| CandidateGain::new(gain, k as u32))
    };
    let mut heap: BinaryHeap<CandidateGain> =
        candidates.iter().zip(&cost).enumerate().filter_map(entry).collect();
    let mut chosen = Vec::new();
    while let Some(top) = heap.pop() {
        progress.check()?;
        let candidate = top.candidate();
        let k = candidate as usize;
        let now = prices.inlier * counts.n_open(points[k]) - cost[k];
        if now <= 0.0 {
            continue;
        }
        if heap.peek().is_some_and(|next| now < next.gain()) {
            heap.push(CandidateGain::new(now, candidate));
            continue;
        }
        counts.add(points[k]);
        chosen.push(candidate);
    }
    Ok(chosen)
}

/// Removes what later candidates made redundant, the least useful first: c goes when its worth is below 0,
///
/// ```text
/// worth(c) = L(S - c) - L(S) = inlier * |points of P(c) that no other in S explains| - cost(c)
/// ```
fn remove_redundant(
    candidates: &[&Candidate],
    prices: &Prices,
    chosen: &mut Vec<u32>,
    counts: &mut CoverCounts,
    progress: &dyn Progress,
) -> Result<()> {
    let worth = |k: u32, counts: &CoverCounts| {
        let candidate = candidates[k as usize];
        let alone = counts.n_explained_once(&candidate.coverage.points);
        prices.inlier * alone - prices.cost(candidate)
    };
    // As others go, a worth only grows: each needs to be computed once more.
    let mut order: Vec<(f32, u32)> = chosen.iter().map(|&k| (worth(k, counts), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut removed = HashSet::new();
    for (_, k) in order.into_iter().take_while(|(worth, _)| *worth < 0.0) {
        progress.check()?;
        if worth(k, counts) < 0.0 {
            counts.remove(&candidates[k as usize].coverage.points);
            removed.insert(k);
        }
    }
    chosen.retain(|k| !removed.contains(k));
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::Silent;

    use super::*;
    use crate::alphabet::candidates::Coverage;
    use crate::alphabet::placement::{Placement, WordPose};

    fn candidate(offset: i32, points: Vec<u32>, outliers: u32) -> Candidate {
        let placement =
            Placement { scale: 0, cell: [0; 3], axis: 0, slopes: [0; 2], offset, word: 0, view: 0 };
        let pose = WordPose { center: [0.0; 3], rows: [[0.0; 3]; 3], radius: 1.0, level: 0 };
        Candidate {
            placement,
            pose,
            coverage: Coverage { weight: points.len() as u32, points, outliers },
        }
    }

    fn prices() -> Prices {
        Prices { inlier: 2.0, outlier: 1.0, occurrence: vec![5.0], word: vec![0.5] }
    }

    /// L(S).
    fn length(all: &[Candidate], chosen: &[u32], n: usize) -> f32 {
        let prices = prices();
        let mut explained = vec![false; n];
        let mut sum = 0.0;
        for &k in chosen {
            sum += prices.cost(&all[k as usize]);
            all[k as usize].coverage.points.iter().for_each(|&i| explained[i as usize] = true);
        }
        sum + prices.inlier * explained.iter().filter(|&&e| !e).count() as f32
    }

    #[test]
    fn the_better_of_two_for_the_same_points_is_taken() {
        let same: Vec<u32> = (0..10).collect();
        let all = [candidate(0, same.clone(), 3), candidate(1, same, 1), candidate(2, vec![0], 0)];
        assert_eq!(cover(&all, &prices(), &[1; 10], &Silent).unwrap().0, [1]);
    }

    #[test]
    fn what_later_ones_make_redundant_goes() {
        // The first gains most at first; the two others explain all of it, and more.
        let all = [
            candidate(0, (4..16).collect(), 0),
            candidate(1, (0..10).collect(), 0),
            candidate(2, (10..20).collect(), 0),
        ];
        assert_eq!(cover(&all, &prices(), &[1; 20], &Silent).unwrap().0, [1, 2]);
    }

    proptest! {
        #[test]
        fn the_description_never_gets_longer(
            sets in prop::collection::vec((prop::collection::btree_set(0_u32..30, 0..12), 0_u32..4), 0..12),
        ) {
            let one = |(k, (points, outliers)): (usize, &(std::collections::BTreeSet<u32>, u32))| {
                candidate(k as i32, points.iter().copied().collect(), *outliers)
            };
            let all: Vec<Candidate> = sets.iter().enumerate().map(one).collect();
            let (chosen, counts) = cover(&all, &prices(), &[1; 30], &Silent).unwrap();
            let best = length(&all, &chosen, 30);
            prop_assert!(best <= length(&all, &[], 30));
            // Nor would it be shorter without any one of them.
            for k in &chosen {
                let others: Vec<u32> = chosen.iter().copied().filter(|c| c != k).collect();
                prop_assert!(best <= length(&all, &others, 30) + 1e-3);
            }
            let explained = |i: u32| {
                chosen.iter().filter(|&&k| all[k as usize].coverage.points.contains(&i)).count()
            };
            prop_assert_eq!(counts.n_unexplained(), (0..30).filter(|&i| explained(i) == 0).count() as f32);
            for i in 0..30 {
                prop_assert_eq!(counts.n_open(&[i]), f32::from(u8::from(explained(i) == 0)));
                prop_assert_eq!(counts.n_explained_once(&[i]), f32::from(u8::from(explained(i) == 1)));
            }
        }
    }
}
