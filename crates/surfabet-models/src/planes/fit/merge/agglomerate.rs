//! Joins parts, the flattest union first, until no two are one plane (section II-D, step 2).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;
use surfabet_geom::Progress;

use super::rule::{Part, Rule};
use crate::error::Result;
use surfabet_geom::disjoint::root;

/// Pairs tested between two checks for cancellation.
const PAIRS_PER_CHECK: usize = 4096;

/// A squared distance, with a total order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cost(f64);

impl Eq for Cost {}

impl Ord for Cost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Cost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// A pair of parts to join: its cost, the parts, and how often each had been joined when the cost was computed.
type Candidate = Reverse<(Cost, [u32; 2], [u32; 2])>;

/// Joins neighbouring parts, those first whose union is flattest, until no pair is left that `rule` allows. Gives
/// the part that each has become, numbered by its first member.
pub(in crate::planes::fit) fn agglomerate(
    parts: Vec<Part>,
    pairs: &[[u32; 2]],
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let mut clusters = Clusters::new(parts, pairs, rule);
    let mut tested = 0;
    while let Some(Reverse((_, pair, versions))) = clusters.queue.pop() {
        tested += 1;
        if tested % PAIRS_PER_CHECK == 0 {
            progress.check()?;
        }
        if clusters.is_current(pair, versions) {
            clusters.join(pair);
        }
    }
    Ok(clusters.roots())
}

/// Parts that have been joined so far, and the pairs that may be joined next.
struct Clusters<'a> {
    rule: &'a Rule,
    /// The union of all members, for the part that stands for them.
    parts: Vec<Part>,
    /// Parts that were neighbours of a member; some have been joined to others since.
    neighbors: Vec<Vec<u32>>,
    /// The part that each was joined to, itself while it stands for its members.
    into: Vec<u32>,
    /// How often each part has grown.
    version: Vec<u32>,
    /// Pairs that `rule` allows, the flattest union first.
    queue: BinaryHeap<Candidate>,
}

impl<'a> Clusters<'a> {
    fn new(parts: Vec<Part>, pairs: &[[u32; 2]], rule: &'a Rule) -> Self {
        let n = parts.len();
        let mut neighbors: Vec<Vec<u32>> = vec![Vec::new(); n];
        for &[a, b] in pairs {
            neighbors[a as usize].push(b);
            neighbors[b as usize].push(a);
        }
        let costs: Vec<Option<f64>> = pairs
            .par_iter()
            .map(|&[a, b]| parts[a as usize].joined(&parts[b as usize], rule).map(|j| j.0))
            .collect();
        let queue = pairs
            .iter()
            .zip(costs)
            .filter_map(|(&pair, cost)| Some(Reverse((Cost(cost?), pair, [0, 0]))))
            .collect();
        let into = (0..n as u32).collect();
        Self { rule, parts, neighbors, into, version: vec![0; n], queue }
    }

    /// True when both parts still stand for themselves and neither has grown since the pair's cost was computed.
    fn is_current(&self, [a, b]: [u32; 2], versions: [u32; 2]) -> bool {
        let [i, j] = [a as usize, b as usize];
        self.into[i] == a && self.into[j] == b && [self.version[i], self.version[j]] == versions
    }

    /// Joins the second part of a pair to the first, and queues the union with its neighbours.
    fn join(&mut self, [a, b]: [u32; 2]) {
        let [i, j] = [a as usize, b as usize];
        let Some((_, joined)) = self.parts[i].joined(&self.parts[j], self.rule) else { return };
        self.parts[i] = joined;
        self.version[i] += 1;
        self.into[j] = a;
        let mut around = std::mem::take(&mut self.neighbors[i]);
        around.append(&mut self.neighbors[j]);
        for c in &mut around {
            *c = root(&mut self.into, *c);
        }
        around.sort_unstable();
        around.dedup();
        around.retain(|&c| c != a);
        for &c in &around {
            let k = c as usize;
            self.neighbors[k].push(a);
            if let Some((cost, _)) = self.parts[i].joined(&self.parts[k], self.rule) {
                let [first, second] = [a.min(c), a.max(c)];
                let versions = [first, second].map(|part| self.version[part as usize]);
                self.queue.push(Reverse((Cost(cost), [first, second], versions)));
            }
        }
        self.neighbors[i] = around;
    }

    /// The part that stands for each.
    fn roots(mut self) -> Vec<u32> {
        (0..self.into.len() as u32).map(|i| root(&mut self.into, i)).collect()
    }
}
