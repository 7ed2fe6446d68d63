//! Adaptive models of bits and integers for the entropy coder, in integer arithmetic.
//!
//! Every integer is coded as a few binary decisions, each with a [`Bit`] that learns as it goes. Contexts are
//! the caller's: an array of models, indexed by what is known already. A stream of a few hundred symbols is
//! the usual case, so a bit starts as the Krichevsky-Trofimov estimator, the best start when nothing is known,
//! and only later becomes an exponential average.

use crate::coder::Coder;
use crate::error::InvalidAlphabet;

/// Probabilities are multiples of `2^-PRECISION`.
pub const PRECISION: usize = 16;

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
    pub const MAX_PER_BIT: u64 = 2840;

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

    /// A bit for one decision whose probability of true is `one`, in units of 2^-16.
    pub(crate) const fn with_probability(one: u32) -> Self {
        Self {
            one: one << (u32::BITS - PRECISION as u32),
            updates: Self::DEFAULT_MEMORY,
            memory: Self::DEFAULT_MEMORY,
        }
    }

    /// Share of false in `[0, 2^16)`; at least 16 and at most 2^16 - 16.
    #[inline]
    pub fn zero_width(self) -> u32 {
        let one = self.one >> (u32::BITS - PRECISION as u32);
        (1 << PRECISION) - one.clamp(MIN_WIDTH, (1 << PRECISION) - MIN_WIDTH)
    }

    /// Where `value` begins in `[0, 2^16)`, and its share of it, at least 16 and at most 2^16 - 16: false comes first.
    ///
    /// Without a branch: which value comes next is what a processor cannot foresee.
    #[inline]
    pub fn slot(self, value: bool) -> (u32, u32) {
        let zero = self.zero_width();
        let is_true = u32::from(value).wrapping_neg();
        (zero & is_true, zero ^ ((zero ^ ((1 << PRECISION) - zero)) & is_true))
    }

    /// Takes note of a value.
    #[inline]
    pub fn update(&mut self, value: bool) {
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

/// The bits of a number below its highest one: the first two with bits of their own, the second by the first, the rest at a
/// bit per bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mantissa {
    first: Bit,
    /// After 0, after 1.
    second: [Bit; 2],
}

impl Mantissa {
    /// Bits of which nothing is known, with this memory, see [`Bit::with_memory`].
    pub const fn with_memory(memory: u16) -> Self {
        let bit = Bit::with_memory(memory);
        Self { first: bit, second: [bit; 2] }
    }

    /// Writes, reads or prices the lowest `n_bits` of a number, at most 31; those above are of no account.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        number: u32,
        n_bits: u32,
    ) -> Result<u32, C::Error> {
        if n_bits == 0 {
            return Ok(0);
        }
        let high = coder.bit(&mut self.first, number >> (n_bits - 1) & 1 != 0)?;
        if n_bits == 1 {
            return Ok(u32::from(high));
        }
        let rest = n_bits - 2;
        let low = coder.bit(&mut self.second[usize::from(high)], number >> rest & 1 != 0)?;
        let leading = u32::from(high) << 1 | u32::from(low);
        Ok(leading << rest | coder.bypass(u64::from(number), rest)? as u32)
    }

    /// Bits that the lowest `n_bits` of a number take now.
    pub fn cost(&self, number: u32, n_bits: u32) -> f32 {
        if n_bits == 0 {
            return 0.0;
        }
        let high = number >> (n_bits - 1) & 1 != 0;
        let first = self.first.cost(high);
        if n_bits == 1 {
            return first;
        }
        let rest = n_bits - 2;
        first + self.second[usize::from(high)].cost(number >> rest & 1 != 0) + rest as f32
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
    /// By exponent.
    mantissa: [Mantissa; Self::MAX_EXPONENT as usize],
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
        Self {
            exponent: [Bit::with_memory(memory); Self::MAX_EXPONENT as usize],
            mantissa: [Mantissa::with_memory(memory); Self::MAX_EXPONENT as usize],
        }
    }

    /// Exponent of `value`, and its mantissa.
    #[inline]
    fn split(value: u32) -> (u32, u32) {
        let shifted = u64::from(value) + 1;
        let exponent = shifted.ilog2();
        (exponent, (shifted - (1 << exponent)) as u32)
    }

    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, value: u32) -> Result<u32, C::Error> {
        let (wanted, mantissa) = Self::split(value);
        let mut exponent = 0;
        for bit in &mut self.exponent {
            if !coder.bit(bit, exponent < wanted)? {
                break;
            }
            exponent += 1;
        }
        let Some(model) = self.mantissa.get_mut(exponent as usize) else {
            return Ok(u32::MAX);
        };
        // 2^e + m with e <= 31, hence from 1 to u32::MAX.
        let shifted = 1 << exponent | model.code(coder, mantissa, exponent)?;
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
        cost + self.mantissa.get(exponent as usize).map_or(0.0, |of| of.cost(mantissa, exponent))
    }
}

/// An adaptive signed integer over all of `i32`, best for values around zero.
///
/// Is it zero, then its sign, then its magnitude less one as [`UInt`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SInt {
    nonzero: Bit,
    negative: Bit,
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
        Self { nonzero: bit, negative: bit, magnitude: UInt::with_memory(memory) }
    }

    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, value: i32) -> Result<i32, C::Error> {
        if !coder.bit(&mut self.nonzero, value != 0)? {
            return Ok(0);
        }
        let negative = coder.bit(&mut self.negative, value < 0)?;
        let wanted = value.unsigned_abs().saturating_sub(1);
        let magnitude = i64::from(self.magnitude.code(coder, wanted)?) + 1;
        let value = if negative { -magnitude } else { magnitude };
        i32::try_from(value)
            .map_err(|_| coder.corrupt(format!("integer {value} does not fit 32 bits")))
    }

    /// Bits that coding `value` takes now.
    pub fn cost(&self, value: i32) -> f32 {
        let mut cost = self.nonzero.cost(value != 0);
        if value != 0 {
            cost += self.negative.cost(value < 0);
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
    /// [`InvalidAlphabet`] unless `size` is 1 to 2^16.
    pub fn new(size: u32) -> Result<Self, InvalidAlphabet> {
        Self::with_memory(size, Bit::DEFAULT_MEMORY)
    }

    /// Symbols whose bits have the given memory, see [`Bit::with_memory`].
    ///
    /// # Errors
    /// [`InvalidAlphabet`] unless `size` is 1 to 2^16.
    pub fn with_memory(size: u32, memory: u16) -> Result<Self, InvalidAlphabet> {
        if !(1..=Self::MAX_SIZE).contains(&size) {
            return Err(InvalidAlphabet { size });
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

    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, value: u32) -> Result<u32, C::Error> {
        let mut read = 0_u32;
        for level in (0..self.depth).rev() {
            let with_one = read << 1 | 1;
            // 2^depth nodes; the prefix of fewer than `depth` bits behind a leading one is below that.
            let node = (1 << (self.depth - 1 - level)) | read as usize;
            let free = (with_one << level) < self.size;
            let one = free && coder.bit(&mut self.nodes[node], value >> level & 1 != 0)?;
            read = read << 1 | u32::from(one);
        }
        Ok(read)
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
    use super::*;

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
