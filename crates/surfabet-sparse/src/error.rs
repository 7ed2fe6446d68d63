//! The one error type of this crate.

use std::borrow::Cow;

use surfabet_base::{Cancelled, InvalidParameter};

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong in sparse coding: a wrong argument, or the caller's own interrupt.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is outside its domain.
    #[error(transparent)]
    InvalidParameter(#[from] InvalidParameter),
    /// A buffer is not a whole number of rows.
    #[error(
        "{name} hold {found} numbers, which is no multiple of n_features = {n_features}; give \
         n_features numbers per row"
    )]
    RaggedRows {
        /// What the buffer holds.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The length of a row.
        n_features: usize,
    },
    /// There is not one weight per value.
    #[error("{weights} weights for {values} values; give one per value")]
    WeightCount {
        /// How many weights there are.
        weights: usize,
        /// How many values there are.
        values: usize,
    },
    /// Dictionary and signals do not live in the same space.
    #[error("the atoms have {dictionary} features and the signals {signals}; they must agree")]
    FeatureMismatch {
        /// Features of an atom.
        dictionary: usize,
        /// Features of a signal.
        signals: usize,
    },
    /// A number cannot be used.
    #[error(
        "{name} {row} has {value} at feature {feature}, but every number must be {requirement}"
    )]
    InvalidNumber {
        /// What the row is.
        name: &'static str,
        /// Its index.
        row: usize,
        /// Index within the row.
        feature: usize,
        /// The number.
        value: f32,
        /// What it has to satisfy.
        requirement: &'static str,
    },
    /// An atom is not of unit length.
    #[error("atom {atom} has norm {norm}, but atoms must have norm 1 (see Dictionary::normalized)")]
    NotUnit {
        /// Index of the atom.
        atom: usize,
        /// Its Euclidean norm.
        norm: f64,
    },
    /// A code names an atom that the dictionary lacks.
    #[error("code {code} uses atom {atom}, but the dictionary has {n_atoms}")]
    UnknownAtom {
        /// Index of the code.
        code: usize,
        /// The atom it names.
        atom: u32,
        /// How many atoms there are.
        n_atoms: usize,
    },
    /// There is not one code per signal.
    #[error("{codes} codes for {signals} signals; give one per signal")]
    CodeCount {
        /// How many codes there are.
        codes: usize,
        /// How many signals there are.
        signals: usize,
    },
    /// Offsets, atoms and coefficients of codes do not fit together.
    #[error("the codes are inconsistent: {0}")]
    InconsistentCodes(&'static str),
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
