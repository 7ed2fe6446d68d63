//! The surface of a model: its shapes, and patches with their places.

pub(in crate::patches) mod basis;
pub(in crate::patches) mod leaf;
