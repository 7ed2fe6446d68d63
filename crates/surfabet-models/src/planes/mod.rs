//! Planes: a cloud as planar patches with tiles, by EM with split and merge.
//!
//! R. Lakaemper, L. J. Latecki: *Extended EM for Planar Approximation of 3D Data*, ICRA 2006. A cloud runs through
//! the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn | |
//! | `points` | distinct points along a curve, in a tree of boxes | |
//! | `seed` | patches to start from and to add | II-B, III |
//! | `patch`, `tiles` | a plane, a rectangle, supported tiles and the distance to them | II-A, figure 1 |
//! | `e_step` | probabilities of points for patches within reach | II-A, eq. 1 and 2 |
//! | `m_step` | weighted orthogonal regression | II-A |
//! | `grid_size` | G | II-E |
//! | `trim` | rectangles and supported tiles, T | II-A, figures 2 and 3 |
//! | `split` | unevenly supported patches | II-C |
//! | `merge` | similar patches | II-D |
//! | `surface` | no patches through clutter, across corners or along something bent | |
//! | `fit` | the steps in turn until stable | II-B |
//! | `learn` | all of it | |
//! | `model`, `syntax` | the result, in the integers that a file stores; points of any cloud on their patches | III |
//! | `decode` | back to a cloud at any spacing | |
//! | `outline` | polygons and triangles of the supported area | |
//! | `classical` | EM with infinite planes, to compare with | II, figure 4 |

mod classical;
mod contract;
mod decode;
mod e_step;
mod fit;
mod grid_size;
mod learn;
mod m_step;
mod merge;
mod model;
mod options;
mod outline;
mod patch;
mod points;
mod seed;
mod split;
mod surface;
mod syntax;
mod tiles;
mod trim;

pub use classical::{PlaneFit, fit_planes, random_planes};
pub use e_step::{Responsibilities, weight_scale};
pub use fit::{Fit, Iteration, Trace};
pub use learn::{PlanesFigures, PlanesReport, learn};
pub use model::{
    DIRECTIONS, MAX_COORDINATE, MAX_DOUBLINGS, MAX_EXPONENT, MAX_MODEL_TILES, MAX_PATCH_TILES,
    NORMAL_BITS, PARTS, PlaneModel, PlanesHeader, StoredPatch,
};
pub use options::{MAX_PATCHES, PlanesOptions};
pub use outline::PlaneMesh;
pub use patch::{Frame, Patch};
pub use points::Points;
pub use tiles::Tiles;
