//! Sparse-coded surface patches: local depth and colour images, described with few dictionary entries each.
//!
//! One level is the Sparse Coded Surface Model (SCSM), several are the Hierarchical one (HSCSM) of M. Ruhnke,
//! L. Bo, D. Fox, W. Burgard: *Hierarchical Sparse Coded Surface Models*, ICRA 2014. A cloud runs through the
//! files of this folder in this order:
//!
//! | file or folder | step | paper |
//! |---|---|---|
//! | `options`, `constants` | what to learn | |
//! | `learn` | the list of steps | |
//! | `samples` | points merged to half a pixel, with their moments | III-A, the sub-sampled cloud P' |
//! | `intensity` | intensities in the place of colours that are not there | |
//! | `frame` | pose of a patch: normal and two global axes | III-A |
//! | `placement` | where patches go, and which patch owns which sample | III-A |
//! | `order` | patches along a space-filling curve | |
//! | `channels` | depth, colour and bitmask of a patch; wK-SVD per channel, sparse codes | III, fig. 2; III-B, eq. 1 |
//! | `model`, `contract` | the result, in the integers that a file stores | III |
//! | `coding` | a model as binary decisions: written, read and priced | |
//! | `decode` | back to a cloud at any spacing | III-B, eq. 2 and 3 |
//!
//! Level 0 is the coarsest.

mod channels;
mod coding;
mod constants;
mod contract;
mod decode;
mod frame;
mod intensity;
mod learn;
mod model;
mod options;
pub mod order;
mod placement;
mod report;
mod samples;

pub use channels::dictionary::{HscsmDictionary, LevelDictionary, QuantizedDictionary};
pub use frame::{Frame, PatchPose};
pub use intensity::IntensityLimits;
pub use learn::{describe, learn};
pub use model::{
    Channel, Codes, HscsmHeader, HscsmModel, HscsmModelParts, Level, LevelHeader, MAX_ENTRIES,
    MAX_MASK_SCALE, MAX_POSITION, MAX_SPARSITY, Steps,
};
pub use options::{HscsmOptions, MAX_LEVELS, Placement};
pub use report::{HscsmFigures, HscsmReport};
