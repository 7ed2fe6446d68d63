//! Grouping of points and samples by the cubic cells of a grid.

use std::array::from_fn;
use std::ops::{Range, RangeInclusive};

use surfabet_base::parallel;
pub(in crate::patches) use surfabet_geom::cells::cell_of;

use crate::groups::Groups;

/// Bits of a cell coordinate in a key.
pub(in crate::patches) const KEY_BITS: u32 = 21;

/// Cell coordinates are above `-LIMIT` and below `LIMIT`.
pub(in crate::patches) const LIMIT: i32 = 1 << (KEY_BITS - 1);

/// Integer cell coordinates as one number; sorts by x, then y, then z. Coordinates beyond the grid are taken to
/// its rim; callers check the extent of a cloud before.
pub(in crate::patches) fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, &c| key << KEY_BITS | (c.clamp(1 - LIMIT, LIMIT - 1) + LIMIT) as u64)
}

/// Items grouped by the keys of their cells.
pub(in crate::patches) struct CellGroups {
    /// Different keys, growing.
    keys: Vec<u64>,
    /// Items of each key, by growing number.
    groups: Groups,
}

impl CellGroups {
    /// Groups `count` items by `key`.
    pub fn new(count: usize, key: impl Fn(usize) -> u64 + Sync) -> Self {
        let keys: Vec<u64> = parallel::map_range(count, key);
        if let Some(packing) = Packing::of(&keys) {
            let packed = packing.sorted(keys);
            let is_one = |a: &u64, b: &u64| packing.key(*a) == packing.key(*b);
            return Self::of_cells(
                count,
                || packed.chunk_by(is_one).map(|cell| (packing.key(cell[0]), cell.len())),
                packed.iter().map(|&p| packing.number(p)),
            );
        }
        let mut keyed: Vec<(u64, u32)> = (0..).zip(&keys).map(|(i, &key)| (key, i)).collect();
        drop(keys);
        parallel::sort_keyed(&mut keyed);
        let cells = || keyed.chunk_by(|a, b| a.0 == b.0).map(|cell| (cell[0].0, cell.len()));
        Self::of_cells(count, cells, keyed.iter().map(|&(_, i)| i))
    }

    /// Groups of keys and numbers of items, which are `items` cell after cell.
    fn of_cells<I: Iterator<Item = (u64, usize)>>(
        count: usize,
        cells: impl Fn() -> I,
        items: impl Iterator<Item = u32>,
    ) -> Self {
        let n_cells = cells().count();
        let mut keys = Vec::with_capacity(n_cells);
        keys.extend(cells().map(|(key, _)| key));
        let mut groups = Groups::with_capacity(n_cells, count);
        groups.extend(cells().map(|(_, n)| n), items);
        Self { keys, groups }
    }

    /// Number of cells that hold items.
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Items of cell `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        self.groups.of(i)
    }

    /// The items of all cells, without their keys.
    pub fn into_groups(self) -> Groups {
        self.groups
    }

    /// The cells from number `start` on whose keys lie in a range; no cell before may lie in it. Quick where that is not far on.
    pub fn within(&self, start: usize, range: RangeInclusive<u64>) -> Range<usize> {
        let keys = &self.keys[start..];
        let mut stride = 1;
        while stride < keys.len() && keys[stride] < *range.start() {
            stride *= 2;
        }
        let (low, high) = (stride / 2, keys.len().min(stride + 1));
        let first = low + keys[low..high].partition_point(|key| key < range.start());
        let n = keys[first..].iter().take_while(|key| *key <= range.end()).count();
        start + first..start + first + n
    }
}

/// Keys that take 64 bits with the numbers of their items: of each coordinate as many as those that there are need.
struct Packing {
    /// Least of each part of a key.
    low: [u64; 3],
    /// Bits of each part.
    bits: [u32; 3],
    /// Bits of a number.
    number_bits: u32,
}

/// Keys that one task looks at.
const BLOCK: usize = 1 << 14;

/// Numbers of a bucket, about: as many as the nearest cache holds many times.
const BUCKET_BITS: u32 = 8;

/// Most bits that tell buckets from one another.
const MOST_BUCKET_BITS: u32 = 12;

impl Packing {
    /// `None` for keys too far apart.
    fn of(keys: &[u64]) -> Option<Self> {
        let of_blocks = parallel::map_chunks(keys, BLOCK, |keys| {
            keys.iter().map(|&key| parts(key)).fold(([u64::MAX; 3], [0; 3]), |(low, high), p| {
                (from_fn(|a| p[a].min(low[a])), from_fn(|a| p[a].max(high[a])))
            })
        });
        let (low, high) = of_blocks.into_iter().reduce(|(low, high), (l, h)| {
            (from_fn(|a| l[a].min(low[a])), from_fn(|a| h[a].max(high[a])))
        })?;
        let bits_of = |largest: u64| u64::BITS - largest.leading_zeros();
        let bits = from_fn(|a| bits_of(high[a] - low[a]));
        let number_bits = bits_of(keys.len() as u64);
        (bits.iter().sum::<u32>() + number_bits < u64::BITS).then_some(Self {
            low,
            bits,
            number_bits,
        })
    }

    /// Key and number of every item, growing.
    fn sorted(&self, mut keys: Vec<u64>) -> Vec<u64> {
        parallel::for_each_mut(&mut keys, |i, key| *key = self.packed(*key, i as u64));
        // Buckets by the first bits, each of which is then sorted near the processor.
        let bits = self.bits.iter().sum::<u32>() + self.number_bits;
        let shift = bits - (self.number_bits.saturating_sub(BUCKET_BITS)).min(MOST_BUCKET_BITS);
        let mut ends = vec![0_usize; 1 << (bits - shift)];
        keys.iter().for_each(|key| ends[(key >> shift) as usize] += 1);
        let sizes = ends.clone();
        let mut start = 0;
        for end in &mut ends {
            start += std::mem::replace(end, start);
        }
        let mut sorted = vec![0; keys.len()];
        for key in keys {
            let end = &mut ends[(key >> shift) as usize];
            sorted[*end] = key;
            *end += 1;
        }
        let mut rest = &mut sorted[..];
        let bucket = |size: usize| rest.split_off_mut(..size).unwrap_or_default();
        let buckets: Vec<&mut [u64]> = sizes.into_iter().map(bucket).collect();
        parallel::for_each(buckets.into_iter(), |_, bucket| bucket.sort_unstable());
        sorted
    }

    fn packed(&self, key: u64, number: u64) -> u64 {
        let part = parts(key);
        let key = (0..3).fold(0, |key, a| key << self.bits[a] | (part[a] - self.low[a]));
        key << self.number_bits | number
    }

    /// The key of what [`Self::packed`] gives.
    fn key(&self, packed: u64) -> u64 {
        let mut rest = packed >> self.number_bits;
        let mut part = [0; 3];
        for a in (0..3).rev() {
            part[a] = self.low[a] + (rest & ((1 << self.bits[a]) - 1));
            rest >>= self.bits[a];
        }
        part.iter().fold(0, |key, part| key << KEY_BITS | part)
    }

    /// Its number.
    fn number(&self, packed: u64) -> u32 {
        (packed & ((1 << self.number_bits) - 1)) as u32
    }
}

/// The coordinates in a [`key`].
fn parts(key: u64) -> [u64; 3] {
    let mask = (1 << KEY_BITS) - 1;
    [key >> (2 * KEY_BITS), key >> KEY_BITS & mask, key & mask]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn items_stand_by_key_and_number(
            cells in prop::collection::vec(prop::array::uniform3(-30_i32..30), 0..3000),
            apart in prop::sample::select(vec![1, 1 << 5, 1 << 14]),
        ) {
            let keys: Vec<u64> = cells.iter().map(|cell| key(cell.map(|c| apart * c))).collect();
            let mut wanted: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
            for (i, &key) in (0..).zip(&keys) {
                wanted.entry(key).or_default().push(i);
            }
            let found = CellGroups::new(keys.len(), |i| keys[i]);
            prop_assert_eq!(&found.keys, &wanted.keys().copied().collect::<Vec<_>>());
            prop_assert!((0..found.len()).map(|i| found.of(i)).eq(wanted.values()));
        }

        #[test]
        fn what_is_within_a_range_is_found_from_any_earlier_cell(
            items in prop::collection::vec(0..60_u64, 0..40), low in 0..60_u64, length in 0..9_u64, back in 0..30_usize,
        ) {
            let cells = CellGroups::new(items.len(), |i| items[i]);
            let mut keys = items.clone();
            keys.sort_unstable();
            keys.dedup();
            let first = keys.partition_point(|&k| k < low);
            let found = cells.within(first.saturating_sub(back), low..=low + length);
            let inside = keys.iter().filter(|&&k| (low..=low + length).contains(&k)).count();
            prop_assert_eq!(found, first..first + inside);
        }
    }
}
