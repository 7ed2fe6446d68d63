//! Patches in integers, and the streams of a file.

mod colors;
mod masks;
mod poses;
mod sizes;
mod stored;
mod syntax;

pub use stored::{DIRECTIONS, MAX_COORDINATE, PARTS, StoredPatch};
pub(super) use syntax::Streams;
