//! A binary decision with several models at once: their log-odds are added up with weights that learn as well.
//!
//! The models look at different contexts. Where one has seen little, or in a context that predicts little, the other's probability counts
//! more. Weights follow the gradient of the price (M. Mahoney: *Adaptive Weighing of Context Models for Lossless Data
//! Compression*, 2005). All in integers, so that readers and writers agree on every platform.

use crate::coder::Coder;
use crate::models::{Bit, PRECISION};

/// Fractional bits of a weight.
const WEIGHT_BITS: u32 = 16;

/// Fractional bits of log-odds.
const LOG_ODDS_BITS: u32 = 11;

/// Entries of [`LOGARITHMS`] per unit of probability.
const SHARES: usize = 1 << 12;

/// `-log2(i / 2^12)` in units of 2^-11 bits, rounded.
static LOGARITHMS: [i32; SHARES + 1] = {
    // Digits beyond those kept: no value is as near to a half as the last of them.
    const GUARD_BITS: u32 = 16;
    let mut table = [0; SHARES + 1];
    let mut i = 1;
    while i <= SHARES {
        // Digits of log2 by repeated squaring of the mantissa in [1, 2), 63 fractional bits.
        let whole = (i as u64).ilog2();
        let mut mantissa = (i as u128) << (63 - whole);
        let mut log = whole as i64;
        let mut digit = 0;
        while digit < LOG_ODDS_BITS + GUARD_BITS {
            mantissa = (mantissa * mantissa) >> 63;
            log <<= 1;
            if mantissa >> 64 != 0 {
                mantissa >>= 1;
                log |= 1;
            }
            digit += 1;
        }
        let of = (12 << (LOG_ODDS_BITS + GUARD_BITS)) - log;
        table[i] = ((of + (1 << (GUARD_BITS - 1))) >> GUARD_BITS) as i32;
        i += 1;
    }
    // Never asked for: probabilities are at least 2^-12.
    table[0] = table[1];
    table
};

/// Logarithm to base 2 of a bit's probability of true over that of false, in units of 2^-11; within 12 of zero.
fn log_odds(bit: &Bit) -> i64 {
    // zero_width / 16, rounded: 1 to 2^12 - 1.
    let zero = (bit.zero_width() as usize + 8) >> 4;
    i64::from(LOGARITHMS[zero] - LOGARITHMS[SHARES - zero])
}

/// Largest log-odds in bits: those of the least probability of a [`Bit`].
const MAX_ODDS: i32 = 12;

/// Entries of [`PROBABILITIES`] per bit of log-odds.
const STEPS: i32 = 32;

/// Fractional bits of log-odds between two entries.
const BETWEEN: u32 = LOG_ODDS_BITS - STEPS.ilog2();

/// The error of a probability times log-odds, in their units, is divided by two to this power: about 0.01 of the gradient.
const RATE_SHIFT: u32 = 18;

/// `2^16 / (1 + 2^-x)`, rounded, for x from 0 to [`MAX_ODDS`] bits in steps of 1 / [`STEPS`].
static PROBABILITIES: [u32; (MAX_ODDS * STEPS) as usize + 1] = {
    // The 32nd root of 2 by five square roots, 56 fractional bits.
    const ONE: u128 = 1 << 56;
    let mut root = 2 * ONE;
    let mut i = 0;
    while i < STEPS.ilog2() {
        root = (root * ONE).isqrt();
        i += 1;
    }
    let mut table = [0; (MAX_ODDS * STEPS) as usize + 1];
    let mut power = ONE;
    let mut k = 0;
    while k < table.len() {
        if k % STEPS as usize == 0 {
            power = ONE << (k / STEPS as usize);
        }
        let whole = power + ONE;
        table[k] = (((power << PRECISION) + whole / 2) / whole) as u32;
        power = power * root / ONE;
        k += 1;
    }
    table
};

/// Probability, in units of 2^-16, of log-odds in units of 2^-11 bits: linear between the entries of [`PROBABILITIES`].
fn probability(odds: i64) -> u32 {
    let limit = i64::from(MAX_ODDS) << LOG_ODDS_BITS;
    let size = odds.abs().min(limit);
    let entry = (size >> BETWEEN) as usize;
    let part = (size & ((1 << BETWEEN) - 1)) as u32;
    let low = PROBABILITIES[entry];
    let high = PROBABILITIES[(entry + 1).min(PROBABILITIES.len() - 1)];
    let of_size = low + (((high - low) * part) >> BETWEEN);
    if odds < 0 { (1 << PRECISION) - of_size } else { of_size }
}

/// Weights of M models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mixer<const M: usize> {
    /// In units of 2^-16.
    weights: [i32; M],
    /// That of log-odds that are given beside those of the models.
    of_given: i32,
}

impl<const M: usize> Mixer<M> {
    /// Largest weight, in units of 2^-16: eight.
    const MAX_WEIGHT: i64 = 8 << WEIGHT_BITS;

    /// All models with this weight at first, in units of 2^-16. A sum of one is right for models that all know the
    /// same, a larger one for models that each know something else.
    pub const fn new(weight: i32) -> Self {
        Self { weights: [weight; M], of_given: 0 }
    }

    /// Probability of true, in units of 2^-16, of models with these log-odds, and of those that are given.
    fn one(&self, odds: [i64; M], given: i64) -> u32 {
        let sum: i64 = self.weights.iter().zip(odds).map(|(&w, odds)| i64::from(w) * odds).sum();
        probability((sum + i64::from(self.of_given) * given) >> WEIGHT_BITS)
    }

    /// A decision with the probability that all models give together; they and the weights adapt.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn bit<C: Coder>(
        &mut self,
        coder: &mut C,
        models: [&mut Bit; M],
        value: bool,
    ) -> Result<bool, C::Error> {
        self.bit_given(coder, models, 0, value)
    }

    /// The same with log-odds that are `given` beside the models, in units of 2^-11 bits and within 12 of zero.
    fn bit_given<C: Coder>(
        &mut self,
        coder: &mut C,
        models: [&mut Bit; M],
        given: i64,
        value: bool,
    ) -> Result<bool, C::Error> {
        let odds = models.each_ref().map(|model| log_odds(model));
        let one = self.one(odds, given);
        let value = coder.bit(&mut Bit::with_probability(one), value)?;
        let error = (i64::from(value) << PRECISION) - i64::from(one);
        let weights = self.weights.iter_mut().chain([&mut self.of_given]);
        for (weight, odds) in weights.zip(odds.into_iter().chain([given])) {
            let step = (error * odds + (1 << (RATE_SHIFT - 1))) >> RATE_SHIFT;
            let moved = i64::from(*weight) + step;
            *weight = moved.clamp(-Self::MAX_WEIGHT, Self::MAX_WEIGHT) as i32;
        }
        models.into_iter().for_each(|model| model.update(value));
        Ok(value)
    }

    /// Bits that coding `value` takes now.
    pub fn cost(&self, models: [&Bit; M], value: bool) -> f32 {
        self.cost_given(models, 0, value)
    }

    fn cost_given(&self, models: [&Bit; M], given: i64, value: bool) -> f32 {
        Bit::with_probability(self.one(models.map(log_odds), given)).cost(value)
    }
}

/// Decisions that M models make together, each by a context of its own.
#[derive(Debug, Clone)]
pub struct MixedBits<const M: usize> {
    /// By context.
    models: [Vec<Bit>; M],
    mixers: Vec<Mixer<M>>,
}

/// Contexts of a decision: that of the weights, and that of each model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MixedContext<const M: usize> {
    /// Number of the weights.
    pub mixer: usize,
    /// Context of each model.
    pub models: [usize; M],
}

impl<const M: usize> MixedBits<M> {
    /// Models with so many contexts each and this memory ([`Bit::with_memory`]), and so many sets of weights, which start
    /// at `weight` ([`Mixer::new`]).
    pub fn new(contexts: [usize; M], memory: u16, mixers: usize, weight: i32) -> Self {
        Self {
            models: contexts.map(|n| vec![Bit::with_memory(memory); n]),
            mixers: vec![Mixer::new(weight); mixers],
        }
    }

    /// With log-odds that are given beside the models ([`MixedBits::bit_given`]), whose weights start at `weight`.
    #[must_use]
    pub fn with_given(mut self, weight: i32) -> Self {
        self.mixers.iter_mut().for_each(|mixer| mixer.of_given = weight);
        self
    }

    /// A decision in these contexts, see [`Mixer::bit`].
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn bit<C: Coder>(
        &mut self,
        coder: &mut C,
        at: MixedContext<M>,
        value: bool,
    ) -> Result<bool, C::Error> {
        self.bit_given(coder, at, 0, value)
    }

    /// A decision in these contexts and with log-odds that are `given` beside the models, in units of 2^-11 bits and within
    /// 12 bits of zero; 0 counts for nothing.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn bit_given<C: Coder>(
        &mut self,
        coder: &mut C,
        at: MixedContext<M>,
        given: i64,
        value: bool,
    ) -> Result<bool, C::Error> {
        let mut contexts = at.models.into_iter();
        // As many contexts as models.
        let models = self.models.each_mut().map(|of| &mut of[contexts.next().unwrap_or_default()]);
        self.mixers[at.mixer].bit_given(coder, models, given, value)
    }

    /// Bits that coding `value` in these contexts takes now.
    pub fn cost(&self, at: MixedContext<M>, value: bool) -> f32 {
        self.cost_given(at, 0, value)
    }

    /// Bits that coding `value` with log-odds that are `given` takes now.
    pub fn cost_given(&self, at: MixedContext<M>, given: i64, value: bool) -> f32 {
        let models = std::array::from_fn(|m| &self.models[m][at.models[m]]);
        self.mixers[at.mixer].cost_given(models, given, value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Price;

    #[test]
    fn probabilities_are_those_of_log_odds() {
        for odds in -30_000_i64..30_000 {
            let bits = odds as f64 / f64::from(1 << LOG_ODDS_BITS);
            let exact = 65536.0 / (1.0 + (-bits.clamp(-12.0, 12.0)).exp2());
            assert!((f64::from(probability(odds)) - exact).abs() <= 2.0, "{bits}");
        }
        // As docs/format.md gives the tables: no entry is near a half, so that doubles are enough.
        for (i, &entry) in LOGARITHMS.iter().enumerate().skip(1) {
            let exact = 2048.0 * (12.0 - (i as f64).log2());
            assert_eq!(f64::from(entry), exact.round(), "{i}");
            assert!((exact - exact.floor() - 0.5).abs() > 1e-6, "{i}");
        }
        for (k, &entry) in PROBABILITIES.iter().enumerate() {
            let exact = 65536.0 / (1.0 + (-(k as f64) / 32.0).exp2());
            assert_eq!(f64::from(entry), exact.round());
            assert!((exact - exact.floor() - 0.5).abs() > 1e-6, "{k}");
        }
    }

    #[test]
    fn the_model_that_knows_counts_and_the_one_that_does_not_costs_little() {
        // The bit of the first model is certain to 15 / 16, that of the second is a coin.
        let mut mixer = Mixer::new(1 << 15);
        let (mut known, mut coin) = ([Bit::new(); 2], Bit::new());
        let mut price = Price::default();
        let (n, mut state) = (20_000, 1_u32);
        for _ in 0..n {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let context = (state >> 31) as usize;
            let value = (state >> 16 & 15 == 0) != (context != 0);
            let Ok(_) = mixer.bit(&mut price, [&mut known[context], &mut coin], value);
        }
        let entropy = |p: f64| -p * p.log2() - (1.0 - p) * (1.0 - p).log2();
        let least = f64::from(n) * entropy(1.0 / 16.0);
        assert!(price.bits < 1.03 * least, "{} {least}", price.bits);
        assert!(price.bits > 0.97 * least, "{} {least}", price.bits);
    }

    /// Three models of which each knows one of three causes: their log-odds add up.
    #[test]
    fn a_cost_is_what_a_decision_takes() {
        let mut mixed = MixedBits::new([2, 2, 2], Bit::DEFAULT_MEMORY, 1, 1 << 15);
        let (mut price, mut costs, mut least, mut state) = (Price::default(), 0.0, 0.0, 1_u32);
        let n = 20_000;
        for _ in 0..n {
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state) / f64::from(u32::MAX)
            };
            let causes = [(); 3].map(|()| usize::from(next() < 0.5));
            let odds: f64 = causes.iter().map(|&c| [-1.5, 1.5][c]).sum();
            let p = 1.0 / (1.0 + (-odds).exp2());
            let value = next() < p;
            least -= p * p.log2() + (1.0 - p) * (1.0 - p).log2();
            let at = MixedContext { mixer: 0, models: causes };
            costs += f64::from(mixed.cost(at, value));
            let Ok(_) = mixed.bit(&mut price, at, value);
        }
        assert!((price.bits - costs).abs() < 1e-3 * costs, "{} {costs}", price.bits);
        // The sampling error of the entropy is about 0.7 percent of it.
        assert!(price.bits < 1.03 * least && price.bits > 0.97 * least, "{} {least}", price.bits);
    }

    /// Given log-odds that are right take over from a model that knows nothing, and those of no weight count for nothing.
    #[test]
    fn given_log_odds_count_as_one_more_model() {
        let new = || MixedBits::new([1], Bit::DEFAULT_MEMORY, 1, 1 << 15);
        let (mut with, mut without) = (new().with_given(1 << 15), new());
        let (mut given, mut alone, mut least, mut state) =
            (Price::default(), Price::default(), 0.0, 1_u32);
        let at = MixedContext { mixer: 0, models: [0] };
        for _ in 0..20_000 {
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state) / f64::from(u32::MAX)
            };
            let odds = 6.0 * next() - 3.0;
            let p = 1.0 / (1.0 + (-odds).exp2());
            let value = next() < p;
            least -= p * p.log2() + (1.0 - p) * (1.0 - p).log2();
            let Ok(_) = with.bit_given(&mut given, at, (2048.0 * odds) as i64, value);
            let Ok(_) = without.bit_given(&mut alone, at, 0, value);
        }
        assert!(given.bits < 1.03 * least && given.bits > 0.97 * least, "{} {least}", given.bits);
        assert!(alone.bits > 19_900.0, "{}", alone.bits);
    }

    #[test]
    fn what_one_codes_alone_two_alike_code_as_well() {
        let mut mixer = Mixer::new(1 << 15);
        let (mut first, mut second, mut alone) = (Bit::new(), Bit::new(), Bit::new());
        let (mut mixed, mut single) = (Price::default(), Price::default());
        for i in 0..4000_u32 {
            let value = i.wrapping_mul(2_654_435_761) >> 29 == 0;
            let Ok(_) = mixer.bit(&mut mixed, [&mut first, &mut second], value);
            let Ok(_) = single.bit(&mut alone, value);
        }
        assert!(mixed.bits < 1.02 * single.bits, "{} {}", mixed.bits, single.bits);
    }
}
