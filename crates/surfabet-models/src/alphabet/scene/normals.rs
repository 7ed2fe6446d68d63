//! Normals of the points.

use surfabet_geom::{KdTree, Neighbor, fit_normal, orient_normal};

use crate::alphabet::constants::NORMAL_NEIGHBORS;
use crate::error::Result;

/// Normals of the points of a scene, each estimated when it is asked for: planes start at one point in ten.
pub(in crate::alphabet) struct PointNormals {
    /// Metres.
    positions: Vec<[f32; 3]>,
    tree: KdTree,
}

impl PointNormals {
    /// # Errors
    /// [`crate::Error::Geometry`] for a coordinate that is not finite.
    pub fn new(positions: Vec<[f32; 3]>) -> Result<Self> {
        let tree = KdTree::new(&positions)?;
        Ok(Self { positions, tree })
    }

    /// The unit normal of point `i`, its largest component positive; `None` where its neighbours span no plane.
    pub fn of(&self, i: u32, buffer: &mut Vec<Neighbor>) -> Option<[f32; 3]> {
        let position = self.positions[i as usize];
        self.tree.k_nearest(position, NORMAL_NEIGHBORS, buffer);
        let neighbors = buffer.iter().map(|n| self.positions[n.index()]);
        let (normal, _) = fit_normal(position, neighbors)?;
        Some(orient_normal(normal, position, None))
    }
}
