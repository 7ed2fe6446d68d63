//! The points of a scene by the cells of one scale.

use std::ops::Range;

use surfabet_base::parallel;

use crate::alphabet::lattice::{UNITS, cell_center, sigma};
use crate::alphabet::placement::WordPose;

/// Bits of one coordinate of a cell's key.
pub(super) const KEY_BITS: u32 = 21;

/// Cells around a cell that a word in it can reach, per direction.
const REACH: i64 = 2;

/// The points of a scene by the cells of one scale.
///
/// Points of cell k are `points[starts[k]..starts[k + 1]]`; keys ascend.
pub(in crate::alphabet) struct Cells {
    scale: u32,
    keys: Vec<u64>,
    starts: Vec<u32>,
    points: Vec<u32>,
}

/// Key of a cell: x in the lowest bits, so that cells along x follow one another.
fn key(cell: [i64; 3]) -> u64 {
    (cell[2] as u64) << (2 * KEY_BITS) | (cell[1] as u64) << KEY_BITS | cell[0] as u64
}

/// Cells around a cell, as runs of neighbours along x.
#[derive(Default)]
pub(in crate::alphabet) struct Rows(Vec<Range<usize>>);

impl Rows {
    /// Their numbers.
    fn cells(&self) -> impl Iterator<Item = usize> + use<'_> {
        self.0.iter().cloned().flatten()
    }
}

impl Cells {
    pub fn new(points: &[[f32; 3]], scale: u32) -> Self {
        let side = (UNITS << scale) as f32;
        let mut pairs: Vec<(u64, u32)> = parallel::map_range(points.len(), |i| {
            (key(points[i].map(|c| (c / side) as i64)), i as u32)
        });
        parallel::sort_keyed(&mut pairs);
        let mut keys = Vec::new();
        let mut starts = Vec::new();
        for (i, pair) in pairs.iter().enumerate() {
            if keys.last() != Some(&pair.0) {
                keys.push(pair.0);
                starts.push(i as u32);
            }
        }
        starts.push(pairs.len() as u32);
        Self { scale, keys, starts, points: pairs.into_iter().map(|p| p.1).collect() }
    }

    /// Number of cells with points.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Coordinates and points of the k-th cell.
    pub fn get(&self, k: usize) -> ([i32; 3], &[u32]) {
        let mask = (1 << KEY_BITS) - 1;
        let cell = [0, 1, 2].map(|a| (self.keys[k] >> (a * KEY_BITS) & mask) as i32);
        (cell, &self.points[self.starts[k] as usize..self.starts[k + 1] as usize])
    }

    /// The cells that a word in `cell` can reach.
    pub fn around(&self, cell: [i32; 3], rows: &mut Rows) {
        rows.0.clear();
        let [x, y, z] = cell.map(i64::from);
        let first = (x - REACH).max(0);
        for z in (z - REACH).max(0)..=z + REACH {
            for y in (y - REACH).max(0)..=y + REACH {
                let from = self.keys.partition_point(|&k| k < key([first, y, z]));
                let last = key([x + REACH, y, z]);
                let n = self.keys[from..].iter().take_while(|&&k| k <= last).count();
                rows.0.push(from..from + n);
            }
        }
    }

    /// Puts about `most` of the points of some cells into `found`, or all where there are fewer: every n-th of them.
    pub fn some_of(&self, rows: &Rows, most: usize, found: &mut Vec<u32>) {
        found.clear();
        let n: usize = rows.cells().map(|k| self.get(k).1.len()).sum();
        let step = n.div_ceil(most).max(1);
        let mut skip = 0;
        for k in rows.cells() {
            let (_, points) = self.get(k);
            found.extend(points.iter().skip(skip).step_by(step));
            // Points of the next cell before the first one taken there.
            skip = if skip >= points.len() {
                skip - points.len()
            } else {
                (step - (points.len() - skip) % step) % step
            };
        }
    }

    /// Puts the points of the cells that a word with this pose can touch, of those that it can reach, into `found`.
    pub fn touched(&self, rows: &Rows, pose: &WordPose, found: &mut Vec<u32>) {
        found.clear();
        // Half the diagonal of a cell, and twice the sigma of points in it.
        let margin = (0.75_f64).sqrt() * pose.radius + 2.0 * sigma(pose.level);
        for k in rows.cells() {
            let (cell, points) = self.get(k);
            let center = cell_center(cell, self.scale).map(|c| c as f64);
            let [right, up, height] = pose.to_word(center).map(f64::abs);
            if right.max(up) <= pose.radius + margin && height <= 0.5 * pose.radius + margin {
                found.extend_from_slice(points);
            }
        }
    }
}
