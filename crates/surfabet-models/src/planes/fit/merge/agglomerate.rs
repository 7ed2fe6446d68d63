//! Joins parts, the flattest union first, until no two are one plane (section II-D, step 2).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::rule::{PlanarSet, Rule};
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
type Join = Reverse<(Cost, [u32; 2], [u32; 2])>;

/// Joins neighbouring parts, those first whose union is flattest, until no pair is left that `rule` allows. Gives
/// the part that each has become, numbered by its first member.
///
/// The cost of a pair of which one part has grown since is computed again when its turn comes, not after every join: a wall
/// of thousands of cells has hundreds of neighbours. Pairs that the rule did not allow get another turn at the end.
pub(in crate::planes::fit) fn agglomerate(
    parts: Vec<PlanarSet>,
    pairs: &[[u32; 2]],
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<u32>> {
    let mut clusters = Clusters::new(parts, rule);
    let mut tested = 0;
    loop {
        let mut queue = clusters.queue(pairs);
        let mut joined = false;
        while let Some(Reverse((_, pair, versions))) = queue.pop() {
            tested += 1;
            if tested % PAIRS_PER_CHECK == 0 {
                progress.check()?;
            }
            let now = clusters.now(pair);
            if now == pair && clusters.versions(pair) == versions {
                clusters.join(pair);
                joined = true;
            } else if let Some(candidate) = clusters.candidate(now) {
                queue.push(candidate);
            }
        }
        if !joined {
            return Ok(clusters.roots());
        }
    }
}

/// Parts that have been joined so far.
struct Clusters<'a> {
    rule: &'a Rule,
    /// The union of all members, for the part that stands for them.
    parts: Vec<PlanarSet>,
    /// The part that each was joined to, itself while it stands for its members.
    into: Vec<u32>,
    /// How often each part has grown.
    version: Vec<u32>,
}

impl<'a> Clusters<'a> {
    fn new(parts: Vec<PlanarSet>, rule: &'a Rule) -> Self {
        let n = parts.len();
        Self { rule, parts, into: (0..n as u32).collect(), version: vec![0; n] }
    }

    /// The parts that stand for those of a pair now, the first before the second.
    fn now(&mut self, [a, b]: [u32; 2]) -> [u32; 2] {
        let [a, b] = [root(&mut self.into, a), root(&mut self.into, b)];
        [a.min(b), a.max(b)]
    }

    fn versions(&self, pair: [u32; 2]) -> [u32; 2] {
        pair.map(|part| self.version[part as usize])
    }

    /// A pair of parts that stand for their members with its cost, if it may be joined.
    fn candidate(&self, [a, b]: [u32; 2]) -> Option<Join> {
        if a == b {
            return None;
        }
        let (cost, _) = self.parts[a as usize].joined(&self.parts[b as usize], self.rule)?;
        Some(Reverse((Cost(cost), [a, b], self.versions([a, b]))))
    }

    /// All pairs that may be joined.
    fn queue(&mut self, pairs: &[[u32; 2]]) -> BinaryHeap<Join> {
        let mut now: Vec<[u32; 2]> = pairs.iter().map(|&pair| self.now(pair)).collect();
        now.sort_unstable();
        now.dedup();
        let clusters = &*self;
        let candidates: Vec<Join> =
            parallel::gather(now.len(), |i, found| found.extend(clusters.candidate(now[i])));
        candidates.into()
    }

    /// Joins the second part of a pair to the first.
    fn join(&mut self, [a, b]: [u32; 2]) {
        let [i, j] = [a as usize, b as usize];
        let Some((_, joined)) = self.parts[i].joined(&self.parts[j], self.rule) else { return };
        self.parts[i] = joined;
        self.version[i] += 1;
        self.into[j] = a;
    }

    /// The part that stands for each.
    fn roots(mut self) -> Vec<u32> {
        (0..self.into.len() as u32).map(|i| root(&mut self.into, i)).collect()
    }
}
