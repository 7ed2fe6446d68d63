//! Winner and second winner of a signal (step 3).

pub(crate) mod index;
