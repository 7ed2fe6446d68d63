//! Alphabets of local scans: recurrent surface pieces ("words") and where they stand in the scene.
//!
//! M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on the Detection
//! of Recurrent Structures, ICRA 2010.

pub mod bic;
mod frame;
pub mod mdl;
mod scene;

pub use frame::{Upright, upright_frame};
pub use scene::{Deviation, Scene};
