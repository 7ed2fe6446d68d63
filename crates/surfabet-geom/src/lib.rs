//! Ground floor of surfabet: point clouds and what can be asked of them.
//!
//! Everything here knows geometry and no model. Positions are `f32` offsets from an `f64` origin, so that
//! georeferenced coordinates keep their millimetres while the work stays in single precision; sums are
//! accumulated in `f64`.

mod attribute;
mod box_tree;
mod boxes;
mod bricks;
pub mod cells;
mod changes;
mod cloud;
pub mod disjoint;
mod dtype;
mod error;
mod kdtree;
mod metrics;
mod moments;
pub mod morton;
mod normals;
pub mod octahedral;
mod octree;
mod pose;
mod range_image;
mod reduce;
mod sight;
mod survey;
pub mod vector;
mod voxel_grid;

pub use attribute::{Column, Extra, RESERVED_NAMES};
pub use box_tree::{BoxTree, Union, arrange, boxes_of};
pub use boxes::Aabb;
pub use bricks::{BRICK_HALF, BrickRun, Bricks, InBricks, positions_of_records};
pub use changes::{Change, Changes, Fate, Other, changes};
pub use cloud::{CloudParts, DroppedValues, LARGEST_UNSHIFTED, PointCloud, Viewpoints};
pub use dtype::Dtype;
pub use error::{Error, Result};
pub use kdtree::{KdTree, Neighbor, Neighborhoods};
pub use metrics::{AttributeErrors, DirectedErrors, EvaluateOptions, Quality, Tolerance, evaluate};
pub use moments::{FittedPlane, Moments, PrincipalAxes};
pub use normals::{Neighborhood, Normals, estimate_normals, fit_normal, orient_normal};
pub use octree::Octree;
pub use pose::Pose;
pub use range_image::{Projection, RangeImage};
pub use reduce::{farthest_points, octree_with, random_points, voxel_grid_with};
pub use sight::{Met, Sight};
pub use surfabet_base::{Cancelled, InvalidParameter, Part, Progress, Silent};
pub use survey::{Survey, estimate_noise, has_facings};
pub use voxel_grid::VoxelGrid;
