//! The graph of neurons and edges: connected components, and distances along the surface.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::error::{Error, Result};
use crate::gas::adjacency::Adjacency;
use crate::gas::distance;
use crate::gas::model::GasModel;

impl GasModel {
    /// Neighbours of neuron `i` along edges, ascending.
    ///
    /// # Panics
    /// When there is no neuron `i`.
    pub fn neighbors(&self, i: usize) -> &[u32] {
        self.adjacency.of(i)
    }

    /// Connected component of every neuron: numbers from zero, in the order of the components' first neurons.
    pub fn components(&self) -> Vec<u32> {
        components(&self.adjacency)
    }

    /// Length in metres of the shortest path along edges from neuron `source` to every neuron; infinite to other components.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when there is no neuron `source`.
    pub fn geodesic_distances(&self, source: usize) -> Result<Vec<f64>> {
        if source >= self.len() {
            return Err(Error::invalid(
                "source",
                source,
                "the number of a neuron, below their count",
            ));
        }
        Ok(ShortestPaths::from(source, &self.adjacency, &self.positions()).lengths)
    }
}

/// Connected component of every node: numbers from zero, in the order of the components' first nodes.
pub(in crate::gas) fn components(adjacency: &Adjacency) -> Vec<u32> {
    let mut component = vec![u32::MAX; adjacency.len()];
    let mut n = 0;
    let mut waiting = Vec::new();
    for root in 0..adjacency.len() {
        if component[root] != u32::MAX {
            continue;
        }
        component[root] = n;
        waiting.push(root);
        while let Some(i) = waiting.pop() {
            for &j in adjacency.of(i) {
                if component[j as usize] == u32::MAX {
                    component[j as usize] = n;
                    waiting.push(j as usize);
                }
            }
        }
        n += 1;
    }
    component
}

/// The shortest paths along edges from one node to all others (E. W. Dijkstra, 1959).
pub(in crate::gas) struct ShortestPaths {
    /// Length of the path to every node, metres; infinite to other components.
    pub lengths: Vec<f64>,
    /// The node before every node on its path; the node itself where there is none.
    pub previous: Vec<u32>,
}

impl ShortestPaths {
    pub fn from(source: usize, adjacency: &Adjacency, positions: &[[f32; 3]]) -> Self {
        let mut lengths = vec![f64::INFINITY; adjacency.len()];
        let mut previous: Vec<u32> = (0..adjacency.len() as u32).collect();
        // Non-negative floats order like their bits.
        let mut heap = BinaryHeap::from([Reverse((0.0_f64.to_bits(), source as u32))]);
        lengths[source] = 0.0;
        while let Some(Reverse((bits, i))) = heap.pop() {
            let (so_far, i) = (f64::from_bits(bits), i as usize);
            if so_far > lengths[i] {
                continue;
            }
            for &j in adjacency.of(i) {
                let through_i = so_far + distance(positions[i], positions[j as usize]);
                if through_i < lengths[j as usize] {
                    lengths[j as usize] = through_i;
                    previous[j as usize] = i as u32;
                    heap.push(Reverse((through_i.to_bits(), j)));
                }
            }
        }
        Self { lengths, previous }
    }

    /// The nodes from the source to `target`, both included; `None` where no path leads there.
    pub fn to(&self, target: usize) -> Option<Vec<u32>> {
        if self.lengths[target].is_infinite() {
            return None;
        }
        let before = |&node: &u32| {
            let previous = self.previous[node as usize];
            (previous != node).then_some(previous)
        };
        let mut path: Vec<u32> = std::iter::successors(Some(target as u32), before).collect();
        path.reverse();
        Some(path)
    }
}
