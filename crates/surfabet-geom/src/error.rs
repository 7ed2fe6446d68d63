//! The one error type of this crate.

use std::borrow::Cow;

use surfabet_base::{Cancelled, InvalidParameter};

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong in geometry: always a wrong argument, or the caller's own interrupt.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An attribute does not have one value per point.
    #[error("{attribute} has {found} values for {expected} points; give one per point")]
    LengthMismatch {
        /// Name of the attribute.
        attribute: Cow<'static, str>,
        /// How many values it has.
        found: usize,
        /// How many points there are.
        expected: usize,
    },
    /// The operation needs more points than there are.
    #[error("{operation} needs at least {needed} points, the cloud has {found}")]
    TooFewPoints {
        /// What was asked for.
        operation: &'static str,
        /// The least number of points it takes.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// A parameter is outside its domain.
    #[error(transparent)]
    InvalidParameter(#[from] InvalidParameter),
    /// An index points outside the data.
    #[error("{name} {index} is out of range: there are {len}")]
    IndexOutOfRange {
        /// What the index counts.
        name: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        len: usize,
    },
    /// An attribute that the operation needs is missing.
    #[error("{operation} needs {attribute}, which this cloud does not have")]
    MissingAttribute {
        /// What was asked for.
        operation: &'static str,
        /// The attribute it needs.
        attribute: &'static str,
    },
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl Error {
    /// A parameter outside its domain, with its value spelled out.
    pub fn invalid(
        name: &'static str,
        value: impl std::fmt::Display,
        requirement: impl Into<Cow<'static, str>>,
    ) -> Self {
        InvalidParameter::new(name, value, requirement).into()
    }
}
