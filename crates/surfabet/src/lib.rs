//! Compact 3D models of point clouds, learned from what recurs in them.
pub use surfabet_geom as geom;
pub use surfabet_sparse as sparse;
