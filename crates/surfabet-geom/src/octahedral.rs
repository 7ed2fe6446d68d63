//! Unit vectors as two integers, by projection onto the octahedron |x| + |y| + |z| = 1.
//!
//! Seen from above, its upper half is a square's inner diamond; the lower half is folded out to the square's
//! corners (Z. H. Cigolle et al.: A Survey of Efficient Representations for Independent Unit Vectors, JCGT 2014).
//! A code is a point of the grid `-half..=half` in both axes, `half = 2^(bits - 1) - 1`, so the six global axes
//! have codes of their own: floors and walls are exact.

use surfabet_base::rounding::floor_near_zero;

/// Largest absolute value of a code's coordinates at `bits` bits each; `bits` is 3 to 16.
pub const fn half(bits: u32) -> i32 {
    (1 << (bits - 1)) - 1
}

/// Largest angle, radians, between a vector and what its code of `bits` bits decodes to.
///
/// The grid splits each face of the octahedron into equilateral triangles of edge √2 / half, in which no point
/// is farther than √(2/3) / half from the nearest corner, and no point of the octahedron is closer to its centre
/// than √(1/3). That is 1.3 degrees with 7 bits, 0.64 with 8, 0.16 with 10.
pub fn max_error(bits: u32) -> f64 {
    (std::f64::consts::SQRT_2 / f64::from(half(bits))).asin()
}

/// The point of the octahedron of size `half` that has the code; no coordinate exceeds `half`.
fn direction([u, v]: [i32; 2], half: i32) -> [i32; 3] {
    let z = half - u.abs() - v.abs();
    // In both halves without branches, which no processor could predict. `away` gives a magnitude the sign of `side`.
    let away = |magnitude: i32, side: i32| (magnitude ^ side >> 31) - (side >> 31);
    let folded = [away(half - v.abs(), u), away(half - u.abs(), v)];
    let is_below = z >> 31;
    let either = |above: i32, below: i32| above ^ (above ^ below) & is_below;
    [either(u, folded[0]), either(v, folded[1]), z]
}

/// [`direction`] of a code that is not read but sought, in the numbers that it is compared in: half the time of integers, which
/// for codes that are read would be twice as much.
fn wanted_direction([u, v]: [f64; 2], half: f64) -> [f64; 3] {
    let z = half - u.abs() - v.abs();
    // Below, both coordinates are folded back by the depth.
    let depth = (-z).max(0.0);
    [u - depth.copysign(u), v - depth.copysign(v), z]
}

/// The direction of a code in integers, of absolute sum [`half`]; coordinates beyond the grid are taken to its rim.
pub fn integer_direction(code: [i32; 2], bits: u32) -> [i32; 3] {
    let half = half(bits);
    direction(code.map(|c| c.clamp(-half, half)), half)
}

/// The code whose direction is nearest to `vector` among the four about its projection. The vector need not have
/// unit length; one that is zero or not finite gets the code of the z-axis.
pub fn encode(vector: [f32; 3], bits: u32) -> [i32; 2] {
    let half = half(bits);
    let [x, y, z] = vector.map(f64::from);
    let norm = x.abs() + y.abs() + z.abs();
    if !(norm.is_finite() && norm > 0.0) {
        return [0, 0];
    }
    let [x, y, z] = [x / norm, y / norm, z / norm];
    let (u, v) =
        if z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    let corner = |t: f64| floor_near_zero(t * f64::from(half)).clamp(-half, half - 1);
    let (u, v) = (corner(u), corner(v));
    let corners = [[u, v], [u + 1, v], [u, v + 1], [u + 1, v + 1]];
    let cosines = corners.map(|code| {
        let [a, b, c] = wanted_direction(code.map(f64::from), f64::from(half));
        (a * x + b * y + c * z) / (a * a + b * b + c * c).sqrt()
    });
    // Of equal ones the first, found without branches: any of the four may be the nearest.
    let later = |i: usize, j: usize| if cosines[j] > cosines[i] { j } else { i };
    corners[later(later(0, 1), later(2, 3))]
}

/// The unit vector of a code; coordinates beyond the grid are taken to its rim.
pub fn decode(code: [i32; 2], bits: u32) -> [f32; 3] {
    let [x, y, z] = integer_direction(code, bits).map(f64::from);
    // Sums of squares of integers below 2^15 are exact, and at least one coordinate is not zero.
    let norm = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c / norm) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
        let [a, b] = [a, b].map(|v| v.map(f64::from));
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross =
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        dot(cross, cross).sqrt().atan2(dot(a, b))
    }

    proptest! {
        #[test]
        fn the_angle_stays_within_the_bound(
            v in prop::array::uniform3(-1.0_f32..1.0),
            bits in 3_u32..=16,
        ) {
            prop_assume!(v.iter().any(|c| c.abs() > 1e-2));
            let decoded = decode(encode(v, bits), bits);
            prop_assert!(angle(v, decoded) <= max_error(bits) + 1e-6);
            let norm: f64 = decoded.iter().map(|c| f64::from(*c).powi(2)).sum();
            prop_assert!((norm - 1.0).abs() < 1e-6);
        }

        #[test]
        fn both_directions_of_a_code_are_one(code in prop::array::uniform2(-127_i32..=127)) {
            let wanted = wanted_direction(code.map(f64::from), 127.0);
            prop_assert_eq!(wanted, direction(code, 127).map(f64::from));
        }

        #[test]
        fn a_direction_on_the_grid_comes_back(code in prop::array::uniform2(-63_i32..=63)) {
            let direction = decode(code, 7);
            prop_assert!(angle(direction, decode(encode(direction, 7), 7)) < 1e-6);
        }
    }

    #[test]
    fn the_global_axes_are_exact() {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut v = [0.0; 3];
                v[axis] = sign;
                assert_eq!(decode(encode(v, 7), 7), v);
            }
        }
    }

    #[test]
    fn odd_input_gets_a_code() {
        assert_eq!(encode([0.0; 3], 7), [0, 0]);
        assert_eq!(encode([f32::NAN, 1.0, 0.0], 7), [0, 0]);
        assert_eq!(decode(encode([f32::MIN_POSITIVE, 0.0, 0.0], 7), 7), [1.0, 0.0, 0.0]);
    }
}
