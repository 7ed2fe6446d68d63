//! Adaptive models of bits and integers for the entropy coder, in integer arithmetic.
//!
//! Every integer is coded as a few binary decisions, each with a [`Bit`] that learns as it goes. Contexts are
//! the caller's: an array of models, indexed by what is known already. A stream of a few hundred symbols is
//! the usual case, so a bit starts as the Krichevsky-Trofimov estimator, the best start when nothing is known,
//! and only later becomes an exponential average.

use crate::entropy::{Decoder, Encoder, PRECISION};
use crate::error::{Error, Result};

/// Least probability of either value, in units of 2^-16.
const MIN_WIDTH: u32 = 16;

/// Fractional bits of the table of learning rates.
const RATE_BITS: u32 = 24;

/// Learning rate after `n` updates, `1 / (n + 2)`.
const RATES: [u32; Bit::MAX_MEMORY as usize + 1] = {
    let mut rates = [0; Bit::MAX_MEMORY as usize + 1];
    let mut n = 0;
    while n < rates.len() {
        rates[n] = (1 << RATE_BITS) / (n as u32 + 2);
        n += 1;
    }
    rates
};

/// Fractional bits of [`COSTS`].
const COST_BITS: u32 = 11;

/// Digits of the logarithm computed beyond those kept, so that rounding is right.
const GUARD_BITS: u32 = 6;

/// Entries of [`COSTS`] per unit of probability.
const COST_STEPS: usize = 1 << 12;

/// `-log2(i / 2^12)` in units of 2^-11 bits. From integers, so that encoders decide alike on every platform.
static COSTS: [u16; COST_STEPS + 1] = {
    let mut costs = [0; COST_STEPS + 1];
    let mut i = 1;
    while i <= COST_STEPS {
        // Digits of log2 by repeated squaring of the mantissa in [1, 2), 31 fractional bits.
        let whole = (i as u32).ilog2();
        let mut mantissa = (i as u64) << (31 - whole);
        let mut log = whole;
        let mut digit = 0;
        while digit < COST_BITS + GUARD_BITS {
            mantissa = (mantissa * mantissa) >> 31;
            log <<= 1;
            if mantissa >> 32 != 0 {
                mantissa >>= 1;
                log |= 1;
            }
            digit += 1;
        }
        let cost = (12 << (COST_BITS + GUARD_BITS)) - log;
        costs[i] = ((cost + (1 << (GUARD_BITS - 1))) >> GUARD_BITS) as u16;
        i += 1;
    }
    // Never asked for: probabilities are at least 2^-12.
    costs[0] = costs[1];
    costs
};

/// An adaptive bit.
///
/// After `n` updates of which `k` were true, the probability of true is `(k + 1/2) / (n + 1)` (Krichevsky and
/// Trofimov 1981) as long as `n` is at most the bit's memory, so that `n` bits cost at most `log2(n) / 2 + 1`
/// bits more than with the best fixed probability; afterwards old values fade with a time constant of `memory`.
/// Neither value gets a probability below 2^-12.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bit {
    /// Probability of true, in units of 2^-32.
    one: u32,
    /// Number of updates, up to `memory`.
    updates: u16,
    memory: u16,
}

impl Default for Bit {
    fn default() -> Self {
        Self::new()
    }
}

impl Bit {
    /// Memory of [`Bit::new`]: 0.14 percent of a bit per bit dearer than the truth for stationary bits, and
    /// still able to follow changes within a few thousand.
    pub const DEFAULT_MEMORY: u16 = 255;

    /// Longest memory.
    pub const MAX_MEMORY: u16 = 1023;

    /// Most binary decisions that one bit of a stream can hold: `ln 2 * 2^12`, from the least cost of one.
    pub(crate) const MAX_PER_BIT: u64 = 2840;

    /// A bit of which nothing is known.
    pub const fn new() -> Self {
        Self::with_memory(Self::DEFAULT_MEMORY)
    }

    /// A bit that averages over the last `memory` values, 1 to 1023; other values are taken to the nearest.
    pub const fn with_memory(memory: u16) -> Self {
        let memory = if memory == 0 {
            1
        } else if memory > Self::MAX_MEMORY {
            Self::MAX_MEMORY
        } else {
            memory
        };
        Self { one: 1 << 31, updates: 0, memory }
    }

    /// This bit with a prior: true has probability `one / 2^16`, as if seen `updates` times already.
    #[must_use]
    pub const fn with_prior(self, one: u16, updates: u16) -> Self {
        let updates = if updates > self.memory { self.memory } else { updates };
        Self { one: (one as u32) << 16, updates, ..self }
    }

    /// Share of false in `[0, 2^16)`; at least 16 and at most 2^16 - 16.
    #[inline]
    pub(crate) fn zero_width(self) -> u32 {
        let one = self.one >> (u32::BITS - PRECISION as u32);
        (1 << PRECISION) - one.clamp(MIN_WIDTH, (1 << PRECISION) - MIN_WIDTH)
    }

    #[inline]
    pub(crate) fn update(&mut self, value: bool) {
        // updates <= memory <= MAX_MEMORY, the last index of RATES. A rate is at most 1/2, so the sum stays
        // between the old probability and the target, both of 32 bits.
        let rate = i64::from(RATES[usize::from(self.updates)]);
        let target = if value { i64::from(u32::MAX) } else { 0 };
        let step = ((target - i64::from(self.one)) * rate) >> RATE_BITS;
        self.one = (i64::from(self.one) + step) as u32;
        self.updates += u16::from(self.updates < self.memory);
    }

    /// Bits that coding `value` takes now, to within 2^-12 for probabilities above 1 percent.
    #[inline]
    pub fn cost(&self, value: bool) -> f32 {
        let zero = self.zero_width();
        let width = if value { (1 << PRECISION) - zero } else { zero };
        // width / 16, rounded: at most 2^12.
        let index = (width as usize + 8) >> 4;
        f32::from(COSTS[index]) / (1 << COST_BITS) as f32
    }
}

/// An adaptive unsigned integer over all of `u32`, best for small values and wide tails.
///
/// Elias gamma (1975) with adaptive bits: `value + 1 = 2^e + m`; the exponent `e` in unary, a bit per step, then
/// the two leading bits of `m` with bits of their own per exponent, then the rest of `m` at a bit per bit. So 0 to
/// 6 are told apart by what was learned, and beyond them quarters of octaves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UInt {
    /// `exponent[e]`: is the exponent above `e`?
    exponent: [Bit; Self::MAX_EXPONENT as usize],
    /// `mantissa[e]`: first bit, second bit after 0, second bit after 1.
    mantissa: [[Bit; 3]; Self::MAX_EXPONENT as usize],
}

impl Default for UInt {
    fn default() -> Self {
        Self::new()
    }
}

impl UInt {
    /// Only `u32::MAX` has this exponent, so that it needs no mantissa.
    const MAX_EXPONENT: u32 = 32;

    /// An integer of which nothing is known.
    pub const fn new() -> Self {
        Self::with_memory(Bit::DEFAULT_MEMORY)
    }

    /// An integer whose bits have the given memory, see [`Bit::with_memory`].
    pub const fn with_memory(memory: u16) -> Self {
        let bit = Bit::with_memory(memory);
        Self {
            exponent: [bit; Self::MAX_EXPONENT as usize],
            mantissa: [[bit; 3]; Self::MAX_EXPONENT as usize],
        }
    }

    /// Exponent of `value`, and its mantissa.
    #[inline]
    fn split(value: u32) -> (u32, u32) {
        let shifted = u64::from(value) + 1;
        let exponent = shifted.ilog2();
        (exponent, (shifted - (1 << exponent)) as u32)
    }

    pub(crate) fn encode(&mut self, encoder: &mut Encoder, value: u32) {
        let (exponent, mantissa) = Self::split(value);
        for (e, bit) in (0..).zip(&mut self.exponent) {
            encoder.bit(bit, e < exponent);
            if e == exponent {
                break;
            }
        }
        let Some([first, after_0, after_1]) = self.mantissa.get_mut(exponent as usize) else {
            return;
        };
        if exponent >= 1 {
            let high = mantissa >> (exponent - 1) & 1 != 0;
            encoder.bit(first, high);
            if exponent >= 2 {
                let second = if high { after_1 } else { after_0 };
                encoder.bit(second, mantissa >> (exponent - 2) & 1 != 0);
                encoder.bypass(u64::from(mantissa), exponent - 2);
            }
        }
    }

    pub(crate) fn decode(&mut self, decoder: &mut Decoder<'_>) -> Result<u32> {
        let mut exponent = 0;
        for bit in &mut self.exponent {
            if !decoder.bit(bit)? {
                break;
            }
            exponent += 1;
        }
        let Some([first, after_0, after_1]) = self.mantissa.get_mut(exponent as usize) else {
            return Ok(u32::MAX);
        };
        let mut shifted = 1_u32;
        if exponent >= 1 {
            let high = decoder.bit(first)?;
            shifted = shifted << 1 | u32::from(high);
            if exponent >= 2 {
                let second = decoder.bit(if high { after_1 } else { after_0 })?;
                shifted = shifted << 1 | u32::from(second);
                shifted = shifted << (exponent - 2) | decoder.bypass(exponent - 2)? as u32;
            }
        }
        // 2^e + m with e <= 31, hence from 1 to u32::MAX.
        Ok(shifted - 1)
    }

    /// Bits that coding `value` takes now.
    pub fn cost(&self, value: u32) -> f32 {
        let (exponent, mantissa) = Self::split(value);
        let mut cost = 0.0;
        for (e, bit) in (0..).zip(&self.exponent) {
            cost += bit.cost(e < exponent);
            if e == exponent {
                break;
            }
        }
        let Some([first, after_0, after_1]) = self.mantissa.get(exponent as usize) else {
            return cost;
        };
        if exponent >= 1 {
            let high = mantissa >> (exponent - 1) & 1 != 0;
            cost += first.cost(high);
            if exponent >= 2 {
                let second = if high { after_1 } else { after_0 };
                cost += second.cost(mantissa >> (exponent - 2) & 1 != 0) + (exponent - 2) as f32;
            }
        }
        cost
    }
}

/// An adaptive signed integer over all of `i32`, best for values around zero.
///
/// Is it zero, then its sign, then its magnitude less one as [`UInt`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SInt {
    nonzero: Bit,
    negative: Option<Bit>,
    magnitude: UInt,
}

impl Default for SInt {
    fn default() -> Self {
        Self::new()
    }
}

impl SInt {
    /// An integer of which nothing is known; one sign may be more frequent.
    pub const fn new() -> Self {
        Self::with_memory(Bit::DEFAULT_MEMORY)
    }

    /// An integer whose bits have the given memory, see [`Bit::with_memory`].
    pub const fn with_memory(memory: u16) -> Self {
        let bit = Bit::with_memory(memory);
        Self { nonzero: bit, negative: Some(bit), magnitude: UInt::with_memory(memory) }
    }

    /// This integer with both signs equally frequent: a sign takes one bit and nothing is learned of it.
    #[must_use]
    pub const fn symmetric(self) -> Self {
        Self { negative: None, ..self }
    }

    pub(crate) fn encode(&mut self, encoder: &mut Encoder, value: i32) {
        encoder.bit(&mut self.nonzero, value != 0);
        if value != 0 {
            match &mut self.negative {
                Some(bit) => encoder.bit(bit, value < 0),
                None => encoder.bypass(u64::from(value < 0), 1),
            }
            self.magnitude.encode(encoder, value.unsigned_abs() - 1);
        }
    }

    pub(crate) fn decode(&mut self, decoder: &mut Decoder<'_>) -> Result<i32> {
        if !decoder.bit(&mut self.nonzero)? {
            return Ok(0);
        }
        let negative = match &mut self.negative {
            Some(bit) => decoder.bit(bit)?,
            None => decoder.bypass(1)? != 0,
        };
        let magnitude = i64::from(self.magnitude.decode(decoder)?) + 1;
        let value = if negative { -magnitude } else { magnitude };
        i32::try_from(value)
            .map_err(|_| decoder.corrupt(format!("integer {value} does not fit 32 bits")))
    }

    /// Bits that coding `value` takes now.
    pub fn cost(&self, value: i32) -> f32 {
        let mut cost = self.nonzero.cost(value != 0);
        if value != 0 {
            cost += self.negative.map_or(1.0, |bit| bit.cost(value < 0));
            cost += self.magnitude.cost(value.unsigned_abs() - 1);
        }
        cost
    }
}

/// An adaptive symbol of an alphabet of known size: `0..size`.
///
/// A binary tree of bits over the symbols, split by the bits of the symbol's number, the highest first. A bit
/// that the size decides is not coded, so that no symbol beyond the alphabet can be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Symbols {
    size: u32,
    /// Bits of the largest symbol.
    depth: u32,
    /// Node 1 is the root, node `i` has the children `2 i` and `2 i + 1`; node 0 is not used.
    nodes: Vec<Bit>,
}

impl Symbols {
    /// Largest alphabet.
    pub const MAX_SIZE: u32 = 1 << 16;

    /// Symbols of which nothing is known.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `size` is 1 to 2^16.
    pub fn new(size: u32) -> Result<Self> {
        Self::with_memory(size, Bit::DEFAULT_MEMORY)
    }

    /// Symbols whose bits have the given memory, see [`Bit::with_memory`].
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] unless `size` is 1 to 2^16.
    pub fn with_memory(size: u32, memory: u16) -> Result<Self> {
        if !(1..=Self::MAX_SIZE).contains(&size) {
            return Err(Error::invalid("size of an alphabet", size, "1 to 65536"));
        }
        let depth = u32::BITS - (size - 1).leading_zeros();
        Ok(Self { size, depth, nodes: vec![Bit::with_memory(memory); 1 << depth] })
    }

    /// Number of symbols.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// The symbol's bits from the highest, as level, node, and bit; bits that the size decides are left out.
    fn path(&self, value: u32) -> impl Iterator<Item = (usize, bool)> + use<> {
        assert!(value < self.size, "symbol {value} of an alphabet of {}", self.size);
        let size = self.size;
        let root = 1_usize << self.depth;
        (0..self.depth).rev().filter_map(move |level| {
            let bit = value >> level & 1 != 0;
            let least_with_one = (value >> level | 1) << level;
            let node = (root | value as usize) >> (level + 1);
            (least_with_one < size).then_some((node, bit))
        })
    }

    pub(crate) fn encode(&mut self, encoder: &mut Encoder, value: u32) {
        for (node, bit) in self.path(value) {
            encoder.bit(&mut self.nodes[node], bit);
        }
    }

    pub(crate) fn decode(&mut self, decoder: &mut Decoder<'_>) -> Result<u32> {
        let mut value = 0_u32;
        for level in (0..self.depth).rev() {
            let with_one = value << 1 | 1;
            // 2^depth nodes; the prefix of fewer than `depth` bits behind a leading one is below that.
            let node = (1 << (self.depth - 1 - level)) | value as usize;
            let one = (with_one << level) < self.size && decoder.bit(&mut self.nodes[node])?;
            value = value << 1 | u32::from(one);
        }
        Ok(value)
    }

    /// Bits that coding `value` takes now.
    ///
    /// # Panics
    /// When `value` is not below the size of the alphabet.
    pub fn cost(&self, value: u32) -> f32 {
        self.path(value).map(|(node, bit)| self.nodes[node].cost(bit)).sum()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::{RngAlgorithm, TestRng};

    use super::*;
    use crate::container::Tag;

    const TEST: Tag = Tag::new(b"TEST");

    /// The stream of `values`, checked to decode to them, and the sum of their costs in bits.
    fn coded<T: Copy + PartialEq + std::fmt::Debug, M: Clone>(
        values: &[T],
        model: &M,
        cost: impl Fn(&M, T) -> f32,
        encode: impl Fn(&mut Encoder, &mut M, T),
        decode: impl Fn(&mut Decoder<'_>, &mut M) -> Result<T>,
    ) -> (Vec<u8>, f64) {
        let (mut encoder, mut encoding) = (Encoder::new(), model.clone());
        let mut bits = 0.0;
        for value in values {
            bits += f64::from(cost(&encoding, *value));
            encode(&mut encoder, &mut encoding, *value);
        }
        let bound = encoder.len_bound();
        let bytes = encoder.finish();
        assert!(bytes.len() <= bound);
        let (mut decoder, mut decoding) = (Decoder::new(TEST, &bytes), model.clone());
        decoder.check_count("values", values.len() as u64).unwrap();
        for value in values {
            assert_eq!(decode(&mut decoder, &mut decoding), Ok(*value));
        }
        decoder.finish().unwrap();
        (bytes, bits)
    }

    fn coded_bits(values: &[bool], model: &Bit) -> (Vec<u8>, f64) {
        coded(values, model, Bit::cost, Encoder::bit, |d, m| d.bit(m))
    }

    fn coded_uints(values: &[u32], model: &UInt) -> (Vec<u8>, f64) {
        coded(values, model, UInt::cost, Encoder::uint, |d, m| d.uint(m))
    }

    fn coded_sints(values: &[i32], model: &SInt) -> (Vec<u8>, f64) {
        coded(values, model, SInt::cost, Encoder::sint, |d, m| d.sint(m))
    }

    fn coded_symbols(values: &[u32], model: &Symbols) -> (Vec<u8>, f64) {
        coded(values, model, Symbols::cost, Encoder::symbol, |d, m| d.symbol(m))
    }

    /// Numbers uniform in [0, 1).
    fn uniforms(count: usize) -> impl Iterator<Item = f64> {
        let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
        (0..count).map(move |_| f64::from(random.next_u32()) / 2.0_f64.powi(32))
    }

    /// Bits that the values take with the best fixed code for their frequencies.
    fn empirical_bits<T: Ord + Copy>(values: &[T]) -> f64 {
        let mut sorted = values.to_vec();
        sorted.sort_unstable();
        let total = values.len() as f64;
        let run_bits = |run: &[T]| run.len() as f64 * (total / run.len() as f64).log2();
        sorted.chunk_by(|a, b| a == b).map(run_bits).sum()
    }

    /// Small and extreme integers alike.
    fn any_size_u32() -> impl Strategy<Value = u32> {
        prop_oneof![
            0_u32..20,
            any::<u32>(),
            (0_u32..32, any::<u32>()).prop_map(|(shift, value)| value >> shift),
            (0_u32..=32, -2_i64..2)
                .prop_map(|(e, near)| ((1_i64 << e) + near).clamp(0, u32::MAX.into()) as u32),
        ]
    }

    proptest! {
        #[test]
        fn bits_round_trip(values: Vec<bool>, memory: u16, one in 0..=u16::MAX, updates: u16) {
            coded_bits(&values, &Bit::with_memory(memory).with_prior(one, updates));
        }

        #[test]
        fn uints_round_trip(values in prop::collection::vec(any_size_u32(), 0..300)) {
            coded_uints(&values, &UInt::new());
        }

        #[test]
        fn sints_round_trip(values in prop::collection::vec(any_size_u32(), 0..300), symmetric: bool) {
            let values: Vec<i32> = values.into_iter().map(u32::cast_signed).collect();
            let model = if symmetric { SInt::new().symmetric() } else { SInt::new() };
            coded_sints(&values, &model);
        }

        #[test]
        fn symbols_round_trip(
            (size, values) in (1_u32..=Symbols::MAX_SIZE)
                .prop_flat_map(|size| (Just(size), prop::collection::vec(0..size, 0..300))),
        ) {
            coded_symbols(&values, &Symbols::new(size)?);
        }

        #[test]
        fn garbage_never_leaves_the_alphabet(bytes: Vec<u8>, size in 1_u32..300) {
            let (mut decoder, mut model) = (Decoder::new(TEST, &bytes), Symbols::new(size)?);
            for _ in 0..1000 {
                match decoder.symbol(&mut model) {
                    Ok(symbol) => prop_assert!(symbol < size),
                    Err(_) => break,
                }
            }
        }
    }

    #[test]
    fn all_extremes_round_trip() {
        let uints = [0, 1, 2, 6, 7, u32::MAX - 2, u32::MAX - 1, u32::MAX, 1 << 31, (1 << 31) - 1];
        coded_uints(&uints, &UInt::new());
        let sints = [0, 1, -1, i32::MIN, i32::MAX, i32::MIN + 1];
        coded_sints(&sints, &SInt::new());
        coded_sints(&sints, &SInt::new().symmetric());
        coded_symbols(&[0; 40], &Symbols::new(1).unwrap());
        coded_symbols(&[0, 65535, 1], &Symbols::new(1 << 16).unwrap());
        assert!(Symbols::new(0).is_err());
        assert!(Symbols::new((1 << 16) + 1).is_err());
    }

    #[test]
    fn an_alphabet_of_one_takes_no_bytes() {
        assert!(coded_symbols(&[0; 100], &Symbols::new(1).unwrap()).0.is_empty());
    }

    #[test]
    fn short_streams_cost_what_krichevsky_and_trofimov_say() {
        // -log2 of their estimate is below that of the best fixed probability plus log2(n) / 2 + 1, whatever
        // the values; the coder adds at most a byte and what probabilities of 16 bits lose.
        let mut uniforms = uniforms(1 << 20);
        for n in [1_usize, 2, 3, 5, 10, 30, 100, 255] {
            for ones in [0, 1, n / 10, n / 3, n / 2, n - 1, n] {
                let mut values: Vec<bool> = (0..n).map(|i| i < ones).collect();
                for i in (1..n).rev() {
                    let j = (uniforms.next().unwrap() * (i + 1) as f64) as usize;
                    values.swap(i, j);
                }
                let bound = empirical_bits(&values) + 0.5 * (n as f64).log2() + 1.0;
                let (bytes, bits) = coded_bits(&values, &Bit::new());
                let stream = 8.0 * bytes.len() as f64;
                assert!(stream <= bound + 8.1, "{n} {ones}: {stream} > {bound}");
                // The sum of costs to the precision of their table.
                assert!(bits <= bound + 0.002 * n as f64 + 0.1, "{n} {ones}: {bits} > {bound}");
            }
        }
    }

    #[test]
    fn the_fast_start_beats_a_fixed_rate() {
        // 100 equal bits: log2 of 1 / P = log2(pi) / 2 + log2(100) / 2 + small = 4.15 bits. An average with
        // the fixed rate of the steady state, as without the start, takes 70.
        let fixed = Bit::new().with_prior(1 << 15, Bit::DEFAULT_MEMORY);
        let (fast, fast_bits) = coded_bits(&[true; 100], &Bit::new());
        let (slow, slow_bits) = coded_bits(&[true; 100], &fixed);
        assert!((fast_bits - 4.15).abs() < 0.2, "{fast_bits}");
        assert!(slow_bits > 65.0, "{slow_bits}");
        assert!(fast.len() <= 2 && slow.len() >= 8);
    }

    #[test]
    fn a_prior_is_used_from_the_first_bit() {
        let bit = Bit::new().with_prior(6554, 50);
        assert!((bit.cost(true) - 10.0_f32.log2()).abs() < 0.01);
    }

    #[test]
    fn long_stationary_bits_are_within_two_percent_of_their_entropy() {
        for (probability, memory) in
            [(0.5, 255), (0.2, 255), (0.05, 255), (0.02, 255), (0.01, 1023)]
        {
            let values: Vec<bool> = uniforms(200_000).map(|u| u < probability).collect();
            let (bytes, bits) = coded_bits(&values, &Bit::with_memory(memory));
            let ideal = empirical_bits(&values);
            let stream = 8.0 * bytes.len() as f64;
            assert!(stream <= 1.02 * ideal + 32.0, "{probability}: {stream} {ideal}");
            assert!(
                (bits - stream).abs() <= 0.005 * stream + 32.0,
                "{probability}: {bits} {stream}"
            );
        }
    }

    #[test]
    fn long_stationary_integers_are_within_two_percent_of_their_entropy() {
        for mean in [0.1, 0.5, 2.0, 10.0, 50.0] {
            // Geometric with this mean.
            let ratio: f64 = mean / (1.0 + mean);
            let values: Vec<u32> =
                uniforms(200_000).map(|u| ((1.0 - u).ln() / ratio.ln()) as u32).collect();
            let entropy = ((1.0 + mean) * (1.0 + mean).log2() - mean * mean.log2()) * 200_000.0;
            let (bytes, bits) = coded_uints(&values, &UInt::new());
            let stream = 8.0 * bytes.len() as f64;
            assert!(stream <= 1.02 * entropy + 400.0, "{mean}: {}", stream / entropy);
            assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{mean}: {bits} {stream}");

            let signed: Vec<i32> = values
                .iter()
                .zip(uniforms(400_000).skip(200_000))
                .map(|(v, u)| if u < 0.5 { *v as i32 } else { -(*v as i32) })
                .collect();
            let nonzero = values.iter().filter(|v| **v != 0).count() as f64;
            for model in [SInt::new(), SInt::new().symmetric()] {
                let (bytes, bits) = coded_sints(&signed, &model);
                let stream = 8.0 * bytes.len() as f64;
                assert!(stream <= 1.02 * (entropy + nonzero) + 400.0, "{mean}: {stream}");
                assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{mean}: {bits} {stream}");
            }
        }
    }

    #[test]
    fn long_stationary_symbols_are_within_two_percent_of_their_entropy() {
        for size in [2_u32, 5, 16, 37] {
            // The square skews the frequencies to small symbols.
            let values: Vec<u32> =
                uniforms(200_000).map(|u| (u * u * f64::from(size)) as u32).collect();
            let (bytes, bits) = coded_symbols(&values, &Symbols::new(size).unwrap());
            let stream = 8.0 * bytes.len() as f64;
            let ideal = empirical_bits(&values);
            // A few bits to learn each of the size - 1 nodes.
            assert!(stream <= 1.02 * ideal + 10.0 * f64::from(size), "{size}: {stream} {ideal}");
            assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{size}: {bits} {stream}");
        }
    }

    #[test]
    fn change_is_followed() {
        let values: Vec<bool> = (0..20_000).map(|i| i >= 10_000).collect();
        let (bytes, _) = coded_bits(&values, &Bit::new());
        // From a probability of 2^-12 at 1/257 per step: about 257 steps of 12 bits and falling.
        assert!(bytes.len() < 257 * 12 / 8, "{}", bytes.len());
    }

    #[test]
    fn costs_are_logarithms() {
        for (i, cost) in COSTS.iter().enumerate().skip(1) {
            let exact = -(i as f64 / COST_STEPS as f64).log2();
            let found = f64::from(*cost) / f64::from(1_u32 << COST_BITS);
            assert!((found - exact).abs() <= 0.52 / f64::from(1_u32 << COST_BITS), "{i}");
        }
    }

    #[test]
    fn neither_value_becomes_impossible() {
        for value in [false, true] {
            let mut bit = Bit::with_memory(Bit::MAX_MEMORY);
            for _ in 0..1_000_000 {
                bit.update(value);
            }
            assert_eq!(bit.zero_width(), if value { MIN_WIDTH } else { (1 << 16) - MIN_WIDTH });
            assert_eq!(bit.cost(!value), 12.0);
        }
        // The bound that callers check counts against: the least cost of a decision.
        let least = -(1.0 - f64::from(MIN_WIDTH) / 65536.0).log2();
        assert!((1.0 / least..1.0 / least + 2.0).contains(&(Bit::MAX_PER_BIT as f64)));
    }
}
