//! Masked sparse coding: orthogonal matching pursuit and weighted K-SVD.
//!
//! Signals come as rows of values with a weight each: 0 for what was not observed, 1 for what was, or anything
//! in between. [`omp`] finds sparse codes over a given [`Dictionary`], [`ksvd`] learns a dictionary too; both
//! minimise `Σ w (s − D x)²`, which for weights of 0 and 1 is eq. 1 of Ruhnke, Bo, Fox, Burgard: Hierarchical
//! Sparse Coded Surface Models (ICRA 2014). Nothing here knows what the signals are.
//!
//! Results depend on input, options and seed, not on the number of threads.

mod coded;
mod codes;
mod dictionary;
mod error;
mod initial;
mod ksvd;
mod linalg;
mod omp;
mod pursuit;
mod rank_one;
mod signals;
mod swaps;
#[cfg(test)]
mod testing;

pub use codes::{SparseCodes, reconstruct, squared_errors};
pub use dictionary::Dictionary;
pub use error::{Error, Result};
pub use ksvd::{Ksvd, KsvdIteration, KsvdOptions, StopReason, ksvd};
pub use omp::{OmpOptions, Selection, omp};
#[doc(hidden)]
pub use rank_one::leading_atom;
pub use signals::{MAX_MAGNITUDE, Signals};
