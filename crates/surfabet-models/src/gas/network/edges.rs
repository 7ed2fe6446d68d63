//! Edges of the network, each stored at both its neurons, with ages that need no counting.
//!
//! An edge ages by one whenever one of its two neurons wins (step 4). So its age is the number of wins of both since it
//! was refreshed: `age = wins_a + wins_b - base`, where the base is that sum when it was refreshed. Only the base is
//! stored.
//!
//! A neuron's edges are a run in one list, with room for a power of two; released runs are used again.

/// Room of the smallest run: neurons on a surface have six neighbours on average, and 64 bytes are a cache line.
const SMALLEST: usize = 8;

/// One end of an edge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::gas) struct Link {
    /// The neuron at the other end.
    pub to: u32,
    /// Wins of both neurons together when the edge had age zero; wraps.
    pub base: u32,
}

/// The links of a neuron.
#[derive(Debug, Clone, Copy, Default)]
struct LinkRange {
    /// First of them in [`Edges::links`].
    start: u32,
    len: u32,
    /// Room is `SMALLEST << class`.
    class: u8,
    /// The run has room; false for a neuron without links.
    is_allocated: bool,
}

/// All edges.
#[derive(Debug, Clone, Default)]
pub(in crate::gas) struct Edges {
    runs: Vec<LinkRange>,
    links: Vec<Link>,
    /// Starts of released runs, by class.
    free: Vec<Vec<u32>>,
    count: usize,
}

impl Edges {
    /// Number of edges.
    #[cfg(test)]
    pub(in crate::gas) fn len(&self) -> usize {
        self.count
    }

    /// The edges of a neuron, in no particular order.
    #[inline]
    pub(in crate::gas) fn of(&self, id: u32) -> &[Link] {
        // A neuron that never had edges may have no run yet.
        let run = self.runs.get(id as usize).copied().unwrap_or_default();
        &self.links[run.start as usize..][..run.len as usize]
    }

    /// Step 7: refreshes the edge between two neurons, or makes it. Returns true for a new one.
    pub(in crate::gas) fn connect(&mut self, a: u32, b: u32, base: u32) -> bool {
        if let Some(link) = self.find(a, b) {
            link.base = base;
            if let Some(link) = self.find(b, a) {
                link.base = base;
            }
            return false;
        }
        self.push(a, Link { to: b, base });
        self.push(b, Link { to: a, base });
        self.count += 1;
        true
    }

    /// Removes the edge between two neurons, if there is one.
    pub(in crate::gas) fn disconnect(&mut self, a: u32, b: u32) {
        if self.pull(a, b) && self.pull(b, a) {
            self.count -= 1;
        }
    }

    /// The link from a neuron to another.
    #[inline]
    fn find(&mut self, from: u32, to: u32) -> Option<&mut Link> {
        let run = self.runs.get(from as usize)?;
        let links = &mut self.links[run.start as usize..][..run.len as usize];
        links.iter_mut().find(|link| link.to == to)
    }

    /// Adds a link, and moves the run to one of twice the room where it is full.
    fn push(&mut self, id: u32, link: Link) {
        let at = id as usize;
        if at >= self.runs.len() {
            self.runs.resize(at + 1, LinkRange::default());
        }
        let run = self.runs[at];
        let room = if run.is_allocated { SMALLEST << run.class } else { 0 };
        if run.len as usize == room {
            let class = if run.is_allocated { run.class + 1 } else { 0 };
            let start = self.allocate(class);
            let (from, to) = (run.start as usize, start as usize);
            self.links.copy_within(from..from + run.len as usize, to);
            self.release(run);
            self.runs[at] = LinkRange { start, len: run.len, class, is_allocated: true };
        }
        let run = &mut self.runs[at];
        self.links[run.start as usize + run.len as usize] = link;
        run.len += 1;
    }

    /// Removes the link from a neuron to another; false when there is none.
    fn pull(&mut self, id: u32, to: u32) -> bool {
        let Some(run) = self.runs.get_mut(id as usize) else { return false };
        let links = &mut self.links[run.start as usize..][..run.len as usize];
        let Some(at) = links.iter().position(|link| link.to == to) else { return false };
        links.swap(at, run.len as usize - 1);
        run.len -= 1;
        if run.len == 0 {
            let run = std::mem::take(run);
            self.release(run);
        }
        true
    }

    /// Start of a run of a class.
    fn allocate(&mut self, class: u8) -> u32 {
        if let Some(start) = self.free.get_mut(class as usize).and_then(Vec::pop) {
            return start;
        }
        let start = self.links.len();
        self.links.resize(start + (SMALLEST << class), Link::default());
        start as u32
    }

    /// Makes a run available again.
    fn release(&mut self, run: LinkRange) {
        if !run.is_allocated {
            return;
        }
        let class = run.class as usize;
        if self.free.len() <= class {
            self.free.resize(class + 1, Vec::new());
        }
        self.free[class].push(run.start);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn agrees_with_a_map_of_pairs(
            steps in prop::collection::vec((0_u32..24, 0_u32..24, any::<u32>(), 0_u8..3), 0..800),
        ) {
            let mut edges = Edges::default();
            let mut map = BTreeMap::new();
            for (a, b, base, kind) in steps.into_iter().filter(|s| s.0 != s.1) {
                let key = (a.min(b), a.max(b));
                if kind == 0 {
                    edges.disconnect(a, b);
                    map.remove(&key);
                } else {
                    prop_assert_eq!(edges.connect(a, b, base), map.insert(key, base).is_none());
                }
            }
            prop_assert_eq!(edges.len(), map.len());
            for id in 0..24 {
                let mut found: Vec<(u32, u32)> =
                    edges.of(id).iter().map(|link| (link.to, link.base)).collect();
                found.sort_unstable();
                let expected: Vec<(u32, u32)> = map
                    .iter()
                    .filter(|((a, b), _)| *a == id || *b == id)
                    .map(|((a, b), base)| (a + b - id, *base))
                    .collect();
                let mut expected = expected;
                expected.sort_unstable();
                prop_assert_eq!(found, expected);
            }
        }
    }
}
