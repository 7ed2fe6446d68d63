//! The entropy coder: a range coder over adaptive bits. The crate `constriction`, which writes, is named here only.
//!
//! Range coding (Martin 1979) as in Bamler, "Understanding Entropy Coding With Asymmetric Numeral Systems",
//! 2022, with 32-bit words, a 64-bit state and probabilities in units of 2^-16. All arithmetic that decides
//! which symbol is read is on integers.
//!
//! Reading is ours: which of two values comes next is a comparison, where a decoder of any alphabet has to divide.

use std::num::NonZeroU32;

use constriction::stream::Encode;
use constriction::stream::model::{EncoderModel, EntropyModel};
use constriction::stream::queue::{EncoderSituation, RangeEncoder};

use surfabet_entropy::{Coder, PRECISION};

use crate::container::Tag;
use crate::error::{Error, Result};
use crate::models::{Bit, SInt, Symbols, UInt};

/// Bytes of the coder's word: what it writes and reads at once.
const WORD_BYTES: usize = 4;

/// Bits of the coder's word.
const WORD_BITS: u32 = u32::BITS;

/// Words that the decoder's state is ahead of what the encoder had to write, at most: the encoder's last words
/// are cut to the bytes that distinguish its final interval from others.
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
        let (left, width) = model.slot(value);
        self.encode(left, width);
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
        let Ok(_) = Coder::uint(self, model, value);
    }

    /// Appends `value`, adapting `model`.
    #[inline]
    pub fn sint(&mut self, model: &mut SInt, value: i32) {
        let Ok(_) = Coder::sint(self, model, value);
    }

    /// Appends `value`, adapting `model`.
    ///
    /// # Panics
    /// When `value` is not below the size of the model's alphabet.
    #[inline]
    pub fn symbol(&mut self, model: &mut Symbols, value: u32) {
        let Ok(_) = Coder::symbol(self, model, value);
    }

    /// The stream. It does not carry its own length: store that beside it.
    ///
    /// Of the final words only the bytes are kept that distinguish the final interval from its neighbours when zeros
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

impl Coder for Encoder {
    type Error = std::convert::Infallible;

    #[inline]
    fn bit(&mut self, model: &mut Bit, value: bool) -> Result<bool, Self::Error> {
        self.bit(model, value);
        Ok(value)
    }

    #[inline]
    fn bypass(&mut self, value: u64, n_bits: u32) -> Result<u64, Self::Error> {
        self.bypass(value, n_bits);
        Ok(if n_bits >= u64::BITS { value } else { value & ((1 << n_bits) - 1) })
    }

    fn corrupt(&self, what: String) -> Self::Error {
        unreachable!("a writer is given values that fit, not: {what}")
    }
}

impl Coder for Decoder<'_> {
    type Error = Error;

    #[inline]
    fn bit(&mut self, model: &mut Bit, _: bool) -> Result<bool> {
        self.bit(model)
    }

    #[inline]
    fn bypass(&mut self, _: u64, n_bits: u32) -> Result<u64> {
        self.bypass(n_bits)
    }

    fn corrupt(&self, what: String) -> Error {
        self.corrupt(what)
    }
}

/// Reads the symbols that [`Encoder`] wrote, given models in the same initial state.
#[derive(Debug, Clone)]
pub struct Decoder<'a> {
    section: Tag,
    bytes: &'a [u8],
    /// Index of the next word of `bytes`.
    next: usize,
    /// The number that stands in the stream, from the lower end of the present interval on.
    offset: u64,
    /// Width of the present interval, at least 2^32.
    range: u64,
}

impl<'a> Decoder<'a> {
    /// Reads `bytes`, naming `section` in errors. Any bytes will do: whether they are a stream shows as symbols
    /// are read.
    pub fn new(section: Tag, bytes: &'a [u8]) -> Self {
        let mut first = [0; LOOKAHEAD_WORDS * WORD_BYTES];
        let len = bytes.len().min(first.len());
        first[..len].copy_from_slice(&bytes[..len]);
        let offset = u64::from_be_bytes(first);
        Self { section, bytes, next: LOOKAHEAD_WORDS, offset, range: u64::MAX }
    }

    /// Checks a number of symbols that the header claims for this stream, before anything is allocated for
    /// them: no binary decision takes less than 2^-12 / ln 2 bits, so a stream has no more than 22 720 per byte.
    ///
    /// # Errors
    /// [`Error::TooLarge`] when the stream is too short for so many.
    pub fn check_count(&self, what: &'static str, count: u64) -> Result<()> {
        let bits =
            (self.bytes.len() as u64 + (LOOKAHEAD_WORDS * WORD_BYTES) as u64).saturating_mul(8);
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

    /// Width of a 2^-16th of the interval.
    #[inline]
    fn scale(&self) -> Result<u64> {
        let scale = self.range >> PRECISION;
        // The interval may be wider than 2^16 of them, by less than one.
        if self.offset >= scale << PRECISION {
            return Err(self.no_code());
        }
        Ok(scale)
    }

    /// Widens the interval by the next word of the stream where it is narrower than a word.
    #[inline]
    fn renormalise(&mut self) -> Result<()> {
        if self.range >> WORD_BITS == 0 {
            self.range <<= WORD_BITS;
            self.offset = self.offset << WORD_BITS | u64::from(self.word()?);
        }
        Ok(())
    }

    /// The next big-endian word; zeros follow the stream's end, but no more than an encoder may have left out.
    #[inline]
    fn word(&mut self) -> Result<u32> {
        // After k renormalisations the encoder has written 4 k bytes and up to 8 more, the decoder has read
        // k + 2 words. So word k + 2 is asked of at least 4 k bytes, and never any later one.
        let start = self.next * WORD_BYTES;
        let word = match self.bytes.get(start..start + WORD_BYTES) {
            Some(word) => [word[0], word[1], word[2], word[3]],
            None if self.next >= self.bytes.len() / WORD_BYTES + LOOKAHEAD_WORDS => {
                return Err(self.past_end());
            }
            None => {
                let mut word = [0; WORD_BYTES];
                let rest = self.bytes.get(start..).unwrap_or_default();
                word[..rest.len()].copy_from_slice(rest);
                word
            }
        };
        self.next += 1;
        Ok(u32::from_be_bytes(word))
    }

    #[cold]
    fn past_end(&self) -> Error {
        Error::Truncated { section: self.section, needed: WORD_BYTES as u64, available: 0 }
    }

    #[cold]
    fn no_code(&self) -> Error {
        self.corrupt("the entropy-coded stream holds a number that no encoder writes")
    }

    /// [`Error::Corrupt`] at about the byte reached.
    #[cold]
    pub fn corrupt(&self, what: impl Into<String>) -> Error {
        let read = self.next.saturating_sub(LOOKAHEAD_WORDS) * WORD_BYTES;
        Error::corrupt(self.section, read.min(self.bytes.len()), what)
    }

    /// The next bit, adapting `model`.
    ///
    /// # Errors
    /// As all verbs: [`Error::Truncated`] behind the end of the stream, [`Error::Corrupt`] for a number that no
    /// encoder writes.
    #[inline]
    pub fn bit(&mut self, model: &mut Bit) -> Result<bool> {
        let scale = self.scale()?;
        let zero = scale * u64::from(model.zero_width());
        let value = self.offset >= zero;
        // Without a branch: which value comes next is what a processor cannot foresee.
        let is_true = u64::from(value).wrapping_neg();
        self.offset -= zero & is_true;
        self.range = zero ^ ((zero ^ ((scale << PRECISION) - zero)) & is_true);
        self.renormalise()?;
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
            let width = self.scale()? << (BYPASS_BITS - now);
            // Below 2^now, see `scale`; the interval is at least 2^32 wide, so that no width is zero.
            let symbol = self.offset / width;
            self.offset -= symbol * width;
            self.range = width;
            self.renormalise()?;
            value = (value << now) | symbol;
        }
        Ok(value)
    }

    /// The next unsigned integer, adapting `model`.
    #[inline]
    pub fn uint(&mut self, model: &mut UInt) -> Result<u32> {
        Coder::uint(self, model, 0)
    }

    /// The next signed integer, adapting `model`.
    #[inline]
    pub fn sint(&mut self, model: &mut SInt) -> Result<i32> {
        Coder::sint(self, model, 0)
    }

    /// The next symbol, below the size of the model's alphabet, adapting `model`.
    #[inline]
    pub fn symbol(&mut self, model: &mut Symbols) -> Result<u32> {
        Coder::symbol(self, model, 0)
    }

    /// Checks that the last symbol was read.
    ///
    /// # Errors
    /// [`Error::TrailingBytes`] when the stream is longer than the symbols read can have made it.
    pub fn finish(self) -> Result<()> {
        match self.bytes.len().saturating_sub(self.next * WORD_BYTES) {
            0 => Ok(()),
            count => Err(Error::TrailingBytes { section: self.section, count: count as u64 }),
        }
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_entropy::{Cells, Octree, Price};

    use super::*;

    const TEST: Tag = Tag::new(b"TEST");

    /// What a stream of mixed content is made of.
    #[derive(Debug, Clone, PartialEq)]
    enum Item {
        Bit(bool),
        Bypass(u64, u32),
        UInt(u32),
        SInt(i32),
        Symbol(u32),
    }

    struct Models {
        bit: Bit,
        uint: UInt,
        sint: SInt,
        symbols: Symbols,
    }

    impl Models {
        fn new() -> Self {
            Self {
                bit: Bit::new(),
                uint: UInt::new(),
                sint: SInt::new(),
                symbols: Symbols::new(11).unwrap(),
            }
        }
    }

    fn encode(items: &[Item]) -> Vec<u8> {
        let (mut encoder, mut models) = (Encoder::new(), Models::new());
        for item in items {
            match item {
                Item::Bit(value) => encoder.bit(&mut models.bit, *value),
                Item::Bypass(value, n_bits) => encoder.bypass(*value, *n_bits),
                Item::UInt(value) => encoder.uint(&mut models.uint, *value),
                Item::SInt(value) => encoder.sint(&mut models.sint, *value),
                Item::Symbol(value) => encoder.symbol(&mut models.symbols, *value),
            }
        }
        encoder.finish()
    }

    /// Decodes a stream of the shape of `shape`.
    fn decode(shape: &[Item], bytes: &[u8]) -> Result<Vec<Item>> {
        let (mut decoder, mut models) = (Decoder::new(TEST, bytes), Models::new());
        let mut items = Vec::new();
        for item in shape {
            items.push(match item {
                Item::Bit(_) => Item::Bit(decoder.bit(&mut models.bit)?),
                Item::Bypass(_, n_bits) => Item::Bypass(decoder.bypass(*n_bits)?, *n_bits),
                Item::UInt(_) => Item::UInt(decoder.uint(&mut models.uint)?),
                Item::SInt(_) => Item::SInt(decoder.sint(&mut models.sint)?),
                Item::Symbol(_) => Item::Symbol(decoder.symbol(&mut models.symbols)?),
            });
        }
        decoder.finish()?;
        Ok(items)
    }

    fn any_item() -> impl Strategy<Value = Item> {
        prop_oneof![
            any::<bool>().prop_map(Item::Bit),
            (any::<u64>(), 0_u32..=64)
                .prop_map(|(value, n)| Item::Bypass(value.checked_shr(64 - n).unwrap_or(0), n)),
            any::<u32>().prop_map(Item::UInt),
            any::<i32>().prop_map(Item::SInt),
            (0_u32..11).prop_map(Item::Symbol),
        ]
    }

    proptest! {
        #[test]
        fn mixed_streams_round_trip(items in prop::collection::vec(any_item(), 0..200)) {
            prop_assert_eq!(decode(&items, &encode(&items))?, items);
        }

        #[test]
        fn longer_streams_are_refused(
            items in prop::collection::vec(any_item(), 0..50),
            extra in prop::collection::vec(any::<u8>(), 12..40),
        ) {
            let mut bytes = encode(&items);
            bytes.extend(extra);
            let found = decode(&items, &bytes);
            prop_assert!(matches!(found, Err(Error::TrailingBytes { .. })), "{:?}", found);
        }

        #[test]
        fn garbage_ends(items in prop::collection::vec(any_item(), 0..200), bytes: Vec<u8>) {
            // Whatever it gives, it does not panic.
            let _ = decode(&items, &bytes);
        }
    }

    /// A stream that exercises every verb, from a fixed generator.
    fn sample() -> Vec<Item> {
        let mut state = 12_345_u32;
        let mut next = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 16
        };
        (0..60)
            .map(|i| match i % 5 {
                0 => Item::Bit(next() % 8 == 0),
                1 => Item::Bypass(u64::from(next() % 32), 5),
                2 => Item::UInt((next() % 1000) >> (next() % 10)),
                3 => Item::SInt((next() % 7) as i32 - 3),
                _ => Item::Symbol(next() % 11),
            })
            .collect()
    }

    #[test]
    fn the_golden_stream_is_read_and_written_on_every_platform() {
        // Made by an independent encoder on unbounded integers, written from docs/format.md, 2.7.
        const GOLDEN: [u8; 31] = [
            0x72, 0x54, 0x01, 0x49, 0x65, 0xc1, 0x9c, 0x61, 0x5c, 0x8a, 0x24, 0x87, 0xcf, 0x50,
            0x49, 0x27, 0x5b, 0x8e, 0x55, 0x33, 0x59, 0xaf, 0x6b, 0xa1, 0x4b, 0xff, 0x27, 0x92,
            0xc1, 0x46, 0x84,
        ];
        assert_eq!(encode(&sample()), GOLDEN);
        assert_eq!(decode(&sample(), &GOLDEN), Ok(sample()));
    }

    #[test]
    fn truncation_and_flips_end_or_give_other_symbols() {
        let items = sample();
        let bytes = encode(&items);
        for len in 0..bytes.len() {
            // Zeros follow a stream's end, so a cut is noticed only when it cuts off more than zeros. The
            // container knows the true length.
            let found = decode(&items, &bytes[..len]);
            assert_ne!(found.ok().as_ref(), Some(&items), "cut to {len}");
        }
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let _ = decode(&items, &flipped);
        }
    }

    proptest! {
        #[test]
        fn a_tree_takes_the_bytes_of_its_price_and_comes_back(
            codes in prop::collection::btree_set(0_u64..1 << 30, 1..300),
        ) {
            let codes: Vec<u64> = codes.into_iter().collect();
            let mut encoder = Encoder::new();
            let mut price = Price::default();
            let Ok(written) = tree(&mut encoder, &codes, codes.len());
            let Ok(_) = tree(&mut price, &codes, codes.len());
            let bytes = encoder.finish();
            // Prices of single decisions are rounded to 2^-12 bits and a stream ends in whole bytes.
            let length = 8.0 * bytes.len() as f64;
            let tolerance = 0.002 * price.bits;
            prop_assert!(length >= price.bits - tolerance - 8.0, "{} of {}", length, price.bits);
            prop_assert!(length <= price.bits + tolerance + 24.0, "{} of {}", length, price.bits);
            let mut decoder = Decoder::new(TEST, &bytes);
            prop_assert_eq!(tree(&mut decoder, &[], codes.len())?, written);
            prop_assert_eq!(decoder.finish(), Ok(()));
        }
    }

    /// Cells of an octree over codes of 30 bits.
    fn tree<C: Coder>(
        coder: &mut C,
        codes: &[u64],
        most: usize,
    ) -> Result<Vec<[u32; 3]>, C::Error> {
        let mut models = Octree::new(3);
        let mut cells = Cells::new(codes, 10, most);
        let mut found = Vec::new();
        while let Some(cell) = cells.next(coder, &mut models)? {
            found.push(cell.at);
        }
        Ok(found)
    }

    #[test]
    fn an_empty_stream_ends_soon() {
        // As long as every bit is most probable: all zeros.
        let (mut decoder, mut model) = (Decoder::new(TEST, &[]), Bit::new());
        let mut count = 0_u64;
        let error = loop {
            match decoder.bit(&mut model) {
                Ok(value) => assert!(!value),
                Err(error) => break error,
            }
            count += 1;
        };
        assert_eq!(error, Error::Truncated { section: TEST, needed: 4, available: 0 });
        // The count that is refused beforehand is above what can be read, and the latter not much below it.
        assert!(Decoder::new(TEST, &[]).check_count("bits", count).is_ok());
        assert!(Decoder::new(TEST, &[]).check_count("bits", 3 * count).is_err());
        assert!(Decoder::new(TEST, &[0; 100]).check_count("bits", u64::MAX).is_err());
    }

    #[test]
    fn bypass_ends_after_the_tail() {
        let mut decoder = Decoder::new(TEST, &[1, 2, 3]);
        let read = (0..100).take_while(|_| decoder.bypass(8).is_ok()).count();
        assert!(read <= 3 + LOOKAHEAD_WORDS * WORD_BYTES, "{read}");
    }

    #[test]
    fn finishing_takes_a_byte_at_most() {
        for n in 0..200_u32 {
            let mut encoder = Encoder::new();
            encoder.bypass(u64::MAX, n.min(64));
            encoder.bypass(u64::MAX / 3, n.saturating_sub(64).min(64));
            encoder.bypass(u64::MAX / 5, n.saturating_sub(128).min(64));
            let bits = n.min(192);
            assert!(encoder.finish().len() <= (bits as usize).div_ceil(8) + 1, "{n}");
        }
    }

    #[test]
    fn carries_run_through_words_held_back() {
        // All ones, then something larger or smaller: the encoder holds words back until it knows.
        for ones in [16, 31, 32, 33, 64, 96, 100, 200] {
            for end in [false, true] {
                let mut items = vec![Item::Bypass(1, 1); ones];
                items.extend(vec![Item::Bit(true); 300]);
                items.extend(vec![Item::Bit(end); 3]);
                items.push(Item::UInt(77));
                assert_eq!(decode(&items, &encode(&items)), Ok(items));
            }
        }
    }
}
