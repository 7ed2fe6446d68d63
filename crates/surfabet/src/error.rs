//! The one error type of this crate.

use std::path::PathBuf;

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong between a cloud and a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A file was read but is not a sound `.sfb` file.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: surfabet_codec::Error,
    },
    /// From the bytes of a model.
    #[error(transparent)]
    Codec(#[from] surfabet_codec::Error),
    /// From learning or decoding.
    #[error(transparent)]
    Model(#[from] surfabet_models::Error),
    /// From geometry.
    #[error(transparent)]
    Geometry(#[from] surfabet_geom::Error),
}
