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
//! | `fit` | the steps below in turn until stable: SMEMPF | II-B |
//! | `fit/seed` | patches to start from and to add: random, or where cells are flat | II-B, III |
//! | `patch`, `tiles` | a plane, a rectangle, supported tiles and the distance to them | II-A, figure 1 |
//! | `fit/e_step` | probabilities of points for patches within reach | II-A, eq. 1 and 2 |
//! | `fit/responsibilities` | these by point and by patch, and the support sets | II-A |
//! | `fit/incidence` | noise by the angle at which a surface was seen | added |
//! | `fit/m_step` | weighted orthogonal regression | II-A |
//! | `fit/grid_size` | the grid size G | II-E |
//! | `fit/trim` | rectangles and supported tiles, T | II-A, figures 2 and 3 |
//! | `fit/split` | two patches of one that is unevenly supported or folded | II-C |
//! | `fit/merge` | one patch of similar ones | II-D |
//! | `fit/likelihood` | planes and outlines together where noise mixes surfaces | added |
//! | `fit/published` | the method as printed, without what was added | II |
//! | `fit/removal` | patches that the others explain as well | added |
//! | `fit/surface` | the probability that a patch is a surface: none through clutter, across corners, along something bent | added |
//! | `coding/round`, `coding/stored` | patches in the integers of the file, labels, colours | III |
//! | `model` | the result; points of any cloud on its patches | III |
//! | `coding/syntax` and beside it | the streams of the file | |
//! | `decode/cloud` | back to a cloud at any spacing | |
//! | `decode/outline`, `decode/mesh` | polygons around the supported area, and its triangles | |
//! | `contract` | what planes have in common with the other methods | |
//! | `constants` | the tuned constants | |
//! | `classical` | EM with infinite planes, to compare with | II, figure 4 |

mod classical;
mod coding;
mod constants;
mod contract;
mod decode;
mod fit;
mod learn;
mod model;
mod options;
mod patch;
mod points;
mod tiles;

pub use classical::{PlaneFit, fit_planes, random_planes};
pub use coding::{DIRECTIONS, MAX_COORDINATE, PARTS, StoredPatch};
pub use constants::FIGURES;
pub use decode::PlaneMesh;
pub use fit::{Candidate, Fit, Iteration, Regression, Responsibilities, Trace, weight_scale};
pub use learn::{Candidates, PlanesFigures, PlanesReport, candidates, learn};
pub use model::{MAX_MODEL_TILES, PlaneModel, PlanesHeader};
pub use options::{MAX_PATCHES, PlanesOptions};
pub use patch::{Frame, Patch};
pub use points::Points;
pub use tiles::Tiles;
