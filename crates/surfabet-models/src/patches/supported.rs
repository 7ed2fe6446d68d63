//! Only as much surface as lies near the input: for `max_error_forward`.

use surfabet_base::parallel;
use surfabet_entropy::Price;
use surfabet_geom::{KdTree, PointCloud, Progress};

use super::coding::{Geometry, GeometryModels, code_geometry};
use super::decode::PatchDecoder;
use super::far_points::limit;
use super::instances::Motion;
use super::model::{Lattice, LatticePatch, SheetTree, Square};
use super::surface::leaf::Leaf;
use crate::error::Result;

/// Takes away what decodes to points further than `bound` from all points of the cloud, as measured or as a surface, at the
/// default spacing.
///
/// # Errors
/// [`crate::Error::InvalidParameter`] for a bound that single precision does not resolve, [`crate::Error::Cancelled`].
pub(super) fn with_support(
    geometry: Geometry,
    lattice: Lattice,
    cloud: &PointCloud,
    bound: f64,
    progress: &dyn Progress,
) -> Result<Geometry> {
    let support = Support::new(lattice, &geometry.leaves, cloud, bound)?;
    drop(geometry.leaves);
    let trees = parallel::try_map(&geometry.sheets, |sheet| -> Result<_> {
        progress.check()?;
        let corner = sheet.tile.map(|t| t * lattice.tile_pixels());
        let root = support.square(&sheet.root, sheet.side, 0, corner);
        let tree = SheetTree { side: sheet.side, tile: sheet.tile, root };
        Ok((tree.root != Square::Empty).then_some(tree))
    })?;
    let trees: Vec<SheetTree> = trees.into_iter().flatten().collect();
    let models = &mut GeometryModels::default();
    let Ok(geometry) = code_geometry(&mut Price::default(), models, lattice, &trees, usize::MAX);
    Ok(geometry)
}

/// What decoded points must be near to.
pub(super) struct Support {
    tree: KdTree,
    /// Largest distance, metres.
    limit: f64,
    lattice: Lattice,
    decoder: PatchDecoder,
}

impl Support {
    /// For patches of a lattice that are to lie within `bound` of a cloud.
    ///
    /// # Errors
    /// As [`with_support`].
    pub fn new(lattice: Lattice, leaves: &[Leaf], cloud: &PointCloud, bound: f64) -> Result<Self> {
        Ok(Self {
            tree: KdTree::new(cloud.positions())?,
            limit: limit(cloud.positions(), bound)?,
            lattice,
            decoder: PatchDecoder::new(lattice, leaves)?,
        })
    }

    /// Whether all that a patch decodes to is near where a motion takes it.
    pub fn holds(&self, leaf: &Leaf, motion: &Motion) -> bool {
        self.decoder.holds(leaf, motion, |p| self.is_near(p))
    }

    fn is_near(&self, p: [f32; 3]) -> bool {
        self.tree.nearest(p).is_some_and(|n| f64::from(n.squared_distance()).sqrt() <= self.limit)
    }

    /// What is left of a square of a level whose first pixel is `corner`.
    fn square(&self, square: &Square, side: u8, level: u32, corner: [i32; 2]) -> Square {
        match square {
            Square::Empty => Square::Empty,
            Square::Patch(patch) => {
                let leaf = Leaf { side, level, corner, patch: **patch };
                self.patch(leaf).map_or(Square::Empty, |left| Square::Patch(Box::new(left)))
            }
            Square::Split(children) => {
                let half = self.lattice.patch_width(level) / 2;
                let left: [Square; 4] = std::array::from_fn(|i| {
                    let at = [i as i32 % 2, i as i32 / 2];
                    let corner = std::array::from_fn(|a| corner[a] + half * at[a]);
                    self.square(&children[i], side, level + 1, corner)
                });
                let is_empty = left.iter().all(|child| *child == Square::Empty);
                if is_empty { Square::Empty } else { Square::Split(Box::new(left)) }
            }
        }
    }

    /// What is left of a patch: of its thickness, and halves, quarters, ... of it, each with the pixels all of whose points
    /// are near, the one of most volume.
    fn patch(&self, mut leaf: Leaf) -> Option<LatticePatch> {
        let is_near = |p: [f32; 3]| self.is_near(p);
        leaf.patch.mask = self.decoder.pixels_of(&leaf, false, is_near);
        let mut best = LatticePatch { mask: 0, ..leaf.patch };
        let mut largest = 0;
        loop {
            let mask = self.decoder.pixels_of(&leaf, true, is_near);
            // A surface without thickness is a layer too.
            let volume = mask.count_ones() * (u32::from(leaf.patch.thickness) + 1);
            if volume > largest {
                largest = volume;
                best = LatticePatch { mask, ..leaf.patch };
            }
            if mask == leaf.patch.mask || leaf.patch.thickness == 0 {
                return (largest > 0).then_some(best);
            }
            leaf.patch.thickness /= 2;
        }
    }
}
