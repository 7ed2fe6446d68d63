//! The neighbours of every neuron, in one array.

/// Neighbours of every neuron, sorted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Adjacency {
    starts: Vec<u32>,
    neighbors: Vec<u32>,
}

impl Adjacency {
    /// Of `n` neurons with these edges, pairs of different ids below `n`, none twice.
    pub(super) fn new(n: usize, edges: &[[u32; 2]]) -> Self {
        let mut starts = vec![0_u32; n + 1];
        for &id in edges.iter().flatten() {
            starts[id as usize + 1] += 1;
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut neighbors = vec![0; 2 * edges.len()];
        for &[a, b] in edges {
            for (from, to) in [(a, b), (b, a)] {
                neighbors[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        for run in starts.windows(2) {
            neighbors[run[0] as usize..run[1] as usize].sort_unstable();
        }
        Self { starts, neighbors }
    }

    /// Number of neurons.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Neighbours of a neuron, ascending.
    pub(super) fn of(&self, id: usize) -> &[u32] {
        &self.neighbors[self.starts[id] as usize..self.starts[id + 1] as usize]
    }

    /// True when two neurons are joined.
    pub(super) fn joined(&self, a: usize, b: usize) -> bool {
        self.of(a).binary_search(&(b as u32)).is_ok()
    }
}
