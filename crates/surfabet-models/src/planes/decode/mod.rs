//! From a model to points, polygons and triangles.

mod cloud;
mod mesh;
mod outline;

pub use mesh::PlaneMesh;
