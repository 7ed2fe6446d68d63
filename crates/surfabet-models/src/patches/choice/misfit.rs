//! Distance of what is decoded from what was measured, of slabs of depth.

use crate::patches::constants::THIN_WEIGHT;

/// A stretch of depth that is evenly filled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slab {
    /// Of the middle.
    pub depth: f32,
    /// Half of the thickness.
    pub half: f32,
}

impl Slab {
    fn ends(self) -> [f32; 2] {
        [self.depth - self.half, self.depth + self.half]
    }
}

/// Mean squared distance of points spread evenly over the slab `A = [a0, a1]` from the slab `B = [b0, b1]`.
///
/// Points above `B` are off by `t - b1`, those below by `b0 - t`, and the integrals of the squares are cubes:
/// `E(A, B) = ((a1 - b1)+^3 - (a0 - b1)+^3 + (b0 - a0)+^3 - (b0 - a1)+^3) / (3 (a1 - a0))`, where `(x)+` is `x` if
/// positive, else zero.
fn excess(a: [f32; 2], b: [f32; 2]) -> f32 {
    let cube = |x: f32| {
        let positive = x.max(0.0);
        positive * positive * positive
    };
    let above = cube(a[1] - b[1]) - cube(a[0] - b[1]);
    let below = cube(b[0] - a[0]) - cube(b[0] - a[1]);
    (above + below) / (3.0 * (a[1] - a[0]))
}

/// Distortion per sample of a run in the slab A, decoded as the slab B, squared pixels: `E(A, B) + w E(B, A) + s (a - b)^2`,
/// with the middles a and b, and the weights w of decoded points and s of the thin surface.
pub(super) fn misfit(run: Slab, decoded: Slab, decoded_weight: f32) -> f32 {
    let (input, output) = (run.ends(), decoded.ends());
    let off = run.depth - decoded.depth;
    excess(input, output) + decoded_weight * excess(output, input) + THIN_WEIGHT * off * off
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn excess_is_the_mean_squared_distance_of_a_slab(
            a in -5.0_f32..5.0, width in 0.2_f32..4.0, b in -5.0_f32..5.0, other in 0.2_f32..4.0,
        ) {
            let (slab, from) = ([a, a + width], [b, b + other]);
            let n = 4000;
            let numeric = (0..n)
                .map(|i| {
                    let t = a + width * (i as f32 + 0.5) / n as f32;
                    let off = (from[0] - t).max(t - from[1]).max(0.0);
                    f64::from(off * off)
                })
                .sum::<f64>() / f64::from(n);
            let exact = f64::from(excess(slab, from));
            prop_assert!((exact - numeric).abs() < 1e-3 * numeric.max(1.0), "{exact} {numeric}");
        }
    }

    #[test]
    fn equal_slabs_have_no_misfit() {
        let slab = |depth, half| Slab { depth, half };
        let run = slab(3.0, 1.5);
        assert_eq!(misfit(run, run, 2.0), 0.0);
        assert!(misfit(run, slab(3.5, 1.5), 2.0) > 0.0 && misfit(run, slab(3.0, 1.0), 2.0) > 0.0);
    }
}
