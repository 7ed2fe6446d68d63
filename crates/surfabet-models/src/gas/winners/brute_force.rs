//! The distances to all neurons for every signal, vectorised: to compare with.

use pulp::{Arch, Simd, WithSimd};

use super::{Best, Winner, Winners};

/// Neurons whose least distance is computed before each is compared: those of most batches need no comparison.
const BATCH: usize = 64;

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
        let mut distances = [0.0_f32; BATCH];
        for (batch, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
            for lane in 0..BATCH {
                let d = [x[lane] - query[0], y[lane] - query[1], z[lane] - query[2]];
                distances[lane] = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
            }
            let mut least = [f32::INFINITY; 8];
            for part in distances.as_chunks::<8>().0 {
                for (l, &d) in least.iter_mut().zip(part) {
                    *l = if d < *l { d } else { *l };
                }
            }
            if least.into_iter().fold(f32::INFINITY, f32::min) <= best.limit() {
                for (lane, &d) in distances.iter().enumerate() {
                    best.offer(Winner::new(d, (batch * BATCH + lane) as u32));
                }
            }
        }
        best.0
    }
}
