//! The patches of all hierarchies in a row.

use super::model::{Geometry, LatticePatch, Node, PATCH_PIXELS};

/// A patch with its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leaf {
    /// Twice the depth axis, plus one where the surface faces down that axis.
    pub side: u8,
    /// Level, 0 the finest.
    pub level: u32,
    /// First column and row, in pixels of the finest level.
    pub corner: [i32; 2],
    /// The patch itself.
    pub patch: LatticePatch,
}

impl Leaf {
    /// Whether the finest pixel at a column and row of the patch belongs to its surface.
    pub(super) fn is_set(&self, column: i32, row: i32) -> bool {
        let cell = PATCH_PIXELS * (row >> self.level) + (column >> self.level);
        self.patch.mask >> cell & 1 != 0
    }
}

/// All patches, in the order of the file.
pub(super) fn leaves(geometry: &Geometry) -> Vec<Leaf> {
    let mut found = Vec::new();
    for root in &geometry.roots {
        let corner = root.tile.map(|t| t * geometry.tile_pixels());
        collect(&root.node, root.side, geometry.levels - 1, corner, &mut found);
    }
    found
}

fn collect(node: &Node, side: u8, level: u32, corner: [i32; 2], found: &mut Vec<Leaf>) {
    match node {
        Node::Empty => {}
        Node::Leaf(patch) => found.push(Leaf { side, level, corner, patch: *patch }),
        Node::Split(children) => {
            let half = PATCH_PIXELS << (level - 1);
            for (child, node) in (0..).zip(children.iter()) {
                let at = [corner[0] + (child & 1) * half, corner[1] + (child >> 1) * half];
                collect(node, side, level - 1, at, found);
            }
        }
    }
}
