//! The header section: one function per method that writes and reads it field by field.

use crate::bytes::{ByteReader, ByteWriter};
use crate::container::{Limits, Tag};
use crate::error::{Error, Result};

/// Tag of the header section of every model.
pub const META: Tag = Tag::new(b"META");

/// Writes fields, or reads them into the places given: a header is one list of calls for both.
pub trait Fields {
    /// An unsigned integer.
    fn varint(&mut self, value: &mut u64) -> Result<()>;

    /// A signed integer.
    fn signed(&mut self, value: &mut i64) -> Result<()>;

    /// A finite double.
    fn f64(&mut self, value: &mut f64) -> Result<()>;

    /// A finite single.
    fn f32(&mut self, value: &mut f32) -> Result<()>;

    /// An unsigned integer of at most `limit`.
    fn bounded(&mut self, what: &'static str, value: &mut u32, limit: u32) -> Result<()>;

    /// A number of items of `bytes_each` bytes of memory, within the caller's limits.
    fn count(&mut self, what: &'static str, value: &mut u64, bytes_each: u64) -> Result<()>;

    /// A list whose items take at least `bytes_each` bytes here: its length, then every item by `item`.
    fn list<T: Default>(
        &mut self,
        what: &'static str,
        values: &mut Vec<T>,
        bytes_each: usize,
        item: impl FnMut(&mut Self, &mut T) -> Result<()>,
    ) -> Result<()>;

    /// The error of a value that no model has, at the place reached.
    fn corrupt(&self, what: String) -> Error;

    /// Three finite doubles.
    fn vector(&mut self, value: &mut [f64; 3]) -> Result<()> {
        value.iter_mut().try_for_each(|c| self.f64(c))
    }

    /// A single that the model holds as a double.
    fn single(&mut self, value: &mut f64) -> Result<()> {
        let mut single = *value as f32;
        self.f32(&mut single)?;
        *value = f64::from(single);
        Ok(())
    }

    /// A signed integer of 32 bits.
    fn signed_32(&mut self, what: &'static str, value: &mut i32) -> Result<()> {
        let mut wide = i64::from(*value);
        self.signed(&mut wide)?;
        *value = i32::try_from(wide)
            .map_err(|_| self.corrupt(format!("{what} is {wide}, beyond 32 bits")))?;
        Ok(())
    }

    /// A text of at most `limit` bytes of UTF-8: its length, then its bytes.
    fn text(&mut self, what: &'static str, value: &mut String, limit: u32) -> Result<()> {
        let mut bytes = std::mem::take(value).into_bytes();
        let mut n = bytes.len() as u32;
        self.bounded(what, &mut n, limit)?;
        bytes.resize(n as usize, 0);
        for byte in &mut bytes {
            let mut wide = u32::from(*byte);
            self.bounded(what, &mut wide, u32::from(u8::MAX))?;
            *byte = wide as u8;
        }
        *value = String::from_utf8(bytes)
            .map_err(|e| self.corrupt(format!("{what} is no UTF-8: {}", e.utf8_error())))?;
        Ok(())
    }

    /// A positive integer of at most `limit`, or zero for none.
    fn optional(&mut self, what: &'static str, value: &mut Option<u32>, limit: u32) -> Result<()> {
        let mut number = value.unwrap_or(0);
        self.bounded(what, &mut number, limit)?;
        *value = (number > 0).then_some(number);
        Ok(())
    }
}

/// Appends fields to the bytes of a header.
#[derive(Debug, Default)]
pub(crate) struct FieldWriter {
    pub bytes: ByteWriter,
}

impl Fields for FieldWriter {
    fn varint(&mut self, value: &mut u64) -> Result<()> {
        self.bytes.varint(*value);
        Ok(())
    }

    fn signed(&mut self, value: &mut i64) -> Result<()> {
        self.bytes.signed_varint(*value);
        Ok(())
    }

    fn f64(&mut self, value: &mut f64) -> Result<()> {
        self.bytes.f64(*value);
        Ok(())
    }

    fn f32(&mut self, value: &mut f32) -> Result<()> {
        self.bytes.f32(*value);
        Ok(())
    }

    fn bounded(&mut self, _: &'static str, value: &mut u32, _: u32) -> Result<()> {
        self.bytes.varint(u64::from(*value));
        Ok(())
    }

    fn count(&mut self, _: &'static str, value: &mut u64, _: u64) -> Result<()> {
        self.varint(value)
    }

    fn list<T: Default>(
        &mut self,
        _: &'static str,
        values: &mut Vec<T>,
        _: usize,
        mut item: impl FnMut(&mut Self, &mut T) -> Result<()>,
    ) -> Result<()> {
        self.bytes.varint(values.len() as u64);
        values.iter_mut().try_for_each(|value| item(self, value))
    }

    fn corrupt(&self, what: String) -> Error {
        Error::corrupt(META, self.bytes.len(), what)
    }
}

/// Reads the fields of a header, none of which is trusted.
#[derive(Debug)]
pub(crate) struct FieldReader<'a> {
    bytes: ByteReader<'a>,
    limits: Limits,
}

impl<'a> FieldReader<'a> {
    pub fn new(bytes: &'a [u8], limits: Limits) -> Self {
        Self { bytes: ByteReader::new(META, bytes), limits }
    }

    /// Checks that nothing follows the last field.
    pub fn finish(self) -> Result<()> {
        self.bytes.finish()
    }
}

impl Fields for FieldReader<'_> {
    fn varint(&mut self, value: &mut u64) -> Result<()> {
        *value = self.bytes.varint()?;
        Ok(())
    }

    fn signed(&mut self, value: &mut i64) -> Result<()> {
        *value = self.bytes.signed_varint()?;
        Ok(())
    }

    fn f64(&mut self, value: &mut f64) -> Result<()> {
        *value = self.bytes.f64()?;
        Ok(())
    }

    fn f32(&mut self, value: &mut f32) -> Result<()> {
        *value = self.bytes.f32()?;
        Ok(())
    }

    fn bounded(&mut self, what: &'static str, value: &mut u32, limit: u32) -> Result<()> {
        // At most `limit`, which has 32 bits.
        *value = self.bytes.bounded(what, u64::from(limit))? as u32;
        Ok(())
    }

    fn count(&mut self, what: &'static str, value: &mut u64, bytes_each: u64) -> Result<()> {
        *value = self.bytes.varint()?;
        self.limits.check(what, *value, bytes_each).map(|_| ())
    }

    fn list<T: Default>(
        &mut self,
        what: &'static str,
        values: &mut Vec<T>,
        bytes_each: usize,
        mut item: impl FnMut(&mut Self, &mut T) -> Result<()>,
    ) -> Result<()> {
        // Bounded by the bytes that remain, so allocated at once.
        let n = self.bytes.count(what, bytes_each)?;
        values.clear();
        values.resize_with(n, T::default);
        values.iter_mut().try_for_each(|value| item(self, value))
    }

    fn corrupt(&self, what: String) -> Error {
        self.bytes.corrupt(what)
    }
}
