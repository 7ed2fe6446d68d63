//! Rounding to whole numbers without calls.
//!
//! Not every x86-64 processor has instructions that round, so that `floor` and `round` of the standard library are calls where
//! a program is to run on all of them. Conversions to integers are instructions that each has. Results are those of the
//! standard library followed by `as`: what is out of range becomes the nearest integer that there is, and NaN zero.

/// The number of single precision next to a half, below it.
const BELOW_HALF_F32: f32 = f32::from_bits(0.5_f32.to_bits() - 1);

/// The number of double precision next to a half, below it.
const BELOW_HALF_F64: f64 = f64::from_bits(0.5_f64.to_bits() - 1);

/// `c.floor() as i32`.
#[inline]
pub fn floor_f32(c: f32) -> i32 {
    let towards_zero = c as i32;
    towards_zero.saturating_sub(i32::from(towards_zero as f32 > c))
}

/// `c.floor() as i64`.
#[inline]
pub fn floor_f64(c: f64) -> i64 {
    let towards_zero = c as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > c))
}

/// `c.floor() as i32` of a number between -2^31 and 2^31; of any other, and of NaN, some integer.
///
/// Without the comparisons by which a conversion keeps to its range. Numbers of this size added to 1.5 * 2^52 have steps of one,
/// so the sum is rounded to an integer, which its low bits hold.
#[inline]
pub fn floor_near_zero(c: f64) -> i32 {
    const STEPS_OF_ONE: f64 = 1.5 * (1_u64 << 52) as f64;
    let sum = c + STEPS_OF_ONE;
    let nearest = sum.to_bits() as i32;
    nearest.wrapping_sub(i32::from(sum - STEPS_OF_ONE > c))
}

/// `c.round() as i32`: the nearest integer, of two the one farther from zero.
#[inline]
pub fn round_f32(c: f32) -> i32 {
    // A half itself would take the number below a half to one.
    (c + BELOW_HALF_F32.copysign(c)) as i32
}

/// `c.round() as i64`: the nearest integer, of two the one farther from zero.
#[inline]
pub fn round_f64(c: f64) -> i64 {
    (c + BELOW_HALF_F64.copysign(c)) as i64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn check_f32(c: f32) {
        assert_eq!(floor_f32(c), c.floor() as i32, "{c:?}");
        assert_eq!(round_f32(c), c.round() as i32, "{c:?}");
    }

    fn check_f64(c: f64) {
        assert_eq!(floor_f64(c), c.floor() as i64, "{c:?}");
        assert_eq!(round_f64(c), c.round() as i64, "{c:?}");
        let nearest = floor_near_zero(c);
        if c.abs() < 2.0_f64.powi(31) {
            assert_eq!(nearest, c.floor() as i32, "{c:?}");
        }
    }

    proptest! {
        #[test]
        fn of_any_number(bits: u32, wide_bits: u64) {
            check_f32(f32::from_bits(bits));
            check_f64(f64::from_bits(wide_bits));
        }

        /// Half integers and their neighbours, of all sizes.
        #[test]
        fn about_halves(halves: i32, shift in 0_u32..31, wide_halves: i64, wide_shift in 0_u32..63) {
            let c = (halves >> shift) as f32 / 2.0;
            [c.next_down(), c, c.next_up()].into_iter().for_each(check_f32);
            let c = f64::from(halves >> shift) / 2.0;
            [c.next_down(), c, c.next_up()].into_iter().for_each(check_f64);
            let c = (wide_halves >> wide_shift) as f64 / 2.0;
            [c.next_down(), c, c.next_up()].into_iter().for_each(check_f64);
        }
    }

    #[test]
    fn of_special_numbers() {
        let bounds =
            [2.0_f32.powi(23), 2.0_f32.powi(24), 2.0_f32.powi(31), f32::INFINITY, f32::NAN];
        bounds.into_iter().chain([0.0]).flat_map(|c| [c, -c]).for_each(check_f32);
        let bounds =
            [2.0_f64.powi(52), 2.0_f64.powi(53), 2.0_f64.powi(63), f64::INFINITY, f64::NAN];
        bounds.into_iter().chain([0.0]).flat_map(|c| [c, -c]).for_each(check_f64);
    }
}
