//! Cells of a cubic grid, by the integers that number them.

use surfabet_base::rounding::{floor_f32, floor_f64};

use crate::morton;

/// Coordinates that a [`key`] distinguishes: at least `-HALF` and below `HALF`.
pub const HALF: i32 = 1 << (morton::BITS - 1);

/// The cell of side `size` that a position lies in: `floor(p / size)`.
#[inline]
pub fn cell_of(p: [f32; 3], size: f32) -> [i32; 3] {
    p.map(|c| floor_f32(c / size))
}

/// The cell of side `size` that a position in double precision lies in: `floor(p / size)`.
#[inline]
pub fn wide_cell_of(p: [f64; 3], size: f64) -> [i64; 3] {
    p.map(|c| floor_f64(c / size))
}

/// Key of a cell: the Morton code of its coordinates, counted from `-HALF`. Cells outside have the key of the
/// nearest inside.
#[inline]
pub fn key(cell: [i32; 3]) -> u64 {
    morton::encode(cell.map(|c| (c.clamp(-HALF, HALF - 1) + HALF) as u64))
}

/// Cell of a [`key`].
#[inline]
pub fn of_key(key: u64) -> [i32; 3] {
    morton::decode(key).map(|c| c as i32 - HALF)
}

/// A cell and the 26 that touch it, x fastest.
pub fn around([x, y, z]: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let step = |c: i32, k: i32| c.saturating_add(k % 3 - 1);
    (0..27).map(move |k| [step(x, k), step(y, k / 3), step(z, k / 9)])
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_position_lies_in_its_cell(
            p in prop::array::uniform3(-100.0_f32..100.0), size in 0.01_f32..10.0,
        ) {
            let wide = wide_cell_of(p.map(f64::from), f64::from(size));
            for a in 0..3 {
                let from = wide[a] as f64 * f64::from(size);
                let offset = f64::from(p[a]) - from;
                prop_assert!((-1e-12..f64::from(size) + 1e-12).contains(&offset), "{offset}");
                // In single precision the quotient may round across a face.
                prop_assert!((i64::from(cell_of(p, size)[a]) - wide[a]).abs() <= 1);
            }
        }

        #[test]
        fn keys_come_back(cell in prop::array::uniform3(-HALF..HALF)) {
            prop_assert_eq!(of_key(key(cell)), cell);
        }

        #[test]
        fn cells_around_touch(cell in prop::array::uniform3(-1000_i32..1000)) {
            let found: BTreeSet<[i32; 3]> = around(cell).collect();
            prop_assert_eq!(found.len(), 27);
            prop_assert!(found.iter().all(|c| (0..3).all(|a| (c[a] - cell[a]).abs() <= 1)));
        }
    }

    #[test]
    fn cells_beyond_the_keys_are_taken_to_the_rim() {
        assert_eq!(of_key(key([i32::MIN, i32::MAX, 5])), [-HALF, HALF - 1, 5]);
        assert_eq!(cell_of([-0.1, 0.0, f32::MAX], 1.0), [-1, 0, i32::MAX]);
        assert_eq!(around([i32::MAX; 3]).last(), Some([i32::MAX; 3]));
    }
}
