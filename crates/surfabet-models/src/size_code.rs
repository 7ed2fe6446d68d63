//! Sizes that need no more than a quarter of a doubling, as a byte.

/// Steps per doubling.
const STEPS_PER_DOUBLING: f64 = 4.0;

/// Largest code of a size.
pub(crate) const MAX_SIZE_CODE: u8 = 255;

/// Code of a size that is `value` units: zero below half a unit, else such that the size is `2^((code - 1) / 4)`.
pub(crate) fn size_code(value: f64) -> u8 {
    if value.is_nan() || value < 0.5 {
        return 0;
    }
    (1.0 + STEPS_PER_DOUBLING * value.log2()).round().clamp(1.0, f64::from(MAX_SIZE_CODE)) as u8
}

/// The size of a code, in units.
pub(crate) fn size_of_code(code: u8) -> f64 {
    if code == 0 { 0.0 } else { ((f64::from(code) - 1.0) / STEPS_PER_DOUBLING).exp2() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_comes_back() {
        for code in 0..=MAX_SIZE_CODE {
            assert_eq!(size_code(size_of_code(code)), code);
        }
    }

    #[test]
    fn what_is_no_size_is_zero() {
        assert_eq!([f64::NAN, -1.0, 0.0, 0.49].map(size_code), [0; 4]);
        assert_eq!(size_code(f64::INFINITY), MAX_SIZE_CODE);
    }
}
