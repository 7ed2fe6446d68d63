//! The places that carry colour: the cells of a cubic grid that the surface with its thickness passes through.
//!
//! They follow from the geometry alone, in integers, so that a decoder knows them before it reads a colour.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use rayon::prelude::*;

use super::basis::{Basis, FRACTION, N_SHAPES};
use super::leaves::Leaf;
use super::model::{Geometry, PATCH_PIXELS};
use super::sheets::axes_of;

/// Bits of a cell coordinate.
const BITS: u32 = 21;

/// Every third bit.
const SPREAD: u64 = 0x1249_2492_4924_9249;

/// Hash for keys that are spread well by one multiplication.
#[derive(Default)]
pub(super) struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b));
        }
    }

    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 29;
    }
}

/// Index of each key.
pub(super) type KeyMap = HashMap<u64, u32, BuildHasherDefault<KeyHasher>>;

/// Map from sorted keys to their places.
pub(super) fn index(keys: &[u64]) -> KeyMap {
    (0..).zip(keys).map(|(i, &k)| (k, i)).collect()
}

/// Key of a cell: its coordinates' bits, interleaved.
pub(super) fn cell_key(cell: [i32; 3]) -> u64 {
    let spread = |c: i32| {
        let half = 1 << (BITS - 1);
        let mut x = (c.clamp(-half, half - 1) + half) as u64;
        x = (x | x << 32) & 0x001f_0000_0000_ffff;
        x = (x | x << 16) & 0x001f_0000_ff00_00ff;
        x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
        x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
        (x | x << 2) & SPREAD
    };
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// Cell of a key.
pub(super) fn cell_of_key(key: u64) -> [i32; 3] {
    std::array::from_fn(|a| {
        let mut x = key >> a & SPREAD;
        x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
        x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
        x = (x | x >> 8) & 0x001f_0000_ff00_00ff;
        x = (x | x >> 16) & 0x001f_0000_0000_ffff;
        x = (x | x >> 32) & 0x1f_ffff;
        x as i32 - (1 << (BITS - 1))
    })
}

/// Key of the cell one step along an axis, up or down; wraps at the rim of the grid, where no cell lies.
pub(super) fn step(key: u64, axis: usize, up: bool) -> u64 {
    let mask = SPREAD << axis;
    let of = if up {
        (key | !mask).wrapping_add(1 << axis)
    } else {
        (key & mask).wrapping_sub(1 << axis)
    };
    of & mask | key & !mask
}

/// Sorted keys of the cells of one finest pixel's side that the surface passes through, or `None` when there may
/// be more than `limit`.
pub(super) fn nodes(geometry: &Geometry, leaves: &[Leaf], limit: u64) -> Option<Vec<u64>> {
    let layers = |leaf: &Leaf| 2 * u64::from(leaf.patch.thickness) / CELL as u64 + 2;
    let bound: u64 = leaves
        .iter()
        .map(|l| (u64::from(l.patch.mask.count_ones()) << (2 * l.level)) * layers(l))
        .fold(0, u64::saturating_add);
    if bound > limit {
        return None;
    }
    let bases: Vec<Basis> =
        (0..geometry.levels).map(|l| Basis::new((PATCH_PIXELS << l) as usize)).collect();
    let of_leaf = |leaf: &Leaf| {
        let basis = &bases[leaf.level as usize];
        let [d, u, v] = axes_of(leaf.side);
        let width = PATCH_PIXELS << leaf.level;
        let half = i64::from(leaf.patch.thickness);
        let mut keys = Vec::new();
        for row in 0..width {
            for column in 0..width {
                if !leaf.is_set(column, row) {
                    continue;
                }
                let shapes = basis.at(2 * column as usize + 1, 2 * row as usize + 1);
                let steps: i64 = (0..N_SHAPES)
                    .map(|k| i64::from(leaf.patch.coefficients[k]) * i64::from(shapes[k]))
                    .sum();
                // Sixteenths of a pixel with fraction to quarters.
                let depth = (steps * i64::from(geometry.depth_step)) >> (FRACTION + 2);
                let low = (depth - half).div_euclid(CELL);
                let high = (depth + half - i64::from(half > 0)).div_euclid(CELL);
                let mut at = [0; 3];
                at[u] = leaf.corner[0] + column;
                at[v] = leaf.corner[1] + row;
                for depth in low..=high {
                    at[d] = depth.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
                    keys.push(cell_key(at));
                }
            }
        }
        keys
    };
    let mut keys: Vec<u64> = leaves.par_iter().flat_map_iter(of_leaf).collect();
    keys.par_sort_unstable();
    keys.dedup();
    Some(keys)
}

/// Side of a cell, in the quarter pixels that thickness is said in.
const CELL: i64 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn keys_and_steps_agree_with_coordinates(cell in prop::array::uniform3(-1_000_000_i32..1_000_000)) {
            let key = cell_key(cell);
            prop_assert_eq!(cell_of_key(key), cell);
            for axis in 0..3 {
                let mut next = cell;
                next[axis] += 1;
                prop_assert_eq!(step(key, axis, true), cell_key(next));
                prop_assert_eq!(step(cell_key(next), axis, false), key);
            }
        }
    }
}
