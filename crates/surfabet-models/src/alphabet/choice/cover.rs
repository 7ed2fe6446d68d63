//! Lazy greedy cover: the candidates that explain most for their bits, and their redundancy removed.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use surfabet_geom::Progress;

use crate::alphabet::candidates::Candidate;
use crate::error::Result;

/// What explaining is worth, and what saying costs, in bits.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct Prices {
    /// A point explained for the first time.
    pub point: f32,
    /// A sample near to nothing.
    pub lone: f32,
    /// An occurrence, per scale, without its word.
    pub occurrence: Vec<f32>,
    /// Which word it is, per word.
    pub word: Vec<f32>,
}

impl Prices {
    /// What a candidate costs whatever else is there.
    pub fn cost(&self, candidate: &Candidate) -> f32 {
        let p = &candidate.placement;
        self.occurrence[usize::from(p.scale)]
            + self.word[usize::from(p.word)]
            + self.lone * candidate.coverage.lone as f32
    }
}

/// How often each point is explained by what is chosen.
pub(in crate::alphabet) struct Tally {
    times: Vec<u16>,
}

impl Tally {
    pub fn new(n_points: usize) -> Self {
        Self { times: vec![0; n_points] }
    }

    pub fn add(&mut self, points: &[u32]) {
        points.iter().for_each(|&i| self.times[i as usize] += 1);
    }

    pub fn remove(&mut self, points: &[u32]) {
        points.iter().for_each(|&i| self.times[i as usize] -= 1);
    }

    /// How many of `points` are explained `n` times.
    pub fn count(&self, points: &[u32], n: u16) -> f32 {
        points.iter().filter(|&&i| self.times[i as usize] == n).count() as f32
    }

    /// How many points of the scene nothing explains.
    pub fn unexplained(&self) -> f32 {
        self.times.iter().filter(|&&times| times == 0).count() as f32
    }
}

struct Entry {
    gain: f32,
    candidate: u32,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.gain.total_cmp(&other.gain).then(other.candidate.cmp(&self.candidate))
    }
}

/// Chooses candidates one by one, always the one that gains most; ascending indices, and the tally of them.
///
/// A gain only falls as others are chosen, so that an old gain is a bound: only the top of the heap is looked at anew.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(in crate::alphabet) fn cover(
    candidates: &[Candidate],
    prices: &Prices,
    n_points: usize,
    progress: &dyn Progress,
) -> Result<(Vec<u32>, Tally)> {
    let mut tally = Tally::new(n_points);
    let cost: Vec<f32> = candidates.iter().map(|c| prices.cost(c)).collect();
    let mut heap: BinaryHeap<Entry> = candidates
        .iter()
        .zip(&cost)
        .enumerate()
        .map(|(k, (c, cost))| Entry {
            gain: prices.point * c.coverage.points.len() as f32 - cost,
            candidate: k as u32,
        })
        .filter(|e| e.gain > 0.0)
        .collect();
    let mut chosen = Vec::new();
    while let Some(top) = heap.pop() {
        progress.check()?;
        let k = top.candidate as usize;
        let points = &candidates[k].coverage.points;
        let now = prices.point * tally.count(points, 0) - cost[k];
        if now <= 0.0 {
            continue;
        }
        if heap.peek().is_some_and(|next| now < next.gain) {
            heap.push(Entry { gain: now, ..top });
            continue;
        }
        tally.add(points);
        chosen.push(top.candidate);
    }
    remove_redundant(candidates, &cost, prices.point, &mut chosen, &mut tally, progress)?;
    chosen.sort_unstable();
    Ok((chosen, tally))
}

/// What later ones made redundant goes, the least useful first.
fn remove_redundant(
    candidates: &[Candidate],
    cost: &[f32],
    point: f32,
    chosen: &mut Vec<u32>,
    tally: &mut Tally,
    progress: &dyn Progress,
) -> Result<()> {
    let worth = |k: u32, tally: &Tally| {
        let alone = tally.count(&candidates[k as usize].coverage.points, 1);
        point * alone - cost[k as usize]
    };
    // As others go, worth only grows: sorted once, each is looked at once more.
    let mut order: Vec<(f32, u32)> = chosen.iter().map(|&k| (worth(k, tally), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (_, k) in order.into_iter().take_while(|(worth, _)| *worth < 0.0) {
        progress.check()?;
        if worth(k, tally) < 0.0 {
            tally.remove(&candidates[k as usize].coverage.points);
            chosen.retain(|&c| c != k);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_geom::Silent;

    use super::*;
    use crate::alphabet::candidates::coverage::Coverage;
    use crate::alphabet::placement::{Placement, Stand};

    fn candidate(offset: i32, points: Vec<u32>, lone: u32) -> Candidate {
        let placement =
            Placement { scale: 0, cell: [0; 3], axis: 0, slopes: [0; 2], offset, word: 0, view: 0 };
        let stand = Stand { center: [0.0; 3], rows: [[0.0; 3]; 3], radius: 1.0, level: 0 };
        Candidate { placement, stand, coverage: Coverage { points, lone } }
    }

    fn prices() -> Prices {
        Prices { point: 2.0, lone: 1.0, occurrence: vec![5.0], word: vec![0.5] }
    }

    /// Bits of what is not explained, of false samples, and of the occurrences.
    fn length(all: &[Candidate], chosen: &[u32], n: usize) -> f32 {
        let prices = prices();
        let mut explained = vec![false; n];
        let mut sum = 0.0;
        for &k in chosen {
            sum += prices.cost(&all[k as usize]);
            all[k as usize].coverage.points.iter().for_each(|&i| explained[i as usize] = true);
        }
        sum + prices.point * explained.iter().filter(|&&e| !e).count() as f32
    }

    #[test]
    fn the_better_of_two_for_the_same_points_is_taken() {
        let same: Vec<u32> = (0..10).collect();
        let all = [candidate(0, same.clone(), 3), candidate(1, same, 1), candidate(2, vec![0], 0)];
        assert_eq!(cover(&all, &prices(), 10, &Silent).unwrap().0, [1]);
    }

    #[test]
    fn what_later_ones_make_redundant_goes() {
        // The first gains most at first; the two others explain all of it, and more.
        let all = [
            candidate(0, (4..16).collect(), 0),
            candidate(1, (0..10).collect(), 0),
            candidate(2, (10..20).collect(), 0),
        ];
        assert_eq!(cover(&all, &prices(), 20, &Silent).unwrap().0, [1, 2]);
    }

    proptest! {
        #[test]
        fn the_description_never_gets_longer(
            sets in prop::collection::vec((prop::collection::btree_set(0_u32..30, 0..12), 0_u32..4), 0..12),
        ) {
            let one = |(k, (points, lone)): (usize, &(std::collections::BTreeSet<u32>, u32))| {
                candidate(k as i32, points.iter().copied().collect(), *lone)
            };
            let all: Vec<Candidate> = sets.iter().enumerate().map(one).collect();
            let (chosen, tally) = cover(&all, &prices(), 30, &Silent).unwrap();
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
            prop_assert_eq!(tally.unexplained(), (0..30).filter(|&i| explained(i) == 0).count() as f32);
            for i in 0..30 {
                prop_assert_eq!(tally.count(&[i], explained(i) as u16), 1.0);
            }
        }
    }
}
