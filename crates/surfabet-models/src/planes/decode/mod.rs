//! From a model to points, polygons and triangles.

mod cloud;
mod outline;

pub use outline::PlaneMesh;
