//! The distances to all neurons for every signal, vectorised: to compare with.

use pulp::{Arch, Simd, WithSimd};

use super::{Best, Winner, Winners};

/// Neurons whose least distance is computed before each is compared: those of most batches need no comparison.
const BATCH: usize = 64;

/// Batches whose least distances bound the second winner's before any neuron is compared.
const BATCHES: usize = 64;

/// Distances compared at once: a vector of eight single precision numbers.
const LANES: usize = 8;

/// All distances for every signal, in columns.
#[derive(Debug, Clone, Default)]
pub struct BruteForce {
    /// Unused ids are at infinity; a multiple of [`BATCH`] long.
    columns: [Vec<f32>; 3],
}

impl Winners for BruteForce {
    fn insert(&mut self, id: u32, position: [f32; 3]) {
        let len = (id as usize + 1).next_multiple_of(BATCH);
        for (column, p) in self.columns.iter_mut().zip(position) {
            if column.len() < len {
                column.resize(len, f32::INFINITY);
            }
            column[id as usize] = p;
        }
    }

    fn remove(&mut self, id: u32) {
        self.columns.iter_mut().for_each(|column| column[id as usize] = f32::INFINITY);
    }

    fn shift(&mut self, id: u32, position: [f32; 3]) {
        self.insert(id, position);
    }

    fn two_nearest(&self, query: [f32; 3]) -> [Winner; 2] {
        Arch::new().dispatch(TwoNearest { columns: &self.columns, query })
    }
}

/// A search for the two nearest neurons.
struct TwoNearest<'a> {
    columns: &'a [Vec<f32>; 3],
    query: [f32; 3],
}

impl WithSimd for TwoNearest<'_> {
    type Output = [Winner; 2];

    // Inlined, so that it is compiled for what the processor has.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { columns, query } = self;
        let mut best = Best([Winner::NONE; 2]);
        let [xs, ys, zs] = [0, 1, 2].map(|a| columns[a].as_chunks::<BATCH>().0);
        let distance = |batch: usize, lane: usize| {
            let p = [xs[batch][lane], ys[batch][lane], zs[batch][lane]];
            let d = [0, 1, 2].map(|a| p[a] - query[a]);
            (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
        };
        for first in (0..xs.len()).step_by(BATCHES) {
            let group = first..xs.len().min(first + BATCHES);
            let mut least = [f32::INFINITY; BATCHES];
            // The two batches that come nearest hold two neurons at least as near as this bound.
            let mut bound = Best(best.0);
            for batch in group.clone() {
                let mut lanes = [f32::INFINITY; LANES];
                for lane in (0..BATCH).step_by(LANES) {
                    for (l, nearest) in lanes.iter_mut().enumerate() {
                        let d = distance(batch, lane + l);
                        *nearest = if d < *nearest { d } else { *nearest };
                    }
                }
                least[batch - first] = lanes.into_iter().fold(f32::INFINITY, f32::min);
                bound.offer(Winner::new(least[batch - first], batch as u32));
            }
            for batch in group {
                if least[batch - first] <= bound.limit() {
                    for lane in 0..BATCH {
                        let id = (batch * BATCH + lane) as u32;
                        best.offer(Winner::new(distance(batch, lane), id));
                    }
                }
            }
        }
        best.0
    }
}
