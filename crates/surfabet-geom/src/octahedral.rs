//! Unit vectors as two integers, by projection onto an octahedron.
//!
//! The sphere is projected onto the octahedron |x| + |y| + |z| = 1, whose lower half is folded outward over the
//! upper one, so that the square [-1, 1]² holds all directions with little distortion (Z. H. Cigolle et al.:
//! A Survey of Efficient Representations for Independent Unit Vectors, JCGT 2014).

/// Largest number of bits per coordinate.
pub const MAX_BITS: u32 = 16;

fn fold([u, v]: [f64; 2]) -> [f64; 2] {
    let sign = |c: f64| if c < 0.0 { -1.0 } else { 1.0 };
    [(1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)]
}

/// The code, two coordinates of `bits` bits each, whose direction is nearest to `vector` among the four around
/// its projection. A zero vector gets the code of the z-axis.
pub fn encode(vector: [f32; 3], bits: u32) -> [u32; 2] {
    let v = vector.map(f64::from);
    let l1 = v[0].abs() + v[1].abs() + v[2].abs();
    let v = if l1 > 0.0 && l1.is_finite() { v.map(|c| c / l1) } else { [0.0, 0.0, 1.0] };
    let square = if v[2] < 0.0 { fold([v[0], v[1]]) } else { [v[0], v[1]] };
    let top = f64::from((1_u32 << bits) - 1);
    let exact = square.map(|c| (0.5 * (c + 1.0) * top).clamp(0.0, top));
    let mut best = ([0; 2], f64::NEG_INFINITY);
    for corner in 0..4 {
        let round = |c: f64, up: bool| if up { c.ceil() } else { c.floor() } as u32;
        let code = [round(exact[0], corner & 1 != 0), round(exact[1], corner & 2 != 0)];
        let d = decode_f64(code, bits);
        let cosine = d[0] * v[0] + d[1] * v[1] + d[2] * v[2];
        if cosine > best.1 {
            best = (code, cosine);
        }
    }
    best.0
}

fn decode_f64(code: [u32; 2], bits: u32) -> [f64; 3] {
    let top = f64::from((1_u32 << bits) - 1);
    let [u, v] = code.map(|c| f64::from(c) / top * 2.0 - 1.0);
    let z = 1.0 - u.abs() - v.abs();
    let [x, y] = if z < 0.0 { fold([u, v]) } else { [u, v] };
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    [x * scale, y * scale, z * scale]
}

/// The unit vector of a code.
pub fn decode(code: [u32; 2], bits: u32) -> [f32; 3] {
    decode_f64(code, bits).map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
        let [a, b] = [a, b].map(|v| v.map(f64::from));
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        dot(cross, cross).sqrt().atan2(dot(a, b))
    }

    proptest! {
        /// A cell of the square is 2 / (2^bits - 1) wide, and the projection stretches angles at most
        /// threefold (at the octahedron's face centres, where |v| = 1 / sqrt(3)).
        #[test]
        fn the_angle_stays_within_the_cell(
            v in prop::array::uniform3(-1.0_f32..1.0),
            bits in 4_u32..=16,
        ) {
            let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
            prop_assume!(length > 1e-2);
            let unit = v.map(|c| c / length);
            let decoded = decode(encode(unit, bits), bits);
            let cell = 2.0 / f64::from((1_u32 << bits) - 1);
            prop_assert!(angle(unit, decoded) < 1.5 * cell + 1e-6);
            let norm: f64 = decoded.iter().map(|c| f64::from(*c).powi(2)).sum();
            prop_assert!((norm - 1.0).abs() < 1e-6);
        }

        #[test]
        fn a_code_of_a_direction_inside_the_square_is_stable(
            code in prop::array::uniform2(1_u32..126),
        ) {
            let direction = decode(code, 7);
            let again = decode(encode(direction, 7), 7);
            prop_assert!(angle(direction, again) < 1e-6);
        }
    }

    #[test]
    fn odd_input_gets_a_code() {
        for odd in [[0.0; 3], [f32::MIN_POSITIVE; 3]] {
            let code = encode(odd, 7);
            assert!(code.iter().all(|&c| c < 128));
        }
    }
}
