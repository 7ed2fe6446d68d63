//! What all crates of surfabet share: a wrong parameter, progress and the wish to stop, parallel loops, rounding.

pub mod parallel;
mod parameter;
mod partition;
mod progress;
pub mod rounding;

pub use parameter::InvalidParameter;
pub use partition::Partition;
pub use progress::{Cancelled, Meter, Part, Progress, Silent};
