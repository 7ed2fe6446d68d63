//! Encoding of a model: words, occurrences and channels, each by one function that writes, reads and prices.
//!
//! | file | what is coded |
//! |---|---|
//! | `words` | masks and heights of the words |
//! | `occurrences` | an octree over the cells, and the occurrences in them |
//! | `plane_prediction`, `coarse_cells` | the planes of occurrences coded before that go on in a cell |
//! | `channels` | colours and intensities, after those of the nearest occurrence |

mod channels;
mod coarse_cells;
mod occurrences;
mod plane_prediction;
mod words;

#[cfg(test)]
mod tests;

pub(super) use channels::code_channels;
pub(super) use occurrences::{CodingParams, code_occurrences};
pub(super) use words::code_words;
