//! Ground floor of surfabet: point clouds and what can be asked of them.
//!
//! Everything here knows geometry and no model. Positions are `f32` offsets from an `f64` origin, so that
//! georeferenced coordinates keep their millimetres while the work stays in single precision; sums are
//! accumulated in `f64`.

mod cloud;
mod error;
pub mod octahedral;
mod progress;

pub use cloud::{CloudParts, DroppedValues, PointCloud, Viewpoints};
pub use error::{Error, Result};
pub use progress::{Cancelled, Progress, Silent};
