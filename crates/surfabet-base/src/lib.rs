//! What all crates of surfabet share: a wrong parameter, progress and the wish to stop.

mod parameter;
mod progress;

pub use parameter::InvalidParameter;
pub use progress::{Cancelled, Meter, Part, Progress, Silent};
