//! The one error type of this crate.

/// A size that no alphabet has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("an alphabet of {size} symbols, but 1 to 65536 are possible")]
pub struct InvalidAlphabet {
    /// The size asked for.
    pub size: u32,
}
