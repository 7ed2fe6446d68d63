//! Patches in integers, and the streams of a file.

mod masks;
mod poses;
mod round;
mod sizes;
mod stored;
mod syntax;
mod tiles;

pub(super) use round::rounded;
pub use stored::{DIRECTIONS, MAX_COORDINATE, PARTS, StoredPatch};
pub(super) use syntax::Streams;
