//! Quantisers: what becomes an integer on its way into the file, and back.
//!
//! Dequantisation is a fixed sequence of correctly rounded operations (products, quotients, square roots), so
//! that every platform decodes the same numbers.

use crate::error::{Error, Result};

/// Uniform quantiser with zero in the middle of an interval (mid-tread), optionally with a wider dead zone.
///
/// `q = sign(x) floor(|x| / step + rounding)`, and back `x' = step q`. With `rounding = 1/2` it is the nearest
/// multiple; less rounding widens the zero interval to `2 (1 - rounding) step`, which saves bits on sparse
/// residuals for little error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uniform {
    step: f32,
    rounding: f64,
}

impl Uniform {
    /// To the nearest multiple of `step`, in the unit of the values. The step has the precision that the file
    /// keeps.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `step` is a positive normal number.
    pub fn new(step: f32) -> Result<Self> {
        if step.is_normal() && step > 0.0 {
            Ok(Self { step, rounding: 0.5 })
        } else {
            Err(Error::invalid("quantiser step", step, "a positive normal number"))
        }
    }

    /// This quantiser with the given rounding; only the encoder needs it.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `rounding` is 0 to 0.5.
    pub fn with_rounding(self, rounding: f64) -> Result<Self> {
        if (0.0..=0.5).contains(&rounding) {
            Ok(Self { rounding, ..self })
        } else {
            Err(Error::invalid("quantiser rounding", rounding, "0 to 0.5"))
        }
    }

    /// The step, as it stands in the file.
    pub fn step(&self) -> f32 {
        self.step
    }

    /// Largest difference of a value and what it decodes to, but for rounding in double precision.
    pub fn max_error(&self) -> f64 {
        f64::from(self.step) * (1.0 - self.rounding)
    }

    /// The integer that stands for `value`.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when `value` is not finite or its integer does not fit 32 bits.
    #[inline]
    pub fn quantize(&self, value: f64) -> Result<i32> {
        let steps = (value.abs() / f64::from(self.step) + self.rounding).floor();
        if steps <= f64::from(i32::MAX) {
            let magnitude = steps as i32;
            Ok(if value < 0.0 { -magnitude } else { magnitude })
        } else {
            Err(Error::invalid("value to quantise", value, "finite and below 2^31 quantiser steps"))
        }
    }

    /// The value that `index` stands for.
    #[inline]
    pub fn dequantize(&self, index: i32) -> f64 {
        f64::from(index) * f64::from(self.step)
    }
}

/// Quantiser of unit vectors on the octahedron `|x| + |y| + |z| = 1` (Meyer et al., "On Floating-Point Normal
/// Vectors", 2010; Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", 2014).
///
/// The upper half of the octahedron is seen from above as a square's inner diamond, the lower half is folded out
/// to its corners. A code is a point of the grid `-half ..= half` in both axes, `half = 2^(bits - 1) - 1`, so
/// that the axes themselves have codes of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Octahedral {
    half: i32,
}

impl Octahedral {
    /// A quantiser with `bits` bits for each of the two coordinates.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `bits` is 3 to 16.
    pub fn new(bits: u32) -> Result<Self> {
        if (3..=16).contains(&bits) {
            Ok(Self { half: (1 << (bits - 1)) - 1 })
        } else {
            Err(Error::invalid("bits of a unit vector's coordinate", bits, "3 to 16"))
        }
    }

    /// Largest absolute value of a code's coordinates.
    pub fn half(&self) -> i32 {
        self.half
    }

    /// Largest angle in radians between a vector and what it decodes to: `asin(sqrt(2) / half)`.
    ///
    /// The grid splits each face of the octahedron into equilateral triangles of edge `sqrt(2) / half`, in
    /// which no point is farther than `sqrt(2/3) / half` from the nearest corner, and no point of the
    /// octahedron is closer to its centre than `sqrt(1/3)`. That is 2.6 degrees with 6 bits, 0.64 with 8, 0.16 with
    /// 10, 0.04 with 12.
    pub fn max_error(&self) -> f64 {
        (std::f64::consts::SQRT_2 / f64::from(self.half)).asin()
    }

    /// The code whose vector has the smallest angle to `vector`, which need not have unit length.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when `vector` is zero or not finite.
    pub fn quantize(&self, vector: [f32; 3]) -> Result<[i32; 2]> {
        let [x, y, z] = vector.map(f64::from);
        let norm = x.abs() + y.abs() + z.abs();
        if !(norm.is_finite() && norm > 0.0) {
            return Err(Error::invalid(
                "vector to quantise",
                format!("({x}, {y}, {z})"),
                "finite and not zero",
            ));
        }
        let [x, y, z] = [x / norm, y / norm, z / norm];
        let (u, v) = if z < 0.0 {
            ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y))
        } else {
            (x, y)
        };
        // The nearest code is a corner of the grid cell around (u, v).
        let half = f64::from(self.half);
        let corner = |t: f64| ((t * half).floor() as i32).clamp(-self.half, self.half - 1);
        let (u, v) = (corner(u), corner(v));
        let mut best = (f64::NEG_INFINITY, [u, v]);
        for code in [[u, v], [u + 1, v], [u, v + 1], [u + 1, v + 1]] {
            let [a, b, c] = self.direction(code).map(f64::from);
            let cosine = (a * x + b * y + c * z) / (a * a + b * b + c * c).sqrt();
            if cosine > best.0 {
                best = (cosine, code);
            }
        }
        Ok(best.1)
    }

    /// The unit vector that `code` stands for.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] when a coordinate is outside `-half ..= half`.
    pub fn dequantize(&self, code: [i32; 2]) -> Result<[f32; 3]> {
        if code.iter().any(|c| c.unsigned_abs() > self.half as u32) {
            return Err(Error::invalid(
                "code of a unit vector",
                format!("({}, {})", code[0], code[1]),
                "within the quantiser's range",
            ));
        }
        let [x, y, z] = self.direction(code).map(f64::from);
        // Sums of squares of integers below 2^15 are exact.
        let norm = (x * x + y * y + z * z).sqrt();
        Ok([(x / norm) as f32, (y / norm) as f32, (z / norm) as f32])
    }

    /// The point of the octahedron of size `half` that has the code; no coordinate exceeds `half`.
    #[inline]
    fn direction(&self, [u, v]: [i32; 2]) -> [i32; 3] {
        let z = self.half - u.abs() - v.abs();
        if z >= 0 {
            return [u, v, z];
        }
        let away = |magnitude: i32, side: i32| if side < 0 { -magnitude } else { magnitude };
        [away(self.half - v.abs(), u), away(self.half - u.abs(), v), z]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn uniform_error_is_bounded(
            value in -1e6_f64..1e6,
            step in 1e-3_f32..1e3,
            rounding in 0.0..=0.5_f64,
        ) {
            let quantizer = Uniform::new(step)?.with_rounding(rounding)?;
            let index = quantizer.quantize(value)?;
            let decoded = quantizer.dequantize(index);
            prop_assert!((value - decoded).abs() <= quantizer.max_error() + 1e-9 * value.abs());
            prop_assert_eq!(quantizer.quantize(-value)?, -index);
            if rounding == 0.5 {
                prop_assert!((value - decoded).abs() <= 0.5 * f64::from(step) + 1e-9 * value.abs());
            }
        }

        #[test]
        fn uniform_keeps_what_it_decoded(index: i32, exponent in -20..20) {
            // Powers of two make the product exact.
            let quantizer = Uniform::new(2.0_f32.powi(exponent))?;
            prop_assume!(index != i32::MIN);
            prop_assert_eq!(quantizer.quantize(quantizer.dequantize(index))?, index);
        }

        #[test]
        fn octahedral_error_is_bounded(
            vector in prop::array::uniform3(-1.0_f32..1.0),
            bits in 3_u32..=16,
        ) {
            prop_assume!(vector.iter().any(|c| c.abs() > 1e-6));
            let quantizer = Octahedral::new(bits)?;
            let code = quantizer.quantize(vector)?;
            let decoded = quantizer.dequantize(code)?;
            prop_assert!(angle(vector, decoded) <= quantizer.max_error() + 1e-6);
            let length: f64 = decoded.iter().map(|c| f64::from(*c).powi(2)).sum();
            prop_assert!((length - 1.0).abs() < 1e-6);
        }
    }

    /// The angle between two vectors, by the sine where the cosine is flat.
    fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
        let [a, b] = [a, b].map(|v| v.map(f64::from));
        let cross =
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
        cross.iter().map(|c| c * c).sum::<f64>().sqrt().atan2(dot)
    }

    #[test]
    fn uniform_zero_interval_widens() {
        let nearest = Uniform::new(1.0).unwrap();
        let dead_zone = nearest.with_rounding(0.25).unwrap();
        let quantize = |quantizer: Uniform| {
            [0.49, 0.51, 0.74, 0.76, 1.74, 1.76, -0.74, -0.76]
                .map(|x| quantizer.quantize(x).unwrap())
        };
        assert_eq!(quantize(nearest), [0, 1, 1, 1, 2, 2, -1, -1]);
        assert_eq!(quantize(dead_zone), [0, 0, 0, 1, 1, 2, 0, -1]);
    }

    #[test]
    fn uniform_refuses_what_has_no_integer() {
        for step in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-40] {
            assert!(Uniform::new(step).is_err(), "{step}");
        }
        let quantizer = Uniform::new(1.0).unwrap();
        assert!(quantizer.with_rounding(0.6).is_err());
        assert!(quantizer.with_rounding(f64::NAN).is_err());
        assert_eq!(quantizer.quantize(f64::from(i32::MAX)), Ok(i32::MAX));
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 2.0_f64.powi(31)] {
            assert!(quantizer.quantize(value).is_err(), "{value}");
        }
    }

    #[test]
    fn every_octahedral_code_decodes_to_its_own_direction() {
        for bits in 3..=7 {
            let quantizer = Octahedral::new(bits).unwrap();
            let half = quantizer.half();
            for u in -half..=half {
                for v in -half..=half {
                    let vector = quantizer.dequantize([u, v]).unwrap();
                    let again = quantizer.quantize(vector).unwrap();
                    // Codes on the square's rim come in pairs of the same direction.
                    assert_eq!(quantizer.dequantize(again).unwrap(), vector, "{u} {v}");
                    if u.abs() < half && v.abs() < half {
                        assert_eq!(again, [u, v]);
                    }
                }
            }
            assert!(quantizer.dequantize([half + 1, 0]).is_err());
            assert!(quantizer.dequantize([0, i32::MIN]).is_err());
        }
    }

    #[test]
    fn axes_are_exact() {
        let quantizer = Octahedral::new(6).unwrap();
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut vector = [0.0; 3];
                vector[axis] = 7.0 * sign;
                let decoded = quantizer.dequantize(quantizer.quantize(vector).unwrap()).unwrap();
                assert_eq!(decoded, vector.map(|c| c / 7.0));
            }
        }
    }

    #[test]
    fn octahedral_refuses_what_has_no_direction() {
        assert!(Octahedral::new(2).is_err());
        assert!(Octahedral::new(17).is_err());
        let quantizer = Octahedral::new(8).unwrap();
        assert!(quantizer.quantize([0.0; 3]).is_err());
        assert!(quantizer.quantize([f32::NAN, 0.0, 1.0]).is_err());
        assert!(quantizer.quantize([f32::INFINITY, 0.0, 1.0]).is_err());
        // No overflow or underflow on the way.
        for size in [f32::MAX, f32::MIN_POSITIVE, 1e-44] {
            let decoded = quantizer.dequantize(quantizer.quantize([0.0, size, 0.0]).unwrap());
            assert_eq!(decoded, Ok([0.0, 1.0, 0.0]));
        }
    }

    #[test]
    fn the_octahedral_bound_is_tight() {
        // Near the middle of a face the error comes close to the bound, so it is not a loose one.
        let quantizer = Octahedral::new(10).unwrap();
        let mut worst = 0.0_f64;
        for i in 0..200 {
            for j in 0..200 {
                let u = 0.33 + 1e-4 * f64::from(i);
                let v = 0.33 + 1e-4 * f64::from(j);
                let vector = [u as f32, v as f32, (1.0 - u - v) as f32];
                let decoded = quantizer.dequantize(quantizer.quantize(vector).unwrap()).unwrap();
                worst = worst.max(angle(vector, decoded));
            }
        }
        assert!(worst > 0.9 * quantizer.max_error(), "{worst} {}", quantizer.max_error());
        assert!(worst <= quantizer.max_error());
    }
}
