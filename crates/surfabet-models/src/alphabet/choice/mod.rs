//! Which candidates become occurrences.

pub(super) mod cover;
