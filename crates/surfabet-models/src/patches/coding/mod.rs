//! A model's geometry as binary decisions: one function for writing, reading and pricing.
//!
//! | file | what is coded |
//! |---|---|
//! | `geometry` | sides, tiles, sheets and their hierarchies of squares |
//! | `patch` | masks, depths and thicknesses of patches |
//! | `surroundings` | what patches coded before predict |
//! | `models` | every adaptive model of these, by context |
//! | `points` | points that no patch is near enough to |
//!
//! Colour has a folder of its own.

mod geometry;
mod models;
mod patch;
pub(in crate::patches) mod points;
mod surroundings;

pub(in crate::patches) use geometry::{Geometry, MAX_SHEETS, code_geometry};
pub(in crate::patches) use models::{
    GeometryModels, SET, UNKNOWN, beside_context, depth_context, pixel_context, shape_context,
    split_context,
};
