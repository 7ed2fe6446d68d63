//! Estimates of the decisions of a field: the log-odds that small networks give of what is around.
//!
//! Models of contexts learn from each file afresh, and each looks at two or three things. A network looks at all of them at once and
//! was trained before. Its estimate counts beside the models as one more of them, with a weight that learns as well, so that
//! they make up for what is not as in the scenes that it was trained on. Whole numbers, so that readers and writers agree.

/// Numbers that the estimate of whether a cell has coefficients depends on.
pub(super) const OF_ANY: usize = 18;

/// Numbers that those of a coefficient depend on.
pub(super) const OF_COEFFICIENT: usize = 29;

/// Units of a network.
const HIDDEN: usize = 12;

/// Fractional bits of a sum beyond those of log-odds.
const SUM_BITS: u32 = 13;

/// Largest log-odds, in units of 2^-11: twelve bits.
const MAX_ODDS: i64 = 12 << 11;

/// A unit: a sum of the inputs, counted where it is above zero.
pub(super) struct Unit<const I: usize> {
    /// In units of 2^-12, as the bias and the weight.
    pub inputs: [i32; I],
    pub bias: i32,
    pub weight: i32,
}

/// A network of one layer.
pub(super) struct Network<const I: usize> {
    pub units: [Unit<I>; HIDDEN],
    /// In units of 2^-24.
    pub bias: i64,
}

impl<const I: usize> Network<I> {
    /// Log-odds in units of 2^-11 bits, within 12 bits of zero. Inputs are at most 64.
    pub fn log_odds(&self, inputs: &[i32; I]) -> i64 {
        let mut sum = self.bias;
        for unit in &self.units {
            let products = unit.inputs.iter().zip(inputs).map(|(w, x)| w * x);
            let value = unit.bias + products.sum::<i32>();
            sum += i64::from(unit.weight) * i64::from(value.max(0));
        }
        (sum >> SUM_BITS).clamp(-MAX_ODDS, MAX_ODDS)
    }
}

/// Number of binary digits; 0 of 0.
pub(super) fn length(number: u64) -> u8 {
    (u64::BITS - number.leading_zeros()) as u8
}

#[cfg(test)]
mod tests {
    use super::super::estimate_weights::{ANY, EXPONENT, NONZERO};
    use super::*;

    /// No unit overflows, whatever the inputs.
    #[test]
    fn sums_stay_within_bounds() {
        fn largest<const I: usize>(network: &Network<I>) -> i64 {
            let of_unit = |unit: &Unit<I>| {
                let inputs: i64 = unit.inputs.iter().map(|w| 64 * i64::from(w.abs())).sum();
                inputs + i64::from(unit.bias.abs())
            };
            let sums = network.units.iter().map(of_unit).max().unwrap();
            assert!(network.units.iter().all(|u| i64::from(u.weight.abs()) < 1 << 16));
            sums
        }
        for sum in [largest(&ANY), largest(&NONZERO), largest(&EXPONENT)] {
            assert!(sum < i64::from(i32::MAX), "{sum}");
        }
    }

    #[test]
    fn a_network_is_the_sum_of_its_units() {
        let zero = || Unit { inputs: [0; 2], bias: 0, weight: 0 };
        let mut units = std::array::from_fn(|_| zero());
        // 2 x - 1 and 3 - y, each where it is above zero; the first counts, the second counts minus a half.
        units[0] = Unit { inputs: [2 << 12, 0], bias: -(1 << 12), weight: 1 << 12 };
        units[1] = Unit { inputs: [0, -(1 << 12)], bias: 3 << 12, weight: -(1 << 11) };
        let network = Network { units, bias: 1 << 24 };
        let expected = |x: i32, y: i32| {
            let sum = 1.0 + f64::from((2 * x - 1).max(0)) - 0.5 * f64::from((3 - y).max(0));
            (2048.0 * sum.clamp(-12.0, 12.0)) as i64
        };
        for (x, y) in [(0, 0), (1, 0), (2, 5), (20, 1), (0, 3)] {
            assert_eq!(network.log_odds(&[x, y]), expected(x, y), "{x} {y}");
        }
    }

    #[test]
    fn lengths_are_numbers_of_digits() {
        assert_eq!([0, 1, 2, 3, 4, 7, 8].map(length), [0, 1, 2, 2, 3, 3, 4]);
    }
}
