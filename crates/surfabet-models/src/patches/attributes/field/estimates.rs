//! Estimates of the decisions of a field: the log-odds that small networks give of what is around.
//!
//! Models of contexts learn from each file afresh, and each looks at two or three things. A network looks at all of them at once and
//! was trained before. Its estimate counts beside the models as one more of them, with a weight that learns as well, so that
//! they make up for what is not as in the scenes that it was trained on. Whole numbers, so that readers and writers agree.

/// Units of a network.
const HIDDEN: usize = 12;

/// Fractional bits of a sum beyond those of log-odds.
const SUM_BITS: u32 = 13;

/// Largest log-odds, in units of 2^-11: twelve bits.
const MAX_ODDS: i64 = 12 << 11;

/// A sum of each unit.
pub(super) type Sums = [i32; HIDDEN];

/// A unit: a sum of the inputs, counted where it is above zero. Two parts of the inputs, so that what is the same for all coefficients
/// of a cell is summed up once.
pub(super) struct Unit<const A: usize, const B: usize> {
    /// In units of 2^-12, as the bias and the weight.
    pub first: [i16; A],
    pub second: [i16; B],
    pub bias: i32,
    pub weight: i32,
}

/// A network of one layer.
pub(super) struct Network<const A: usize, const B: usize> {
    pub units: [Unit<A, B>; HIDDEN],
    /// In units of 2^-24.
    pub bias: i64,
}

fn dot<const I: usize>(weights: &[i16; I], inputs: &[i16; I]) -> i32 {
    weights.iter().zip(inputs).map(|(&w, &x)| i32::from(w) * i32::from(x)).sum()
}

fn log_odds(sum: i64) -> i64 {
    (sum >> SUM_BITS).clamp(-MAX_ODDS, MAX_ODDS)
}

impl<const A: usize, const B: usize> Network<A, B> {
    /// The part of each unit's sum that is of the first inputs, with its bias.
    pub fn begin(&self, first: &[i16; A]) -> Sums {
        self.units.each_ref().map(|unit| unit.bias + dot(&unit.first, first))
    }

    /// Log-odds in units of 2^-11 bits, within 12 bits of zero. Inputs are at most 64.
    pub fn log_odds(&self, begun: &Sums, second: &[i16; B]) -> i64 {
        let mut sum = self.bias;
        for (unit, begun) in self.units.iter().zip(begun) {
            let value = begun + dot(&unit.second, second);
            sum += i64::from(unit.weight) * i64::from(value.max(0));
        }
        log_odds(sum)
    }

    /// Log-odds that turn their sign with all of the second inputs: each unit counts as it is less what it is for these turned.
    pub fn odd_log_odds(&self, first: &[i16; A], second: &[i16; B]) -> i64 {
        let mut sum = 0;
        for unit in &self.units {
            let (even, odd) = (unit.bias + dot(&unit.first, first), dot(&unit.second, second));
            let difference = (even + odd).max(0) - (even - odd).max(0);
            sum += i64::from(unit.weight) * i64::from(difference);
        }
        // Rounded towards zero, so that it is odd.
        log_odds(sum.abs()) * sum.signum()
    }
}

/// Number of binary digits; 0 of 0.
pub(super) fn length(number: u64) -> u8 {
    (u64::BITS - number.leading_zeros()) as u8
}

#[cfg(test)]
mod tests {
    use super::super::estimate_weights::{ANY, EXPONENT, NEGATIVE, NONZERO};
    use super::*;

    /// No unit overflows, whatever the inputs.
    #[test]
    fn sums_stay_within_bounds() {
        fn largest<const A: usize, const B: usize>(network: &Network<A, B>) -> i64 {
            let of_unit = |unit: &Unit<A, B>| {
                let inputs = unit.first.iter().chain(&unit.second);
                inputs.map(|&w| 64 * i64::from(w).abs()).sum::<i64>() + i64::from(unit.bias).abs()
            };
            let sums = network.units.iter().map(of_unit).max().unwrap();
            assert!(network.units.iter().all(|u| i64::from(u.weight).abs() < 1 << 16));
            sums
        }
        let all = [largest(&ANY), largest(&NONZERO), largest(&EXPONENT), largest(&NEGATIVE)];
        for sum in all {
            assert!(2 * sum < i64::from(i32::MAX), "{sum}");
        }
    }

    /// 2 x - 1 and 3 - y, each where it is above zero; the first counts, the second counts minus a half.
    fn two_units(bias: i64) -> Network<1, 1> {
        let mut units =
            std::array::from_fn(|_| Unit { first: [0], second: [0], bias: 0, weight: 0 });
        units[0] = Unit { first: [2 << 12], second: [0], bias: -(1 << 12), weight: 1 << 12 };
        units[1] = Unit { first: [0], second: [-(1 << 12)], bias: 3 << 12, weight: -(1 << 11) };
        Network { units, bias }
    }

    #[test]
    fn a_network_is_the_sum_of_its_units() {
        let network = two_units(1 << 24);
        let expected = |x: i16, y: i16| {
            let sum = 1.0 + f64::from((2 * x - 1).max(0)) - 0.5 * f64::from((3 - y).max(0));
            (2048.0 * sum.clamp(-12.0, 12.0)) as i64
        };
        for (x, y) in [(0, 0), (1, 0), (2, 5), (20, 1), (0, 3)] {
            assert_eq!(network.log_odds(&network.begin(&[x]), &[y]), expected(x, y), "{x} {y}");
        }
    }

    #[test]
    fn odd_estimates_turn_with_their_inputs() {
        let network = two_units(0);
        for y in -40_i16..40 {
            let odds = network.odd_log_odds(&[1], &[y]);
            assert_eq!(odds, -network.odd_log_odds(&[1], &[-y]));
            let half = |y: i16| 0.5 * f64::from((3 - y).max(0));
            let expected = (half(-y) - half(y)).clamp(-12.0, 12.0);
            assert_eq!(odds, (2048.0 * expected) as i64, "{y}");
        }
    }

    #[test]
    fn lengths_are_numbers_of_digits() {
        assert_eq!([0, 1, 2, 3, 4, 7, 8].map(length), [0, 1, 2, 2, 3, 3, 4]);
    }
}
