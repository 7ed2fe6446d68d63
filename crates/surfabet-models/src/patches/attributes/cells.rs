//! The cells that carry attributes: those of a cubic grid that the surface with its thickness passes through.
//!
//! They follow from the geometry alone, in integers, so that a decoder knows them before it reads one.

use surfabet_base::parallel;
pub(in crate::patches) use surfabet_geom::cells::{key as cell_key, of_key as cell_of_key};
use surfabet_geom::morton::MortonMap;

use crate::patches::model::{Lattice, THICKNESS_STEPS};
use crate::patches::sheets::axes_of;
use crate::patches::surface::basis::Basis;
use crate::patches::surface::leaf::Leaf;

/// Map from sorted keys to their numbers.
pub(in crate::patches) fn index(keys: &[u64]) -> MortonMap<u32> {
    (0..).zip(keys).map(|(i, &k)| (k, i)).collect()
}

/// Sorted keys of the cells of one finest pixel's side that the surface passes through, or `None` when there may
/// be more than `limit`.
pub(in crate::patches) fn attribute_cells(
    lattice: &Lattice,
    leaves: &[Leaf],
    limit: u64,
) -> Option<Vec<u64>> {
    let layers = |leaf: &Leaf| 2 * u64::from(leaf.patch.thickness) / CELL as u64 + 2;
    let bound: u64 =
        leaves.iter().map(|l| u64::from(l.area(lattice)) * layers(l)).fold(0, u64::saturating_add);
    if bound > limit {
        return None;
    }
    let bases = Basis::of_levels(lattice.levels);
    let of_leaf = |leaf: &Leaf| cells_of(leaf, lattice, &bases);
    let mut keys: Vec<u64> =
        parallel::gather(leaves.len(), |i, keys| keys.extend(of_leaf(&leaves[i])));
    parallel::sort_keys(&mut keys);
    keys.dedup();
    Some(keys)
}

/// The sides of the patches that pass through each of the sorted `cells`: bit `s` for side `s`.
pub(in crate::patches) fn sides_of_cells(
    lattice: &Lattice,
    leaves: &[Leaf],
    cells: &[u64],
) -> Vec<u8> {
    let bases = Basis::of_levels(lattice.levels);
    let mut sides = vec![0; cells.len()];
    for leaf in leaves {
        for key in cells_of(leaf, lattice, &bases) {
            if let Ok(i) = cells.binary_search(&key) {
                sides[i] |= 1 << leaf.side;
            }
        }
    }
    sides
}

/// Keys of the cells that the surface of a patch passes through, with its thickness.
fn cells_of(leaf: &Leaf, lattice: &Lattice, bases: &[Basis]) -> Vec<u64> {
    let [d, u, v] = axes_of(leaf.side);
    let half = i64::from(leaf.patch.thickness);
    let mut keys = Vec::new();
    for ([column, row], depth) in leaf.depths(lattice, bases) {
        let low = (depth - half).div_euclid(CELL);
        let high = (depth + half - i64::from(half > 0)).div_euclid(CELL);
        let mut at = [0; 3];
        at[u] = leaf.corner[0] + column;
        at[v] = leaf.corner[1] + row;
        for depth in low..=high {
            at[d] = depth.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            keys.push(cell_key(at));
        }
    }
    keys
}

/// Side of a cell, in steps of thickness.
const CELL: i64 = THICKNESS_STEPS as i64;
