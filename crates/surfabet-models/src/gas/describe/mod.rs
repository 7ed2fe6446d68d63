//! What a neuron knows besides its position.

mod orient;
pub(crate) mod statistics;
