//! A patch with its place.

use super::model::{LatticePatch, PATCH_PIXELS};

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
    /// Finest pixels per side.
    pub(super) fn width(&self) -> i32 {
        PATCH_PIXELS << self.level
    }

    /// Whether the finest pixel at a column and row of the patch belongs to its surface.
    pub(super) fn is_set(&self, column: i32, row: i32) -> bool {
        let cell = PATCH_PIXELS * (row >> self.level) + (column >> self.level);
        self.patch.mask >> cell & 1 != 0
    }
}
