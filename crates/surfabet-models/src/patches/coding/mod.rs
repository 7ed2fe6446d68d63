//! A model's geometry as binary decisions: one function for writing, reading and pricing.
//!
//! | file | what is coded |
//! |---|---|
//! | `geometry` | sides, tiles, sheets and their hierarchies of squares |
//! | `patch` | masks, depths and thicknesses of patches |
//! | `surroundings` | what patches coded before predict |
//! | `models` | every adaptive model of these, by context |
//! | `point_patterns` | points that no patch is near enough to, given the pattern of those around |
//! | `near_points` | the same given fewer of those around, in files of an earlier kind |
//! | `points` | the same one by one, in files of a still earlier kind |
//! | `levels` | the octree of these two, level by level |
//!
//! Colour has a folder of its own.

mod geometry;
mod levels;
mod models;
pub(in crate::patches) mod near_points;
mod patch;
pub(in crate::patches) mod point_patterns;
pub(in crate::patches) mod points;
mod surroundings;

/// How points beside the patches are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PointCoding {
    /// One by one: as in files of an earlier kind.
    #[default]
    Alone,
    /// Given some of the cells around: as in files of a later kind.
    Around,
    /// Given the pattern of the cells around.
    Patterns,
}

pub(in crate::patches) use geometry::{Geometry, MAX_SHEETS, code_geometry, first_depth};
pub(in crate::patches) use models::{
    GeometryModels, SET, UNKNOWN, beside_context, depth_context, pixel_context, shape_context,
    split_context,
};
