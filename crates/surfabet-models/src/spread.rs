//! Points spread evenly over a slab, without random numbers.

/// Fraction of the golden ratio: the fractions of its multiples fill an interval evenly.
const GOLDEN_FRACTION: f64 = 0.618_033_988_749_895;

/// Offset of point `k` from the middle of a slab whose depths have the standard deviation `s`: `sqrt(3) s (2 frac((k + 1/2) g) - 1)` with
/// the fraction `g` of the golden ratio. Points 0, 1, 2, ... fill the slab evenly, however many there are.
pub(crate) fn across(deviation: f64, k: usize) -> f64 {
    3.0_f64.sqrt() * deviation * (2.0 * ((k as f64 + 0.5) * GOLDEN_FRACTION).fract() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_those_asked_for() {
        let n = 1000;
        let mean = (0..n).map(|k| across(2.0, k)).sum::<f64>() / n as f64;
        let square = (0..n).map(|k| across(2.0, k).powi(2)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01 && (square - 4.0).abs() < 0.01, "{mean} {square}");
    }
}
