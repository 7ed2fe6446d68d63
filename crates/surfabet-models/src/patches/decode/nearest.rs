//! Normals of the points beside the patches: those of the nearest patch, where it is nearest.

use surfabet_geom::KdTree;

use super::normal;
use crate::error::Result;
use crate::patches::model::Lattice;
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{Basis, DEGREES, N_SHAPES, derivative, value};
use crate::patches::surface::leaf::Leaf;

/// The set finest pixels of some patches.
pub(super) struct NearestPatch<'a> {
    lattice: Lattice,
    /// The patch of each pixel.
    leaves: Vec<&'a Leaf>,
    /// Middles of the pixels.
    middles: Vec<[f32; 3]>,
    tree: Option<KdTree>,
}

impl<'a> NearestPatch<'a> {
    pub fn new(lattice: Lattice, patches: &[&'a Leaf]) -> Result<Self> {
        let bases = Basis::of_levels(lattice.levels);
        let (mut leaves, mut middles) = (Vec::new(), Vec::new());
        for &leaf in patches {
            middles.extend(leaf.pixels(&lattice, &bases));
            leaves.resize(middles.len(), leaf);
        }
        let tree = if middles.is_empty() { None } else { Some(KdTree::new(&middles)?) };
        Ok(Self { lattice, leaves, middles, tree })
    }

    /// Unit normal of the surface at the pixel nearest to a position (pixels); zero without patches.
    pub fn normal(&self, position: [f32; 3]) -> [f32; 3] {
        let Some(nearest) = self.tree.as_ref().and_then(|tree| tree.nearest(position)) else {
            return [0.0; 3];
        };
        let leaf = self.leaves[nearest.index()];
        let [_, u, v] = axes_of(leaf.side);
        let middle = self.middles[nearest.index()];
        let width = f64::from(self.lattice.patch_width(leaf.level));
        let along = |at: f32, corner: i32| 2.0 * (f64::from(at) - f64::from(corner)) / width - 1.0;
        let (x, y) = (along(middle[u], leaf.corner[0]), along(middle[v], leaf.corner[1]));
        let mut slope = [0.0; 2];
        for k in (0..N_SHAPES).filter(|&k| leaf.patch.coefficients[k] != 0) {
            let (i, j) = (usize::from(DEGREES[k].0), usize::from(DEGREES[k].1));
            let c = f64::from(leaf.patch.coefficients[k]) * f64::from(self.lattice.depth_step);
            let c = c / 16.0 * 2.0 / width;
            slope[0] += c * derivative(i, x) * value(j, y);
            slope[1] += c * value(i, x) * derivative(j, y);
        }
        normal(leaf.side, slope.map(|c| c as f32))
    }
}
