//! Encoding of words and occurrences.

pub(super) mod coarse_cells;
pub(super) mod occurrences;
mod plane_prediction;
