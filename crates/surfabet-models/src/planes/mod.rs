//! Planes: a cloud as planar patches with tiles, by EM with split and merge.
//!
//! R. Lakaemper, L. J. Latecki: *Extended EM for Planar Approximation of 3D Data*, ICRA 2006. A cloud runs through
//! the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn | |
//! | `learn` | the list of steps | |
//! | `points` | distinct points along a curve, in a tree of boxes | |
//! | `learn/seed` | patches to start from and to add | II-B, III |
//! | `patch`, `tiles` | a plane, a rectangle, supported tiles and the distance to them | II-A, figure 1 |
//! | `learn/fit` | the steps below in turn until stable | II-B |
//! | `learn/e_step` | probabilities of points for patches within reach | II-A, eq. 1 and 2 |
//! | `learn/m_step` | weighted orthogonal regression | II-A |
//! | `learn/grid_size` | G | II-E |
//! | `learn/trim` | rectangles and supported tiles, T | II-A, figures 2 and 3 |
//! | `learn/split` | unevenly supported patches | II-C |
//! | `learn/merge` | similar patches | II-D |
//! | `learn/surface` | no patches through clutter, across corners or along something bent | |
//! | `model` | the result, in the integers that a file stores; points of any cloud on their patches | III |
//! | `coding/syntax` | the streams of the file | |
//! | `decode/cloud` | back to a cloud at any spacing | |
//! | `decode/outline` | polygons and triangles of the supported area | |
//! | `contract` | the model as one among those of other methods | |
//! | `classical` | EM with infinite planes, to compare with | II, figure 4 |

mod classical;
mod coding;
mod constants;
mod contract;
mod decode;
mod learn;
mod model;
mod options;
mod patch;
mod points;
mod tiles;

pub use classical::{PlaneFit, fit_planes, random_planes};
pub use coding::{DIRECTIONS, MAX_COORDINATE, PARTS, StoredPatch};
pub use decode::PlaneMesh;
pub use learn::{
    Fit, Iteration, PlanesFigures, PlanesReport, Responsibilities, Trace, learn, weight_scale,
};
pub use model::{MAX_MODEL_TILES, PlaneModel, PlanesHeader};
pub use options::{MAX_PATCHES, PlanesOptions};
pub use patch::{Frame, Patch};
pub use points::Points;
pub use tiles::Tiles;
