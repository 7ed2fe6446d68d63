//! Sparse-coded surface patches: local depth and colour images, described with few dictionary entries each.
//!
//! One level is the Sparse Coded Surface Model (SCSM), several are the Hierarchical one (HSCSM) of M. Ruhnke,
//! L. Bo, D. Fox, W. Burgard: *Hierarchical Sparse Coded Surface Models*, ICRA 2014. A cloud runs through the
//! files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn | |
//! | `samples` | points merged to half a pixel, with their moments | III-A, the sub-sampled cloud P' |
//! | `frame` | pose of a patch: normal and two global axes | III-A |
//! | `field`, `cells` | what a patch at some place would cover | III-A |
//! | `placement` | where patches go, and which patch owns which sample | III-A |
//! | `images` | depth, colour and bitmask of a patch | III, fig. 2 |
//! | `dictionary` | wK-SVD per channel, sparse codes | III-B, eq. 1 |
//! | `order` | patches along a space-filling curve | |
//! | `coding` | a model as binary decisions: written, read and priced | |
//! | `model` | the result, in the integers that a file stores | III |
//! | `decode` | back to a cloud at any spacing | III-B, eq. 2 and 3 |

mod channels;
mod coding;
mod contract;
mod decode;
mod frame;
mod learn;
mod model;
mod options;
pub mod order;
mod placement;
mod samples;

pub use channels::dictionary::{HscsmDictionary, LevelDictionary, QuantizedDictionary};
pub use frame::{Frame, PatchPose};
pub use learn::{encode, learn};
pub use model::{
    Channel, Codes, HscsmHeader, HscsmModel, HscsmModelParts, Level, LevelHeader, MAX_ENTRIES,
    MAX_POSITION, MAX_SPARSITY, Steps,
};
pub use options::{HscsmOptions, MAX_LEVELS, Placement};
