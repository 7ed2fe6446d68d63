//! Checked little-endian reading and writing of the fixed-width and variable-length fields of a section.

use crate::container::Tag;
use crate::error::{Error, Result};

/// Longest variable-length integer in bytes: ten groups of seven bits hold a `u64`.
const MAX_VARINT: usize = 10;

/// Appends fields to a byte string.
#[derive(Debug, Clone, Default)]
pub struct ByteWriter {
    bytes: Vec<u8>,
}

impl ByteWriter {
    /// An empty string.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends one byte.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// Appends 4 bytes, little-endian.
    pub fn u32(&mut self, value: u32) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    /// Appends 8 bytes, little-endian.
    pub fn u64(&mut self, value: u64) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    /// Appends the 4 bytes of an IEEE 754 single, little-endian.
    pub fn f32(&mut self, value: f32) {
        self.u32(value.to_bits());
    }

    /// Appends the 8 bytes of an IEEE 754 double, little-endian.
    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// Appends `value` in groups of seven bits, low group first, the high bit set on all but the last (LEB128).
    pub fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    /// Appends a signed integer as the varint of its zigzag code 0, -1, 1, -2, 2, ...
    pub fn signed_varint(&mut self, value: i64) {
        self.varint(((value << 1) ^ (value >> 63)) as u64);
    }

    /// Appends `bytes` as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Number of bytes so far.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// True while nothing was appended.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The string.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads fields off the front of a section; every read is checked.
#[derive(Debug, Clone)]
pub struct ByteReader<'a> {
    section: Tag,
    bytes: &'a [u8],
    offset: usize,
}

impl<'a> ByteReader<'a> {
    /// Reads `bytes`, naming `section` in errors.
    pub fn new(section: Tag, bytes: &'a [u8]) -> Self {
        Self { section, bytes, offset: 0 }
    }

    /// Number of bytes read.
    pub fn offset(&self) -> usize {
        self.offset
    }

    /// Number of bytes left.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.offset
    }

    /// The next `len` bytes.
    pub fn bytes(&mut self, len: usize) -> Result<&'a [u8]> {
        // offset <= bytes.len() always, so the slice below is in range when the comparison holds.
        if len > self.remaining() {
            return Err(Error::Truncated {
                section: self.section,
                needed: len as u64,
                available: self.remaining() as u64,
            });
        }
        let start = self.offset;
        self.offset += len;
        Ok(&self.bytes[start..self.offset])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.bytes(N)?);
        Ok(array)
    }

    /// One byte.
    pub fn u8(&mut self) -> Result<u8> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    /// 4 bytes, little-endian.
    pub fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    /// 8 bytes, little-endian.
    pub fn u64(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// An IEEE 754 single; NaN and infinities are corrupt.
    pub fn f32(&mut self) -> Result<f32> {
        let offset = self.offset;
        let value = f32::from_bits(self.u32()?);
        self.finite(offset, f64::from(value)).map(|_| value)
    }

    /// An IEEE 754 double; NaN and infinities are corrupt.
    pub fn f64(&mut self) -> Result<f64> {
        let offset = self.offset;
        let value = f64::from_bits(self.u64()?);
        self.finite(offset, value)
    }

    fn finite(&self, offset: usize, value: f64) -> Result<f64> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(Error::corrupt(self.section, offset, format!("{value} where a number must stand")))
        }
    }

    /// A variable-length integer in its shortest form; any longer form is corrupt.
    pub fn varint(&mut self) -> Result<u64> {
        let start = self.offset;
        let mut value = 0_u64;
        for group in 0..MAX_VARINT {
            let byte = self.u8()?;
            let bits = u64::from(byte & 0x7f);
            let last = byte & 0x80 == 0;
            if (group == MAX_VARINT - 1 && bits > 1) || (last && bits == 0 && group > 0) {
                break;
            }
            value |= bits << (7 * group);
            if last {
                return Ok(value);
            }
        }
        Err(Error::corrupt(
            self.section,
            start,
            "a variable-length integer of more than 64 bits or with superfluous bytes",
        ))
    }

    /// A signed variable-length integer.
    pub fn signed_varint(&mut self) -> Result<i64> {
        let code = self.varint()?;
        Ok((code >> 1) as i64 ^ -((code & 1) as i64))
    }

    /// A varint count of items of which each takes at least `bytes_each` of the bytes that remain here.
    ///
    /// # Errors
    /// [`Error::TooLarge`] when the remaining bytes cannot hold so many, so that nothing is allocated for a
    /// count that is a lie.
    pub fn count(&mut self, what: &'static str, bytes_each: usize) -> Result<usize> {
        let value = self.varint()?;
        let limit = self.remaining() / bytes_each.max(1);
        match usize::try_from(value) {
            Ok(count) if count <= limit => Ok(count),
            _ => Err(Error::TooLarge {
                what,
                value,
                limit: limit as u64,
                remedy: "the remaining bytes hold no more, so the file is damaged: fetch it again",
            }),
        }
    }

    /// A varint of at most `limit`, as `usize`.
    pub fn bounded(&mut self, what: &'static str, limit: u64) -> Result<usize> {
        let value = self.varint()?;
        match usize::try_from(value) {
            Ok(small) if value <= limit => Ok(small),
            _ => Err(Error::TooLarge {
                what,
                value,
                limit,
                remedy: "raise the limit if you trust the file",
            }),
        }
    }

    /// [`Error::Corrupt`] at the current offset.
    pub fn corrupt(&self, what: impl Into<String>) -> Error {
        Error::corrupt(self.section, self.offset, what)
    }

    /// [`Error::TrailingBytes`] unless everything was read.
    pub fn finish(self) -> Result<()> {
        match self.remaining() {
            0 => Ok(()),
            count => Err(Error::TrailingBytes { section: self.section, count: count as u64 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEST: Tag = Tag::new(b"TEST");

    proptest! {
        #[test]
        fn fields_round_trip(
            (a, c, d) in any::<(u8, u32, u64)>(),
            e in any::<f32>().prop_filter("finite", |x| x.is_finite()),
            f in any::<f64>().prop_filter("finite", |x| x.is_finite()),
            (g, h) in any::<(u64, i64)>(),
            block in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let mut writer = ByteWriter::new();
            writer.u8(a);
            writer.u32(c);
            writer.u64(d);
            writer.f32(e);
            writer.f64(f);
            writer.varint(g);
            writer.signed_varint(h);
            writer.varint(block.len() as u64);
            writer.bytes(&block);
            let bytes = writer.finish();
            let mut reader = ByteReader::new(TEST, &bytes);
            prop_assert_eq!(reader.u8()?, a);
            prop_assert_eq!(reader.u32()?, c);
            prop_assert_eq!(reader.u64()?, d);
            prop_assert_eq!(reader.f32()?.to_bits(), e.to_bits());
            prop_assert_eq!(reader.f64()?.to_bits(), f.to_bits());
            prop_assert_eq!(reader.varint()?, g);
            prop_assert_eq!(reader.signed_varint()?, h);
            let len = reader.count("bytes", 1)?;
            prop_assert_eq!(reader.bytes(len)?, &block[..]);
            reader.finish()?;
        }

        #[test]
        fn accepted_varints_are_canonical(bytes in prop::collection::vec(any::<u8>(), 0..12)) {
            let mut reader = ByteReader::new(TEST, &bytes);
            if let Ok(value) = reader.varint() {
                let mut writer = ByteWriter::new();
                writer.varint(value);
                prop_assert_eq!(&writer.finish()[..], &bytes[..reader.offset()]);
            }
        }
    }

    #[test]
    fn extremes_of_varints() {
        for (value, len) in [(0, 1), (127, 1), (128, 2), (u64::from(u32::MAX), 5), (u64::MAX, 10)] {
            let mut writer = ByteWriter::new();
            writer.varint(value);
            assert_eq!(writer.len(), len);
            let bytes = writer.finish();
            assert_eq!(ByteReader::new(TEST, &bytes).varint(), Ok(value));
            for cut in 0..len {
                let error = ByteReader::new(TEST, &bytes[..cut]).varint().unwrap_err();
                assert!(matches!(error, Error::Truncated { needed: 1, available: 0, .. }));
            }
        }
        for value in [i64::MIN, -1, 0, 1, i64::MAX] {
            let mut writer = ByteWriter::new();
            writer.signed_varint(value);
            let bytes = writer.finish();
            assert_eq!(ByteReader::new(TEST, &bytes).signed_varint(), Ok(value));
        }
    }

    #[test]
    fn longer_forms_of_varints_are_corrupt() {
        for bytes in [&[0x80, 0x00][..], &[0xff; 11], &[0x80; 11]] {
            let error = ByteReader::new(TEST, bytes).varint().unwrap_err();
            assert!(matches!(error, Error::Corrupt { offset: 0, .. }), "{error}");
        }
    }

    #[test]
    fn counts_beyond_the_bytes_are_refused() {
        let mut writer = ByteWriter::new();
        writer.varint(3);
        writer.bytes(&[0; 11]);
        let bytes = writer.finish();
        assert_eq!(ByteReader::new(TEST, &bytes).count("words", 3), Ok(3));
        assert_eq!(
            ByteReader::new(TEST, &bytes).count("words", 4).unwrap_err(),
            Error::TooLarge {
                what: "words",
                value: 3,
                limit: 2,
                remedy: "the remaining bytes hold no more, so the file is damaged: fetch it again",
            }
        );
        assert!(ByteReader::new(TEST, &bytes).bounded("words", 2).is_err());
        let mut huge = ByteWriter::new();
        huge.varint(u64::MAX);
        let huge = huge.finish();
        assert!(ByteReader::new(TEST, &huge).count("words", 0).is_err());
        let beyond = ByteReader::new(TEST, &huge).bytes(huge.len() + 1);
        assert!(matches!(beyond, Err(Error::Truncated { needed: 11, available: 10, .. })));
    }

    #[test]
    fn floats_that_are_no_numbers_are_corrupt() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut writer = ByteWriter::new();
            writer.f64(value);
            writer.f32(value as f32);
            let bytes = writer.finish();
            let mut reader = ByteReader::new(TEST, &bytes);
            assert!(matches!(reader.f64(), Err(Error::Corrupt { offset: 0, .. })));
            assert!(matches!(reader.f32(), Err(Error::Corrupt { offset: 8, .. })));
        }
    }

    #[test]
    fn unread_bytes_are_an_error() {
        let mut reader = ByteReader::new(TEST, &[1, 2, 3]);
        assert_eq!(reader.u8(), Ok(1));
        assert_eq!(reader.finish(), Err(Error::TrailingBytes { section: TEST, count: 2 }));
    }
}
