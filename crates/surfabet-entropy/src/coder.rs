//! What writes, reads or only prices a stream of binary decisions.
//!
//! A syntax is written down once, as a function over a [`Coder`]: every verb takes the value to write and gives
//! back the value that stands in the stream. A writer gives back what it was given, a reader ignores what it was
//! given, [`Price`] writes nothing and adds up what the stream would take. So writer, reader and rate-distortion
//! choice cannot disagree.

use std::convert::Infallible;

use crate::models::{Bit, SInt, Symbols, UInt};

/// One end of a stream of binary decisions.
pub trait Coder {
    /// What can go wrong; nothing for a writer.
    type Error;

    /// A decision with an adaptive probability, which adapts.
    fn bit(&mut self, model: &mut Bit, value: bool) -> Result<bool, Self::Error>;

    /// The low `n_bits` of `value`, at most 64, each at the price of one bit; higher bits are ignored.
    fn bypass(&mut self, value: u64, n_bits: u32) -> Result<u64, Self::Error>;

    /// An error at the place reached, for what was read does not fit.
    fn corrupt(&self, what: String) -> Self::Error;

    /// An unsigned integer.
    fn uint(&mut self, model: &mut UInt, value: u32) -> Result<u32, Self::Error>
    where
        Self: Sized,
    {
        model.code(self, value)
    }

    /// A signed integer.
    fn sint(&mut self, model: &mut SInt, value: i32) -> Result<i32, Self::Error>
    where
        Self: Sized,
    {
        model.code(self, value)
    }

    /// A symbol below the size of the model's alphabet.
    fn symbol(&mut self, model: &mut Symbols, value: u32) -> Result<u32, Self::Error>
    where
        Self: Sized,
    {
        model.code(self, value)
    }
}

/// Adds up what a stream would take, adapting the models on the way.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Price {
    /// Bits so far.
    pub bits: f64,
}

impl Coder for Price {
    type Error = Infallible;

    #[inline]
    fn bit(&mut self, model: &mut Bit, value: bool) -> Result<bool, Infallible> {
        self.bits += f64::from(model.cost(value));
        model.update(value);
        Ok(value)
    }

    #[inline]
    fn bypass(&mut self, value: u64, n_bits: u32) -> Result<u64, Infallible> {
        self.bits += f64::from(n_bits.min(u64::BITS));
        Ok(if n_bits >= u64::BITS { value } else { value & ((1 << n_bits) - 1) })
    }

    fn corrupt(&self, what: String) -> Infallible {
        unreachable!("a price is asked of values that fit, not of: {what}")
    }
}
