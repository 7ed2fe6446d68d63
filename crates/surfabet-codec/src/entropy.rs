//! The entropy coder: a range coder over adaptive bits. The crate `constriction` is named here only.
//!
//! Range coding (Martin 1979) as in Bamler, "Understanding Entropy Coding With Asymmetric Numeral Systems",
//! 2022, with 32-bit words, a 64-bit state and probabilities in units of 2^-16. All arithmetic that decides
//! which symbol is read is on integers.

use std::num::NonZeroU32;

use constriction::backends::ReadWords;
use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};
use constriction::stream::queue::{EncoderSituation, RangeDecoder, RangeEncoder};
use constriction::stream::{Decode, Encode};
use constriction::{CoderError, Queue};

use crate::container::Tag;
use crate::error::{Error, Result};
use crate::models::{Bit, SInt, Symbols, UInt};

/// Probabilities are multiples of `2^-PRECISION`.
pub(crate) const PRECISION: usize = 16;

/// Bytes of the coder's word: what it writes and reads at once.
const WORD_BYTES: usize = 4;

/// Words that the decoder's state is ahead of what the encoder had to write, at most: the encoder's last words
/// are cut to the bytes that tell its final interval from others.
const LOOKAHEAD_WORDS: usize = 2;

/// Most bits that are coded as one equiprobable symbol.
const BYPASS_BITS: u32 = PRECISION as u32;

/// Appends symbols to a stream that [`Decoder`] reads in the same order.
#[derive(Debug, Clone, Default)]
pub struct Encoder {
    coder: RangeEncoder<u32, u64>,
}

impl Encoder {
    /// An empty stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends a symbol that takes `[left, left + width)` of `[0, 2^16)`; `0 < width`, no overflow.
    #[inline]
    fn encode(&mut self, left: u32, width: u32) {
        // The backend is a vector, which cannot fail; and no width is zero: bits keep both probabilities
        // above zero, equiprobable symbols have a power of two.
        self.coder
            .encode_symbol((), Slot { left, width })
            .expect("every slot has a width above zero and a vector takes every word");
    }

    /// Appends `value`, adapting `model`.
    #[inline]
    pub fn bit(&mut self, model: &mut Bit, value: bool) {
        let zero = model.zero_width();
        if value {
            self.encode(zero, (1 << PRECISION) - zero);
        } else {
            self.encode(0, zero);
        }
        model.update(value);
    }

    /// Appends the low `n_bits` of `value`, at most 64, each at the price of one bit; higher bits are ignored.
    #[inline]
    pub fn bypass(&mut self, value: u64, n_bits: u32) {
        let mut left = n_bits.min(u64::BITS);
        while left > 0 {
            let now = left.min(BYPASS_BITS);
            left -= now;
            let symbol = (value >> left) as u32 & ((1 << now) - 1);
            let shift = BYPASS_BITS - now;
            self.encode(symbol << shift, 1 << shift);
        }
    }

    /// Appends `value`, adapting `model`.
    #[inline]
    pub fn uint(&mut self, model: &mut UInt, value: u32) {
        model.encode(self, value);
    }

    /// Appends `value`, adapting `model`.
    #[inline]
    pub fn sint(&mut self, model: &mut SInt, value: i32) {
        model.encode(self, value);
    }

    /// Appends `value`, adapting `model`.
    ///
    /// # Panics
    /// When `value` is not below the size of the model's alphabet.
    #[inline]
    pub fn symbol(&mut self, model: &mut Symbols, value: u32) {
        model.encode(self, value);
    }

    /// Upper bound of the bytes that [`Encoder::finish`] would return now.
    pub fn len_bound(&self) -> usize {
        let words = self.coder.bulk().len() + LOOKAHEAD_WORDS;
        words * WORD_BYTES
    }

    /// The stream. It does not carry its own length: store that beside it.
    ///
    /// Of the final words only the bytes are kept that tell the final interval from its neighbours when zeros
    /// follow, 2.5 on average.
    pub fn finish(self) -> Vec<u8> {
        let (mut words, state, situation) = self.coder.into_raw_parts();
        // Every number in [lower, lower + range) decodes to these symbols. Take the one with most zeros at
        // its end. The sum may pass 2^64; then it carries into the words held back.
        let lower = u128::from(state.lower());
        let last = lower + u128::from(state.range().get()) - 1;
        let mut point = lower;
        for zeros in (0..=u64::BITS).rev() {
            let rounded = ((lower + (1 << zeros) - 1) >> zeros) << zeros;
            if rounded <= last {
                point = rounded;
                break;
            }
        }
        let carry = point >> u64::BITS != 0;
        if let EncoderSituation::Inverted(count, first) = situation {
            words.push(first.wrapping_add(u32::from(carry)));
            let others = if carry { 0 } else { u32::MAX };
            words.extend(std::iter::repeat_n(others, count.get() - 1));
        }
        let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
        let tail = (point as u64).to_be_bytes();
        let kept = tail.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        bytes.extend_from_slice(&tail[..kept]);
        bytes
    }
}

/// Reads the symbols that [`Encoder`] wrote, given models in the same initial state.
#[derive(Debug, Clone)]
pub struct Decoder<'a> {
    section: Tag,
    coder: RangeDecoder<u32, u64, WordSource<'a>>,
    len: usize,
}

impl<'a> Decoder<'a> {
    /// Reads `bytes`, naming `section` in errors. Any bytes will do: whether they are a stream shows as symbols
    /// are read.
    pub fn new(section: Tag, bytes: &'a [u8]) -> Self {
        let coder = RangeDecoder::with_backend(WordSource { bytes, next: 0 })
            .expect("the source gives the two words read here for every length, even none");
        Self { section, coder, len: bytes.len() }
    }

    /// Checks a number of symbols that the header claims for this stream, before anything is allocated for
    /// them: no binary decision takes less than 2^-12 / ln 2 bits, so a stream has no more than 22 720 per byte.
    ///
    /// # Errors
    /// [`Error::TooLarge`] when the stream is too short for so many.
    pub fn check_count(&self, what: &'static str, count: u64) -> Result<()> {
        let bits = (self.len as u64 + (LOOKAHEAD_WORDS * WORD_BYTES) as u64).saturating_mul(8);
        let limit = bits.saturating_mul(Bit::MAX_PER_BIT);
        if count <= limit {
            return Ok(());
        }
        Err(Error::TooLarge {
            what,
            value: count,
            limit,
            remedy: "the stream is too short for so many, so the file is damaged: fetch it again",
        })
    }

    #[inline]
    fn decode<M>(&mut self, model: M) -> Result<M::Symbol>
    where
        M: DecoderModel<PRECISION, Probability = u32>,
    {
        match self.coder.decode_symbol(model) {
            Ok(symbol) => Ok(symbol),
            Err(CoderError::Backend(error)) => Err(past_end(self.section, error)),
            Err(CoderError::Frontend(_)) => Err(self.no_code()),
        }
    }

    #[cold]
    fn no_code(&self) -> Error {
        self.corrupt("the entropy-coded stream holds a number that no encoder writes")
    }

    /// [`Error::Corrupt`] at about the byte reached.
    #[cold]
    pub fn corrupt(&self, what: impl Into<String>) -> Error {
        let (source, _, _) = self.coder.clone().into_raw_parts();
        let read = source.next.saturating_sub(LOOKAHEAD_WORDS) * WORD_BYTES;
        Error::corrupt(self.section, read.min(self.len), what)
    }

    /// The next bit, adapting `model`.
    ///
    /// # Errors
    /// As all verbs: [`Error::Truncated`] behind the end of the stream, [`Error::Corrupt`] for a number that no
    /// encoder writes.
    #[inline]
    pub fn bit(&mut self, model: &mut Bit) -> Result<bool> {
        let value = self.decode(BitSlots { zero: model.zero_width() })?;
        model.update(value);
        Ok(value)
    }

    /// The next `n_bits`, at most 64, as the low bits of a number.
    #[inline]
    pub fn bypass(&mut self, n_bits: u32) -> Result<u64> {
        let mut value = 0_u64;
        let mut left = n_bits.min(u64::BITS);
        while left > 0 {
            let now = left.min(BYPASS_BITS);
            left -= now;
            value = (value << now) | u64::from(self.decode(EqualSlots { n_bits: now })?);
        }
        Ok(value)
    }

    /// The next unsigned integer, adapting `model`.
    #[inline]
    pub fn uint(&mut self, model: &mut UInt) -> Result<u32> {
        model.decode(self)
    }

    /// The next signed integer, adapting `model`.
    #[inline]
    pub fn sint(&mut self, model: &mut SInt) -> Result<i32> {
        model.decode(self)
    }

    /// The next symbol, below the size of the model's alphabet, adapting `model`.
    #[inline]
    pub fn symbol(&mut self, model: &mut Symbols) -> Result<u32> {
        model.decode(self)
    }

    /// Checks that the last symbol was read.
    ///
    /// # Errors
    /// [`Error::TrailingBytes`] when the stream is longer than the symbols read can have made it.
    pub fn finish(self) -> Result<()> {
        let (source, _, _) = self.coder.into_raw_parts();
        match self.len.saturating_sub(source.next * WORD_BYTES) {
            0 => Ok(()),
            count => Err(Error::TrailingBytes { section: self.section, count: count as u64 }),
        }
    }
}

/// Read words behind the end of the data.
#[derive(Debug, Clone, Copy)]
struct PastEnd {
    needed: u64,
}

#[cold]
fn past_end(section: Tag, PastEnd { needed }: PastEnd) -> Error {
    Error::Truncated { section, needed, available: 0 }
}

/// Big-endian words of a byte string; zeros follow its end, but no more than an encoder may have left out.
#[derive(Debug, Clone)]
struct WordSource<'a> {
    bytes: &'a [u8],
    /// Index of the next word.
    next: usize,
}

impl ReadWords<u32, Queue> for WordSource<'_> {
    type ReadError = PastEnd;

    #[inline]
    fn read(&mut self) -> Result<Option<u32>, PastEnd> {
        // After k renormalisations the encoder has written 4 k bytes and up to 8 more, the decoder has read
        // k + 2 words. So word k + 2 is asked of at least 4 k bytes, and never any later one.
        let start = self.next * WORD_BYTES;
        let word = match self.bytes.get(start..start + WORD_BYTES) {
            Some(word) => u32::from_be_bytes([word[0], word[1], word[2], word[3]]),
            None if self.next >= self.bytes.len() / WORD_BYTES + LOOKAHEAD_WORDS => {
                return Err(PastEnd { needed: WORD_BYTES as u64 });
            }
            None => {
                let mut word = [0; WORD_BYTES];
                let rest = self.bytes.get(start..).unwrap_or_default();
                word[..rest.len()].copy_from_slice(rest);
                u32::from_be_bytes(word)
            }
        };
        self.next += 1;
        Ok(Some(word))
    }

    fn maybe_exhausted(&self) -> bool {
        self.next * WORD_BYTES >= self.bytes.len()
    }
}

/// One symbol with its place in `[0, 2^16)`, for the encoder.
struct Slot {
    left: u32,
    width: u32,
}

impl EntropyModel<PRECISION> for Slot {
    type Symbol = ();
    type Probability = u32;
}

impl EncoderModel<PRECISION> for Slot {
    #[inline]
    fn left_cumulative_and_probability(
        &self,
        _: impl std::borrow::Borrow<()>,
    ) -> Option<(u32, NonZeroU32)> {
        Some((self.left, NonZeroU32::new(self.width)?))
    }
}

/// A bit whose zero takes `[0, zero)` of `[0, 2^16)`, for the decoder; `0 < zero < 2^16`.
struct BitSlots {
    zero: u32,
}

impl EntropyModel<PRECISION> for BitSlots {
    type Symbol = bool;
    type Probability = u32;
}

impl DecoderModel<PRECISION> for BitSlots {
    #[inline]
    fn quantile_function(&self, quantile: u32) -> (bool, u32, NonZeroU32) {
        let value = quantile >= self.zero;
        let (left, width) =
            if value { (self.zero, (1 << PRECISION) - self.zero) } else { (0, self.zero) };
        // Both widths are above zero, see `Bit::zero_width`; the maximum only tells the compiler.
        (value, left, NonZeroU32::new(width).unwrap_or(NonZeroU32::MIN))
    }
}

/// Equiprobable numbers of `n_bits`, 1 to 16, for the decoder.
struct EqualSlots {
    n_bits: u32,
}

impl EntropyModel<PRECISION> for EqualSlots {
    type Symbol = u32;
    type Probability = u32;
}

impl DecoderModel<PRECISION> for EqualSlots {
    #[inline]
    fn quantile_function(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        let shift = BYPASS_BITS - self.n_bits;
        let value = quantile >> shift;
        // A power of two is above zero; the minimum only tells the compiler.
        (value, value << shift, NonZeroU32::new(1 << shift).unwrap_or(NonZeroU32::MIN))
    }
}
