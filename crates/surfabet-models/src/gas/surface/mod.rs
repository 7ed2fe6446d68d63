//! What the edges tell of the surface.

mod mesh;
mod topology;
