//! The scene rebuilt from occurrences (eq. 2, 3).

mod grid;
pub(crate) mod sparsify;
