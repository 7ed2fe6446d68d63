//! Points by the cubes of the world ("bricks") that they lie in, for clouds that are kept on disk by place.

use surfabet_base::rounding::floor_f64;
use surfabet_base::{Partition, parallel};

use crate::cloud::PointCloud;

/// Coordinates of bricks about [`Bricks::base`] are less, either sign, so that three fit a key.
pub const BRICK_HALF: i64 = 1 << (COORDINATE_BITS - 1);

/// Bits of a coordinate in a key.
const COORDINATE_BITS: u32 = 21;

/// The key of points that are further from the base than keys reach.
const FAR: u64 = u64::MAX;

/// Cubes of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bricks {
    /// Side, metres.
    pub side: f64,
    /// Coordinates of the brick that others are counted from.
    pub base: [i64; 3],
}

/// The points of a cloud, brick by brick, in each in the order of the cloud; those that are too far for a key are left out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InBricks {
    /// Key of every brick with points, growing.
    pub keys: Vec<u64>,
    /// Number of points of each.
    pub counts: Vec<usize>,
    /// Numbers of the points in the cloud.
    pub order: Vec<u32>,
    /// Position of each from the lowest corner of its brick, metres.
    pub positions: Vec<[f32; 3]>,
}

impl Bricks {
    /// Sorts the points of a cloud.
    pub fn sort(&self, cloud: &PointCloud) -> InBricks {
        let of_points: Vec<u64> = parallel::map_range(cloud.len(), |i| self.key(cloud.world(i)));
        let Partition { mut keys, mut counts, mut order } = Partition::of(&of_points);
        // The largest of all keys.
        if keys.last() == Some(&FAR) {
            keys.pop();
            order.truncate(order.len() - counts.pop().unwrap_or_default());
        }
        let positions = parallel::map(&order, |&i| {
            let world = cloud.world(i as usize);
            let corner = self.corner(of_points[i as usize]);
            std::array::from_fn(|a| (world[a] - corner[a]) as f32)
        });
        InBricks { keys, counts, order, positions }
    }

    /// Key of the brick that a position in the world lies in.
    fn key(&self, world: [f64; 3]) -> u64 {
        let mut key = 0;
        for (c, base) in world.into_iter().zip(self.base) {
            let at = floor_f64(c / self.side).saturating_sub(base);
            if !(1 - BRICK_HALF..BRICK_HALF).contains(&at) {
                return FAR;
            }
            key = key << COORDINATE_BITS | (at + BRICK_HALF) as u64;
        }
        key
    }

    /// Lowest corner of the brick of a key, metres in the world.
    fn corner(&self, key: u64) -> [f64; 3] {
        std::array::from_fn(|a| {
            let shifted = key >> (COORDINATE_BITS * (2 - a as u32)) & ((1 << COORDINATE_BITS) - 1);
            (shifted as i64 - BRICK_HALF + self.base[a]) as f64 * self.side
        })
    }
}

/// Points of one brick among records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrickRun {
    /// Number of its records.
    pub count: usize,
    /// Its lowest corner, metres from the origin that positions are wanted about.
    pub corner: [f64; 3],
}

/// Positions about an origin, of records that begin with three numbers in single precision: the position from the corner of a
/// brick, run by run. Records beyond those of all runs are left out.
///
/// `size` is that of a record, bytes, at least twelve.
pub fn positions_of_records(records: &[u8], size: usize, runs: &[BrickRun]) -> Vec<[f32; 3]> {
    let n: usize = runs.iter().map(|run| run.count).sum::<usize>().min(records.len() / size);
    let mut positions = vec![[0.0_f32; 3]; n];
    let (mut to, mut from) = (&mut positions[..], records);
    let mut parts = Vec::with_capacity(runs.len());
    for run in runs {
        let count = run.count.min(to.len());
        let (own, rest) = std::mem::take(&mut to).split_at_mut(count);
        let (given, left) = from.split_at(count * size);
        (to, from) = (rest, left);
        parts.push((own, given, run.corner));
    }
    parallel::for_each(parts.into_iter(), |_, (own, given, corner)| {
        for (position, record) in own.iter_mut().zip(given.chunks_exact(size)) {
            let (numbers, _) = record.as_chunks::<4>();
            *position = std::array::from_fn(|a| {
                (f64::from(f32::from_ne_bytes(numbers[a])) + corner[a]) as f32
            });
        }
    });
    positions
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::cloud::CloudParts;

    fn cloud(origin: [f64; 3], positions: Vec<[f32; 3]>) -> PointCloud {
        let parts = CloudParts { origin, positions, ..CloudParts::default() };
        PointCloud::from_parts(parts).unwrap().0
    }

    /// Records of 16 bytes, of which the last four are no position.
    fn records(positions: &[[f32; 3]]) -> Vec<u8> {
        let record = |p: &[f32; 3]| [p[0], p[1], p[2], 7.0].map(f32::to_ne_bytes).concat();
        positions.iter().flat_map(record).collect()
    }

    proptest! {
        #[test]
        fn points_are_in_the_bricks_of_their_floors_and_come_back(
            points in prop::collection::vec(prop::array::uniform3(-9.0_f32..9.0), 0..300),
            side in 0.3_f64..4.0, origin in prop::array::uniform3(-100.0_f64..100.0),
        ) {
            let cloud = cloud(origin, points);
            let base = origin.map(|c| (c / side).floor() as i64);
            let bricks = Bricks { side, base };
            let found = bricks.sort(&cloud);
            let mut wanted: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
            for i in 0..cloud.len() {
                let place = cloud.world(i).map(|c| (c / side).floor() as i64);
                wanted.entry(place).or_default().push(i as u32);
            }
            prop_assert_eq!(&found.order, &wanted.values().flatten().copied().collect::<Vec<_>>());
            let counts: Vec<usize> = wanted.values().map(Vec::len).collect();
            prop_assert_eq!(&found.counts, &counts);
            let key = |place: &[i64; 3]| {
                (0..3).fold(0, |key, a| key << 21 | (place[a] - base[a] + (1 << 20)) as u64)
            };
            prop_assert_eq!(&found.keys, &wanted.keys().map(key).collect::<Vec<_>>());

            let run = |(place, of): (&[i64; 3], &Vec<u32>)| BrickRun {
                count: of.len(),
                corner: std::array::from_fn(|a| place[a] as f64 * side - origin[a]),
            };
            let runs: Vec<BrickRun> = wanted.iter().map(run).collect();
            let again = positions_of_records(&records(&found.positions), 16, &runs);
            for (p, &i) in again.iter().zip(&found.order) {
                let q = cloud.positions()[i as usize];
                prop_assert!(p.iter().zip(q).all(|(p, q)| (p - q).abs() < 2e-6));
            }
        }
    }

    #[test]
    fn what_is_too_far_for_a_key_is_left_out() {
        let last = BRICK_HALF as f32 - 0.5;
        let cloud = cloud(
            [0.0; 3],
            vec![
                [last, 0.0, 0.0],
                [last + 1.0, 0.0, 0.0],
                [0.0, 0.5 - last, 0.0],
                [0.0, -0.5 - last, 0.0],
                [0.0, 0.0, 1e30],
                [0.0, 0.0, -1e30],
                [0.5, 0.5, 0.5],
            ],
        );
        let found = Bricks { side: 1.0, base: [0; 3] }.sort(&cloud);
        assert_eq!(found.order, [2, 6, 0]);
        assert_eq!(found.counts, [1; 3]);
        let beyond = Bricks { side: 1.0, base: [3, 0, 0] }.sort(&cloud);
        assert_eq!(beyond.order, [2, 6, 0, 1]);
    }

    #[test]
    fn no_more_positions_than_records() {
        let runs = [2, 5].map(|count| BrickRun { count, corner: [1.0; 3] });
        let of_three = positions_of_records(&records(&[[0.25; 3]; 3]), 16, &runs);
        assert_eq!(of_three, [[1.25; 3]; 3]);
    }
}
