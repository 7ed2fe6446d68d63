//! What a neuron keeps besides its position.
//!
//! | file | computes |
//! |---|---|
//! | `statistics` | number of points, colour, intensity, normal, radius and thickness |
//! | `orient` | the side that normals point to |

mod orient;
mod statistics;

pub(super) use statistics::{Known, Observed, Statistics, describe};
