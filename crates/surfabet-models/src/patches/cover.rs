//! Which cells of a grid have a point beside the patches: the middle of one may stand for what lies in those around.
//!
//! Every point in a cell is within the bound of its middle, and so are many of those in cells around. Points are to be as few as they can be
//! at their price: one that many others surround costs the coder little.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use surfabet_base::parallel;
use surfabet_geom::morton::MortonMap;

use super::attributes::cells::{cell_key, cell_of_key, index};
use super::constants::{EXTRA_CELL, MOST_AROUND_LEFT_OUT};
use super::model::extra_key;
use crate::vector::squared_distance;

/// Share of the bound that rounding leaves.
const WITHIN: f64 = 0.999;

/// Points to be covered, by the cells that they lie in.
pub(super) struct Cover {
    /// Keys of the cells that hold points, growing.
    keys: Vec<u64>,
    /// First point of each cell, and their number.
    starts: Vec<u32>,
    /// By cell.
    points: Vec<[f32; 3]>,
    /// Their numbers as they were given.
    numbers: Vec<u32>,
    places: MortonMap<u32>,
    /// Side of a cell, metres.
    size: f64,
    /// Largest squared distance from a point to the middle that stands for it.
    limit: f32,
}

impl Cover {
    /// Of points in the axes of the lattice, each to be within `limit` metres of the middle of a cell.
    pub fn new(points: &[[f32; 3]], limit: f64) -> Self {
        let size = Self::size_of(limit);
        let mut keyed: Vec<(u64, u32)> =
            parallel::map_range(points.len(), |i| (extra_key(points[i], size), i as u32));
        parallel::sort_keyed(&mut keyed);
        let mut starts = vec![0];
        let mut keys = Vec::new();
        for run in keyed.chunk_by(|a, b| a.0 == b.0) {
            keys.push(run[0].0);
            starts.push(starts[starts.len() - 1] + run.len() as u32);
        }
        let points = parallel::map(&keyed, |&(_, i)| points[i as usize]);
        let numbers = keyed.iter().map(|of| of.1).collect();
        let limit = (WITHIN * limit).powi(2) as f32;
        Self { places: index(&keys), keys, starts, points, numbers, size, limit }
    }

    /// Side of a cell for a limit, metres.
    pub fn size_of(limit: f64) -> f64 {
        EXTRA_CELL * limit
    }

    /// Numbers of the points that the middle of a cell covers, as they were given.
    pub fn input_of(&self, key: u64) -> impl Iterator<Item = u32> {
        let cell = self.places.get(&key).map(|&i| i as usize);
        cell.into_iter().flat_map(|cell| self.by(cell)).map(|p| self.numbers[p])
    }

    /// Side of a cell, metres.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Keys of cells whose middles cover all points, growing. Those are left out whose points others cover, first those with the
    /// fewest cells around; where many are around, one cell costs less than the hole that it would leave.
    pub fn of_all(&self) -> Vec<u64> {
        let mut covered: Vec<u8> = parallel::gather(self.keys.len(), |cell, covered| {
            let around: Vec<usize> = self.around(cell).collect();
            let reached = |p: &usize| {
                let by = |&&other: &&usize| other == cell || self.reaches(other, *p);
                around.iter().filter(by).count() as u8
            };
            covered.extend(self.range(cell).map(|p| reached(&p)));
        });
        let mut around: Vec<u8> =
            parallel::map_range(self.keys.len(), |cell| self.around(cell).count() as u8 - 1);
        let mut kept = vec![true; self.keys.len()];
        let entry = |cell: usize, around: &[u8]| {
            (around[cell] <= MOST_AROUND_LEFT_OUT)
                .then(|| Reverse((around[cell], self.range(cell).len(), cell as u32)))
        };
        let mut queue: BinaryHeap<_> =
            (0..self.keys.len()).filter_map(|cell| entry(cell, &around)).collect();
        while let Some(Reverse((known, _, cell))) = queue.pop() {
            let cell = cell as usize;
            if !kept[cell] || known != around[cell] || self.by(cell).any(|p| covered[p] < 2) {
                continue;
            }
            kept[cell] = false;
            self.by(cell).for_each(|p| covered[p] -= 1);
            for other in self.around(cell).filter(|&other| kept[other]) {
                around[other] -= 1;
                queue.extend(entry(other, &around));
            }
        }
        self.keys.iter().zip(kept).filter(|(_, kept)| *kept).map(|(&key, _)| key).collect()
    }

    /// Keys of cells whose middles cover all points but at most `missing`, growing: those first that cover most.
    pub fn of_most(&self, missing: usize) -> Vec<u64> {
        let mut covered = vec![false; self.points.len()];
        let news = |cell: usize, covered: &[bool]| self.by(cell).filter(|&p| !covered[p]).count();
        let first: Vec<usize> = parallel::map_range(self.keys.len(), |i| news(i, &covered));
        let mut queue: BinaryHeap<_> =
            first.into_iter().zip((0..self.keys.len()).map(Reverse)).collect();
        let (mut keys, mut left) = (Vec::new(), self.points.len());
        while left > missing {
            // Every point is covered by its own cell, which is in the queue until then.
            let Some((known, Reverse(cell))) = queue.pop() else { break };
            let now = news(cell, &covered);
            if now < known {
                queue.push((now, Reverse(cell)));
                continue;
            }
            self.by(cell).for_each(|p| covered[p] = true);
            left -= now;
            keys.push(self.keys[cell]);
        }
        keys.sort_unstable();
        keys
    }

    /// Numbers of a cell and those around it that hold points.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let [x, y, z] = cell_of_key(self.keys[cell]);
        let offsets = (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let keys = offsets.map(move |[dx, dy, dz]| cell_key([x + dx, y + dy, z + dz]));
        keys.filter_map(|key| self.places.get(&key).map(|&i| i as usize))
    }

    /// Numbers of the points in a cell.
    fn range(&self, cell: usize) -> std::ops::Range<usize> {
        self.starts[cell] as usize..self.starts[cell + 1] as usize
    }

    /// Is a point in another cell within the bound of the middle of a cell?
    fn reaches(&self, cell: usize, point: usize) -> bool {
        let middle =
            cell_of_key(self.keys[cell]).map(|c| ((f64::from(c) + 0.5) * self.size) as f32);
        squared_distance(middle, self.points[point]) <= self.limit
    }

    /// The points that the middle of a cell covers: all of its own, and those around within the bound. One that is two cells away is 1.5
    /// sides from it, which is more.
    fn by(&self, cell: usize) -> impl Iterator<Item = usize> {
        let in_reach = move |other, &point: &usize| other == cell || self.reaches(cell, point);
        self.around(cell)
            .flat_map(move |other| self.range(other).filter(move |p| in_reach(other, p)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn middles(keys: &[u64], size: f64) -> Vec<[f64; 3]> {
        keys.iter().map(|&key| cell_of_key(key).map(|c| (f64::from(c) + 0.5) * size)).collect()
    }

    fn distance(a: [f64; 3], b: [f32; 3]) -> f64 {
        (0..3).map(|k| (a[k] - f64::from(b[k])).powi(2)).sum::<f64>().sqrt()
    }

    /// How many of some points are further than `limit` from all middles.
    fn missed(points: &[[f32; 3]], keys: &[u64], size: f64, limit: f64) -> usize {
        let middles = middles(keys, size);
        let is_far = |p: &&[f32; 3]| middles.iter().all(|&m| distance(m, **p) > limit);
        points.iter().filter(is_far).count()
    }

    #[test]
    fn a_point_stands_for_what_lies_in_the_next_cell() {
        let limit = 0.1;
        let size = Cover::size_of(limit);
        let at = |x: f64| [(x * size) as f32, (0.5 * size) as f32, (0.5 * size) as f32];
        // 0.55 sides are 0.63 of the bound, 0.9 sides 1.04 of it.
        assert_eq!(Cover::new(&[at(0.95), at(1.05)], limit).of_all().len(), 1);
        assert_eq!(Cover::new(&[at(0.1), at(1.4)], limit).of_all().len(), 2);
        assert_eq!(Cover::new(&[], limit).of_all(), Vec::<u64>::new());
    }

    #[test]
    fn no_hole_is_made_in_a_wall() {
        // A wall of 16 x 16 cells through their middles, nine points in each, within 0.2 sides: all are covered by the cells beside, too.
        let limit = 0.1;
        let size = Cover::size_of(limit);
        let at = |i: usize| (i / 3) as f64 + 0.2 * (i % 3) as f64 + 0.3;
        let points: Vec<[f32; 3]> = (0..48 * 48)
            .map(|i| [at(i % 48), at(i / 48), 0.5].map(|c| (c * size) as f32))
            .collect();
        let kept = Cover::new(&points, limit).of_all();
        // Eight are around a cell in the wall, three around a corner.
        assert!(kept.len() > 200 && kept.len() <= 256, "{}", kept.len());
        assert_eq!(missed(&points, &kept, size, limit), 0);
    }

    proptest! {
        #[test]
        fn all_points_are_covered_by_cells_that_hold_some(
            points in prop::collection::vec(prop::array::uniform3(-0.5_f32..0.5), 0..300),
        ) {
            let limit = 0.1;
            let cover = Cover::new(&points, limit);
            let kept = cover.of_all();
            prop_assert_eq!(missed(&points, &kept, cover.size(), limit), 0);
            prop_assert!(kept.is_sorted());
            prop_assert!(kept.iter().all(|key| cover.keys.binary_search(key).is_ok()));
        }

        #[test]
        fn no_more_points_are_missed_than_may_be(
            points in prop::collection::vec(prop::array::uniform3(-0.5_f32..0.5), 0..300),
            share in 0.0..1.0_f64,
        ) {
            let limit = 0.1;
            let missing = (share * points.len() as f64) as usize;
            let cover = Cover::new(&points, limit);
            let kept = cover.of_most(missing);
            prop_assert!(missed(&points, &kept, cover.size(), limit) <= missing);
            // Not one more than needed: each covers points that no other does, or there was something left to cover.
            prop_assert!(kept.len() <= points.len() - missing);
        }

        #[test]
        fn points_of_many_copies_come_first(n in 2..20_usize) {
            let points: Vec<[f32; 3]> =
                (0..n).flat_map(|i| vec![[i as f32, 0.0, 0.0]; i + 1]).collect();
            // All but the rarest three places.
            let all = n * (n + 1) / 2;
            let few = n.min(3);
            let missing = few * (few + 1) / 2;
            let kept = Cover::new(&points, 0.1).of_most(missing.min(all));
            prop_assert_eq!(kept.len(), n - few);
        }
    }
}
