//! Which words are taken, and where they stand: the candidate's BIC, and what it changes.

pub(crate) mod matching;
pub(crate) mod quality;
pub(crate) mod reconstruction;
pub(crate) mod reduce;
