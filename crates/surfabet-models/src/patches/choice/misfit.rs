//! Distance of what is decoded from what was measured, of slabs of depth.

use crate::patches::constants::THIN_WEIGHT;
use crate::patches::sheets::Run;

/// Mean squared distance of points spread evenly over the slab `A = [a0, a1]` from the slab `B = [b0, b1]`.
///
/// Points above `B` are off by `t - b1`, those below by `b0 - t`, and the integrals of the squares are cubes:
/// `E(A, B) = ((a1 - b1)+^3 - (a0 - b1)+^3 + (b0 - a0)+^3 - (b0 - a1)+^3) / (3 (a1 - a0))`, where `(x)+` is `x` if
/// positive, else zero.
fn excess(a: [f32; 2], b: [f32; 2]) -> f32 {
    let cube = |x: f32| if x > 0.0 { x * x * x } else { 0.0 };
    let above = cube(a[1] - b[1]) - cube(a[0] - b[1]);
    let below = cube(b[0] - a[0]) - cube(b[0] - a[1]);
    (above + below) / (3.0 * (a[1] - a[0]))
}

/// Distortion per sample of a run in the slab A, decoded as the slab B of half thickness `half` about `depth`, squared
/// pixels: `E(A, B) + w E(B, A) + s (m - depth)^2`, with the middle m of the run and the weights w of decoded points
/// and s of the thin surface.
pub(super) fn misfit(run: &Run, depth: f32, half: f32, decoded_weight: f32) -> f32 {
    let input = [run.depth - run.half, run.depth + run.half];
    let decoded = [depth - half, depth + half];
    let off = run.depth - depth;
    excess(input, decoded) + decoded_weight * excess(decoded, input) + THIN_WEIGHT * off * off
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
        let run = Run { u: 0, v: 0, n: 1.0, depth: 3.0, half: 1.5, stray: 0.0 };
        assert_eq!(misfit(&run, 3.0, 1.5, 2.0), 0.0);
        assert!(misfit(&run, 3.5, 1.5, 2.0) > 0.0 && misfit(&run, 3.0, 1.0, 2.0) > 0.0);
    }
}
