//! Patches on a lattice: surfaces of least Lagrangian cost, with thickness and colour.
//!
//! The frames of all patches follow the scene's own three axes and share one pixel lattice, so that a pose is a
//! tile and a depth, every point of the surface belongs to one patch, and neighbours meet without gaps. What is
//! said of a sheet of surface - how finely it is split, which pixels are set, which shapes make its depth, how
//! thick the scan was - is what costs least, bits weighed against squared error. A cloud runs through the files
//! of this folder in this order:
//!
//! | file | step |
//! |---|---|
//! | `options` | what to learn |
//! | `axes` | the scene's own axes |
//! | `samples` | points merged to half a pixel, each with the side it faces |
//! | `sheets` | samples of a side as height fields over tiles |
//! | `choice` | hierarchy, masks, shapes and thickness of least cost |
//! | `basis` | the shapes, in integers |
//! | `surroundings`, `syntax` | how all that is said in binary decisions, given the neighbours |
//! | `nodes`, `targets`, `color` | colour on the cells around the surface |
//! | `points` | points that no patch is near enough to |
//! | `model`, `leaves` | the result |
//! | `fragments` | which patches are noise that stands off a surface |
//! | `decode` | back to a cloud, as a surface or as measured |

mod axes;
mod choice;
mod coding;
mod color;
mod contract;
mod decode;
mod learn;
mod model;
mod options;
mod samples;
mod sheets;
mod surface;

pub use axes::Orientation;
pub use color::ColorSteps;
pub use learn::learn;
pub use model::{
    Lattice, LatticePatch, LevelSize, MAX_LEVELS, Node, PATCH_PIXELS, PatchModel, PatchesHeader,
    Root,
};
pub use options::PatchesOptions;
pub use surface::leaf::Leaf;
