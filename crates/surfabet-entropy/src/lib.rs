//! Adaptive models of bits and integers, with their cost, and the [`Coder`] that streams of them go through.
//!
//! Nothing here knows of files: the range coder that turns decisions into bytes lives with the file format. What
//! decides between two encodings needs only the models and their prices.

mod coder;
mod error;
mod mixing;
mod models;
mod octree;

pub use coder::{Coder, Price};
pub use error::InvalidAlphabet;
pub use mixing::{MixedBits, MixedContext, Mixer};
pub use models::{Bit, Mantissa, PRECISION, SInt, Symbols, UInt};
pub use octree::{Cell, Cells, MortonCode, Octree, Quadtree, Tree};
