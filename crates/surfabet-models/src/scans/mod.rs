//! Shared by the two alphabets: the scene that words are learned from, the deviation allowed at each of its points
//! (eq. 13), and the upright frame of a feature (III-C).
//!
//! M. Ruhnke, B. Steder, G. Grisetti, W. Burgard: Unsupervised Learning of Compact 3D Models Based on the Detection
//! of Recurrent Structures, ICRA 2010.

mod deviation;
mod scene;
mod upright;

pub use deviation::Deviation;
pub use scene::Scene;
pub use upright::{Upright, upright_frame};
