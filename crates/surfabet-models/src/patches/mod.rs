//! Patches on a lattice: surfaces of least Lagrangian cost, with thickness, colour and other attributes.
//!
//! The frames of all patches follow the scene's own three axes and share one pixel lattice, so that a pose is a
//! tile and a depth, every point of the surface belongs to one patch, and neighbours meet without gaps. How finely a
//! sheet of surface is split, which pixels are set, which shapes make its depth, how thick the scan was: the choice is
//! what costs least, bits weighed against squared error. The method is described in `docs/methods/patches.md`. A cloud
//! runs through the files of this folder in this order:
//!
//! | file or folder | step | section |
//! |---|---|---|
//! | `options`, `constants` | what to learn | |
//! | `learn` | the list of steps | |
//! | `axes` | the scene's own axes | 1 |
//! | `samples` | points merged to half a pixel, each with the side it faces | 2 |
//! | `sheets` | samples of a side as height fields over tiles | 3 |
//! | `surface` | the shapes, in integers; patches with their places | 4 |
//! | `choice` | hierarchy, masks, shapes and thickness of least cost, round after round | 5 |
//! | `coding` | the geometry as binary decisions, given the neighbours; points beside the patches | 6, 8 |
//! | `supported` | only as much surface as lies near the input, where that is asked for | |
//! | `attributes` | colour, scalars and labels on the cells around the surface | 7 |
//! | `instances` | parts of the model once more, moved to where the scene shows the same again | 11 |
//! | `recurrence` | what recurs in the scene: patches that are left out where others, moved, give the same surface | 11 |
//! | `far_points`, `cover` | points beside the patches, for what these leave out | 8 |
//! | `whole` | the model with the points beside its patches, with instances or without | 11 |
//! | `model`, `contract` | the result | |
//! | `decode` | back to a cloud, as a surface or as measured, whole or within a box | 9 |
//! | `tiles` | scenes in parts that are learned one by one | 10 |
//!
//! Level 0 is the coarsest. Squares, masks and depths are counted in pixels of the finest level.

mod attributes;
mod axes;
mod choice;
mod coding;
mod constants;
mod contract;
mod cover;
mod decode;
mod far_points;
mod instances;
mod learn;
mod model;
mod options;
mod recurrence;
mod samples;
mod sheets;
mod supported;
mod surface;
mod tiles;
mod whole;

pub use attributes::borders::Border;
pub use attributes::color::ColorSteps;
#[cfg(feature = "trace")]
#[doc(hidden)]
pub use attributes::field_decisions;
pub use attributes::{
    AttributeContent, AttributeHeader, FieldCoding, INTENSITIES, MAX_ATTRIBUTES, MAX_LABELS,
    MAX_NAME,
};
pub use axes::Orientation;
pub use coding::PointCoding;
pub use decode::ScanColumns;
pub use instances::{Instance, Instances, MAX_INSTANCES, Motion, Place};
pub use learn::{PatchesFigures, PatchesReport, learn};
pub use model::{
    Lattice, LatticePatch, LevelSize, MAX_LEVELS, PATCH_PIXELS, PatchModel, PatchesHeader,
    SheetTree, Square,
};
pub use options::PatchesOptions;
pub use surface::leaf::Leaf;
pub use tiles::{
    AttributeRange, Cubes, KeptSheets, Known, MAX_DETAILS, Recipe, TilePlan, TileTask, Views,
    learn_details, learn_tile, plan,
};
