//! A patch with its place.

use crate::patches::model::{LatticePatch, PATCH_PIXELS, THICKNESS_STEPS};
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{Basis, FRACTION};

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
    pub(in crate::patches) fn width(&self) -> i32 {
        PATCH_PIXELS << self.level
    }

    /// Whether the finest pixel at a column and row of the patch belongs to its surface.
    pub(in crate::patches) fn is_set(&self, column: i32, row: i32) -> bool {
        let cell = PATCH_PIXELS * (row >> self.level) + (column >> self.level);
        self.patch.mask >> cell & 1 != 0
    }

    /// Number of finest pixels that belong to its surface.
    pub(in crate::patches) fn area(&self) -> u32 {
        self.patch.mask.count_ones() << (2 * self.level)
    }

    /// Set finest pixels as columns and rows of the patch, each with its depth in steps of thickness.
    pub(in crate::patches) fn depths(
        &self,
        basis: &Basis,
        depth_step: u32,
    ) -> impl Iterator<Item = ([i32; 2], i64)> {
        let width = self.width();
        let all = (0..width * width).map(move |i| [i % width, i / width]);
        all.filter(|&[column, row]| self.is_set(column, row)).map(move |at| {
            let steps = basis.depth(&self.patch.coefficients, at.map(|c| 2 * c as usize + 1));
            // Sixteenths of a pixel with fraction to quarters.
            (at, (steps * i64::from(depth_step)) >> (FRACTION + 2))
        })
    }

    /// Middles of the set finest pixels on the surface, in pixels of the lattice.
    pub(in crate::patches) fn pixels(
        &self,
        basis: &Basis,
        depth_step: u32,
    ) -> impl Iterator<Item = [f32; 3]> {
        let [d, u, v] = axes_of(self.side);
        self.depths(basis, depth_step).map(move |([column, row], depth)| {
            let mut p = [0.0; 3];
            p[d] = depth as f32 / f32::from(THICKNESS_STEPS);
            p[u] = (self.corner[0] + column) as f32 + 0.5;
            p[v] = (self.corner[1] + row) as f32 + 0.5;
            p
        })
    }
}
