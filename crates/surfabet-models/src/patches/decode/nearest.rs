//! The patch nearest to a point beside the patches, and what the point has of it: the normal where it is nearest.

use surfabet_geom::KdTree;

use super::normal;
use crate::error::Result;
use crate::patches::instances::Motion;
use crate::patches::model::Lattice;
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::{Basis, DEGREES, N_SHAPES, derivative, value};
use crate::patches::surface::leaf::Leaf;

/// The set finest pixels of some patches, some of them moved.
pub(super) struct NearestPatch<'a> {
    lattice: Lattice,
    /// The patch of each pixel, and its motion.
    leaves: Vec<(&'a Leaf, Option<&'a Motion>)>,
    /// Middles of the pixels where they are coded, before any motion.
    middles: Vec<[f32; 3]>,
    tree: Option<KdTree>,
}

impl<'a> NearestPatch<'a> {
    pub fn new(
        lattice: Lattice,
        patches: impl Iterator<Item = (&'a Leaf, Option<&'a Motion>)>,
    ) -> Result<Self> {
        let bases = Basis::of_levels(lattice.levels);
        let (mut leaves, mut middles, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for (leaf, motion) in patches {
            middles.extend(leaf.pixels(&lattice, &bases));
            leaves.resize(middles.len(), (leaf, motion));
            let of = |&p: &[f32; 3]| motion.map_or(p, |motion| motion.of_position(p));
            places.extend(middles[places.len()..].iter().map(of));
        }
        let tree = if places.is_empty() { None } else { Some(KdTree::new(&places)?) };
        Ok(Self { lattice, leaves, middles, tree })
    }

    /// Where a position (pixels) has its attributes from: itself, or the place that it is moved from where the nearest patch is
    /// an instance's.
    pub fn source_of(&self, position: [f32; 3]) -> [f32; 3] {
        let nearest = self.tree.as_ref().and_then(|tree| tree.nearest(position));
        let motion = nearest.and_then(|nearest| self.leaves[nearest.index()].1);
        motion.map_or(position, |motion| motion.source_of(position))
    }

    /// Unit normal of the surface at the pixel nearest to a position (pixels); zero without patches.
    pub fn normal(&self, position: [f32; 3]) -> [f32; 3] {
        let Some(nearest) = self.tree.as_ref().and_then(|tree| tree.nearest(position)) else {
            return [0.0; 3];
        };
        let (leaf, motion) = self.leaves[nearest.index()];
        let normal = self.coded_normal(leaf, self.middles[nearest.index()]);
        motion.map_or(normal, |motion| motion.of_direction(normal))
    }

    /// Unit normal of a patch where it is coded, at the middle of one of its pixels.
    fn coded_normal(&self, leaf: &Leaf, middle: [f32; 3]) -> [f32; 3] {
        let [_, u, v] = axes_of(leaf.side);
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
