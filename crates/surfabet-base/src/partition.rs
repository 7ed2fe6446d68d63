//! Items by equal keys, where there are few keys beside the items: quicker than sorting.

use rustc_hash::FxHashMap;

/// Items of equal keys.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Partition {
    /// Different keys, growing.
    pub keys: Vec<u64>,
    /// Number of items of each.
    pub counts: Vec<usize>,
    /// Numbers of the items, key by key, of each key growing.
    pub order: Vec<u32>,
}

impl Partition {
    /// The items that have these keys.
    pub fn of(keys: &[u64]) -> Self {
        let Numbered { keys: found, counts, of_items } = Numbered::of(keys);
        let mut by_key: Vec<usize> = (0..found.len()).collect();
        by_key.sort_unstable_by_key(|&number| found[number]);
        let mut next = vec![0; found.len()];
        let mut start = 0;
        for &number in &by_key {
            next[number] = start;
            start += counts[number];
        }
        let mut order = vec![0; keys.len()];
        for (i, &number) in (0..).zip(&of_items) {
            let next = &mut next[number as usize];
            order[*next] = i;
            *next += 1;
        }
        let keys = by_key.iter().map(|&number| found[number]).collect();
        let counts = by_key.iter().map(|&number| counts[number]).collect();
        Self { keys, counts, order }
    }

    /// The items of each key.
    pub fn parts(&self) -> Vec<&[u32]> {
        let mut rest = &self.order[..];
        let part = |&count: &usize| rest.split_off(..count).unwrap_or_default();
        self.counts.iter().map(part).collect()
    }
}

/// Keys by number, in the order of their first items.
struct Numbered {
    keys: Vec<u64>,
    counts: Vec<usize>,
    /// Number of the key of every item.
    of_items: Vec<u32>,
}

impl Numbered {
    fn of(keys: &[u64]) -> Self {
        let (mut found, mut counts) = (Vec::new(), Vec::new());
        let mut of_items = Vec::with_capacity(keys.len());
        let mut numbers: FxHashMap<u64, u32> = FxHashMap::default();
        // Most items have the key of the one before.
        let mut last: Option<(u64, u32)> = None;
        for &key in keys {
            let number = match last {
                Some((before, number)) if before == key => number,
                _ => *numbers.entry(key).or_insert_with(|| {
                    found.push(key);
                    counts.push(0);
                    found.len() as u32 - 1
                }),
            };
            last = Some((key, number));
            counts[number as usize] += 1;
            of_items.push(number);
        }
        Self { keys: found, counts, of_items }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn items_stand_by_key_and_number() {
        for (n, n_keys) in [(0, 1), (1, 1), (100, 1), (1000, 7), (1000, 900)] {
            let key = |i: u64| (i * 7919 + i / 3 * 13) % n_keys * (u64::MAX / 1000);
            let keys: Vec<u64> = (0..n).map(key).collect();
            let mut wanted: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
            for (i, &key) in (0..).zip(&keys) {
                wanted.entry(key).or_default().push(i);
            }
            let found = Partition::of(&keys);
            assert_eq!(found.keys, wanted.keys().copied().collect::<Vec<_>>());
            assert_eq!(found.parts(), wanted.values().collect::<Vec<_>>());
        }
    }
}
