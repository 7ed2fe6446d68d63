//! The box that a model decodes to.

use crate::patches::model::{Lattice, PatchModel};
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{DEGREES, N_SHAPES};
use crate::patches::surface::leaf::Leaf;

/// What rounding to single precision may move a decoded point by, finest pixels: at 4 km with pixels of 1 cm a tenth of one.
pub const ROUNDING: f64 = 0.25;

/// Largest value of a factor of a shape over the square: of the constant, the tilt, and the cosines.
fn largest(degree: u8) -> f64 {
    match degree {
        0 => 1.0,
        1 => 3.0_f64.sqrt(),
        _ => 2.0_f64.sqrt(),
    }
}

impl Leaf {
    /// A box around all that the patch decodes to but for rounding, in finest pixels along the axes of the lattice.
    pub(in crate::patches) fn bounds(&self, lattice: &Lattice) -> [[f64; 3]; 2] {
        let [d, u, v] = axes_of(self.side);
        let step = f64::from(lattice.depth_step) / 16.0;
        let c = |k: usize| f64::from(self.patch.coefficients[k]) * step;
        let shape = |k: usize| largest(DEGREES[k].0) * largest(DEGREES[k].1);
        let swing: f64 = (1..N_SHAPES).map(|k| c(k).abs() * shape(k)).sum();
        let half = f64::from(self.patch.half_thickness()) + swing;
        let width = f64::from(lattice.patch_width(self.level));
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        (low[d], high[d]) = (c(0) - half, c(0) + half);
        for (axis, corner) in [u, v].into_iter().zip(self.corner) {
            (low[axis], high[axis]) = (f64::from(corner), f64::from(corner) + width);
        }
        [low, high]
    }
}

impl PatchModel {
    /// A box around all that the model codes (a tile has no instances), with what rounding may add on all sides, in finest pixels along the axes of the
    /// lattice; `None` where it decodes to nothing.
    pub fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let lattice = self.lattice();
        let patches = self.leaves().iter().map(|leaf| leaf.bounds(&lattice));
        let beside = self.points().into_iter().map(|p| {
            let pixel = p.map(|c| f64::from(c) / lattice.pixel_size);
            [pixel, pixel]
        });
        let all = patches.chain(beside).reduce(|a, b| {
            [
                std::array::from_fn(|i| a[0][i].min(b[0][i])),
                std::array::from_fn(|i| a[1][i].max(b[1][i])),
            ]
        });
        all.map(|[low, high]| [low.map(|c| c - ROUNDING), high.map(|c| c + ROUNDING)])
    }
}
