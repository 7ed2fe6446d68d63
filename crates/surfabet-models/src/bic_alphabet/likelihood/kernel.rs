//! The Gaussian of eq. 12 without its normaliser, cut off at 3 sigma (eq. 10), as an integer.

/// Bits of a Gaussian's fraction.
pub(super) const KERNEL_BITS: u32 = 22;

/// Largest `|d - r|^2 / (2 sigma^2)` that counts: 3 sigma (eq. 10).
const MAX_EXPONENT: f32 = 4.5;

/// `exp(-e)` for `e` up to [`MAX_EXPONENT`], in units of 2^-22, off by at most 3e-7 + 2e-6 of the value; zero beyond.
#[inline(always)]
pub(super) fn gaussian(e: f32) -> u32 {
    // y = e / 16: exp(-y) = 1 + y q(y) with the cubic q of the least relative error up to MAX_EXPONENT / 16, 3e-8. Four
    // squarings give exp(-e) with a relative error of 1e-6.
    let y = e * (1.0 / 16.0);
    let q = ((0.036_303_406 * y - 0.165_411_64) * y + 0.499_882_13) * y - 0.999_996_5;
    let p1 = 1.0 + y * q;
    let p2 = p1 * p1;
    let p4 = p2 * p2;
    let p8 = p4 * p4;
    let p16 = p8 * p8;
    let inside = if e <= MAX_EXPONENT { p16 } else { 0.0 };
    // Adding 2^23 leaves the rounded integer in the mantissa.
    let shifted = inside * (1 << KERNEL_BITS) as f32 + (1 << 23) as f32;
    shifted.to_bits() & ((1 << 23) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_the_exponential() {
        for k in 0..=4500 {
            let e = k as f32 * 1e-3;
            let found = f64::from(gaussian(e)) / f64::from(1 << KERNEL_BITS);
            let exact = (-f64::from(e)).exp();
            assert!((found - exact).abs() < 3e-7 + 2e-6 * exact, "{e}: {found} {exact}");
        }
        assert_eq!(gaussian(4.51), 0);
        assert_eq!(gaussian(f32::INFINITY), 0);
        assert_eq!(gaussian(f32::NAN), 0);
    }
}
