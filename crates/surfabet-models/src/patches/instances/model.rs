//! What a model knows of its instances.

use super::Instance;
use super::coding::{BLOCK, Blocks};
use crate::patches::attributes::cells::cell_of_key;
use crate::patches::model::{Lattice, PatchModel};
use crate::patches::sheets::axes_of;
use crate::patches::surface::leaf::Leaf;

impl Blocks {
    /// Blocks of patches and of points beside them: cells of side `size` metres, by their keys.
    pub(in crate::patches) fn of(
        lattice: &Lattice,
        leaves: &[Leaf],
        points: &[u64],
        size: f64,
    ) -> Self {
        let of_point = |&key: &u64| {
            let along = |c: i32| {
                let pixels = (f64::from(c) + 0.5) * size / lattice.pixel_size;
                (pixels / f64::from(BLOCK)).floor() as i32
            };
            cell_of_key(key).map(along)
        };
        Self {
            patches: leaves.iter().map(|leaf| block_of(leaf, lattice)).collect(),
            points: points.iter().map(of_point).collect(),
        }
    }
}

/// The block that the middle of a patch lies in.
fn block_of(leaf: &Leaf, lattice: &Lattice) -> [i32; 3] {
    let [d, u, v] = axes_of(leaf.side);
    let half = lattice.patch_width(leaf.level) / 2;
    let depth = i64::from(leaf.patch.coefficients[0]) * i64::from(lattice.depth_step);
    let mut block = [0; 3];
    block[d] = depth.div_euclid(16 * i64::from(BLOCK)) as i32;
    block[u] = (leaf.corner[0] + half).div_euclid(BLOCK);
    block[v] = (leaf.corner[1] + half).div_euclid(BLOCK);
    block
}

impl PatchModel {
    /// The patches of an instance.
    pub(in crate::patches) fn patches_of<'a>(
        &'a self,
        instance: &'a Instance,
    ) -> impl Iterator<Item = (usize, &'a Leaf)> {
        let leaves = self.leaves();
        instance.patches.iter().map(|&i| (i as usize, &leaves[i as usize]))
    }
}
