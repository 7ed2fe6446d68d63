//! The one error type of this crate.

use std::borrow::Cow;

use surfabet_base::{Cancelled, InvalidParameter};

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong when a model is learned or decoded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is outside its domain.
    #[error(transparent)]
    InvalidParameter(#[from] InvalidParameter),
    /// A parameter is of another type.
    #[error("{name} is {value}, but must be {requirement}")]
    InvalidType {
        /// Name of the parameter.
        name: &'static str,
        /// The value given, as text.
        value: String,
        /// What it has to satisfy.
        requirement: Cow<'static, str>,
    },
    /// There is nothing to learn from.
    #[error("the cloud is empty; a model needs at least one point")]
    EmptyCloud,
    /// A gas has no more neurons than its points have places.
    #[error(
        "{neurons} neurons need points at as many places, the cloud has {places}; ask for fewer neurons"
    )]
    TooFewPlaces {
        /// Number of neurons asked for.
        neurons: usize,
        /// Number of distinct points.
        places: usize,
    },
    /// Decoding would produce more points than the caller allows.
    #[error(
        "decoding at {resolution} m gives up to {points} points, more than the limit of {limit}; use a \
         coarser resolution or raise the limit"
    )]
    TooManyPoints {
        /// The spacing asked for, metres.
        resolution: f64,
        /// Upper bound of the points it gives.
        points: u64,
        /// The limit in force.
        limit: u64,
    },
    /// The parts of a model contradict each other.
    #[error("inconsistent model: {0}")]
    Inconsistent(String),
    /// From the geometry below.
    #[error(transparent)]
    Geometry(surfabet_geom::Error),
    /// From the sparse coding below.
    #[error(transparent)]
    Sparse(surfabet_sparse::Error),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

// A cancelled run is [`Error::Cancelled`] whichever layer noticed it, so these two are written out.
impl From<surfabet_geom::Error> for Error {
    fn from(error: surfabet_geom::Error) -> Self {
        match error {
            surfabet_geom::Error::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Geometry(other),
        }
    }
}

impl From<surfabet_sparse::Error> for Error {
    fn from(error: surfabet_sparse::Error) -> Self {
        match error {
            surfabet_sparse::Error::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Sparse(other),
        }
    }
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

/// Refuses what is not a finite number above zero.
pub(crate) fn positive(name: &'static str, value: f64, requirement: &'static str) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::invalid(name, value, requirement))
}

/// Refuses to make up to `points` points at `resolution` metres where that is more than `limit`.
pub(crate) fn check_points(resolution: f64, points: f64, limit: u64) -> Result<()> {
    if points <= limit as f64 {
        return Ok(());
    }
    Err(Error::TooManyPoints { resolution, points: points as u64, limit })
}
