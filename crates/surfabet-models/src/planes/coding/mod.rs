//! The streams of a file.

mod syntax;

pub(super) use syntax::Streams;
