//! The graph of neurons and edges: connected components, and distances along the surface.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::error::{Error, Result};
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
        let mut component = vec![u32::MAX; self.len()];
        let mut n = 0;
        let mut waiting = Vec::new();
        for root in 0..self.len() {
            if component[root] != u32::MAX {
                continue;
            }
            component[root] = n;
            waiting.push(root);
            while let Some(i) = waiting.pop() {
                for &j in self.adjacency.of(i) {
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

    /// Length in metres of the shortest path along edges (E. W. Dijkstra, 1959) from neuron `source` to every neuron; infinite to other
    /// components.
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
        let positions = self.positions();
        let mut distances = vec![f64::INFINITY; self.len()];
        // Non-negative floats order like their bits.
        let mut heap = BinaryHeap::from([Reverse((0.0_f64.to_bits(), source as u32))]);
        distances[source] = 0.0;
        while let Some(Reverse((bits, i))) = heap.pop() {
            let (so_far, i) = (f64::from_bits(bits), i as usize);
            if so_far > distances[i] {
                continue;
            }
            for &j in self.adjacency.of(i) {
                let through_i = so_far + distance(positions[i], positions[j as usize]);
                if through_i < distances[j as usize] {
                    distances[j as usize] = through_i;
                    heap.push(Reverse((through_i.to_bits(), j)));
                }
            }
        }
        Ok(distances)
    }
}
