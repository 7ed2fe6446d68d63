//! Which patches are noise that stands off a surface.
//!
//! Far points of a depth camera scatter by centimetres, and some land where nothing is. Measured, they are part of
//! the scan, and small patches hold them. Of a surface they are not: a few pixels that touch nothing, a little in
//! front of or behind a larger piece.

use surfabet_base::parallel;
use surfabet_base::rounding::floor_f32;
use surfabet_geom::KdTree;
use surfabet_geom::morton::{MortonMap, step};

use crate::error::Result;
use crate::patches::attributes::cells::cell_key;
use crate::patches::constants::{FRAGMENT_GAP, FRAGMENT_REACH, LARGEST_FRAGMENT};
use crate::patches::model::Lattice;
use crate::patches::surface::basis::Basis;
use crate::patches::surface::leaf::Leaf;

/// Whether each patch is a fragment.
pub(in crate::patches) fn fragments(lattice: &Lattice, leaves: &[Leaf]) -> Result<Vec<bool>> {
    let bases = Basis::of_levels(lattice.levels);
    let pixels = |leaf: &Leaf| -> Vec<[f32; 3]> { leaf.pixels(lattice, &bases).collect() };
    let is_small = |leaf: &Leaf| leaf.area(lattice) <= LARGEST_FRAGMENT;
    let large: Vec<[f32; 3]> = parallel::gather(leaves.len(), |i, large| {
        if !is_small(&leaves[i]) {
            large.extend(leaves[i].pixels(lattice, &bases));
        }
    });
    let mut found = vec![false; leaves.len()];
    if large.is_empty() {
        return Ok(found);
    }
    let tree = KdTree::new(&large)?;

    // Small patches that touch make one piece.
    let small: Vec<usize> = (0..leaves.len()).filter(|&i| is_small(&leaves[i])).collect();
    let mut pieces = Pieces::new(small.len());
    let mut places: MortonMap<usize> = MortonMap::default();
    for (piece, &i) in small.iter().enumerate() {
        for p in pixels(&leaves[i]) {
            let key = cell_key(p.map(floor_f32));
            for neighbour in around(key) {
                if let Some(&other) = places.get(&neighbour) {
                    pieces.join(piece, other);
                }
            }
            places.insert(key, piece);
        }
    }
    let mut area = vec![0; small.len()];
    let mut gap = vec![f32::INFINITY; small.len()];
    for (piece, &i) in small.iter().enumerate() {
        let of = pieces.of(piece);
        area[of] += leaves[i].area(lattice);
        for n in pixels(&leaves[i]).into_iter().filter_map(|p| tree.nearest(p)) {
            gap[of] = gap[of].min(n.squared_distance().sqrt());
        }
    }
    for (piece, &i) in small.iter().enumerate() {
        let of = pieces.of(piece);
        found[i] =
            area[of] <= LARGEST_FRAGMENT && (FRAGMENT_GAP..FRAGMENT_REACH).contains(&gap[of]);
    }
    Ok(found)
}

/// Keys of a cell and its 26 neighbours.
fn around(key: u64) -> impl Iterator<Item = u64> {
    (0..27_usize).map(move |place| {
        [place % 3, place / 3 % 3, place / 9].into_iter().enumerate().fold(
            key,
            |key, (axis, along)| if along == 1 { key } else { step(key, axis, along == 2) },
        )
    })
}

/// Pieces that are joined one by one.
struct Pieces(Vec<usize>);

impl Pieces {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The piece that stands for all that `i` was joined to.
    fn of(&self, mut i: usize) -> usize {
        while self.0[i] != i {
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patches::Orientation;
    use crate::patches::model::LatticePatch;

    const LATTICE: Lattice = Lattice {
        origin: [0.0; 3],
        orientation: Orientation { quaternion: [1 << 19, 0, 0, 0] },
        pixel_size: 0.01,
        levels: 1,
        depth_step: 16,
    };

    /// A patch at a column and a depth in pixels.
    fn leaf(column: i32, depth: i32, mask: u64) -> Leaf {
        let mut patch = LatticePatch { mask, ..LatticePatch::default() };
        patch.coefficients[0] = depth;
        Leaf { side: 0, level: 0, corner: [column, 0], patch }
    }

    #[test]
    fn a_few_pixels_in_front_of_a_surface_are_a_fragment() {
        let wall = leaf(0, 0, u64::MAX);
        let of = |small: &[Leaf]| {
            let mut leaves = vec![wall];
            leaves.extend(small);
            fragments(&LATTICE, &leaves).unwrap()[1..].to_vec()
        };
        assert_eq!(of(&[leaf(0, 4, 0b11)]), [true]);
        // Next to the wall, and far from it.
        assert_eq!(of(&[leaf(8, 0, 1)]), [false]);
        assert_eq!(of(&[leaf(0, 30, 0b11)]), [false]);
        // Two rows of eight pixels and one beside them, in two patches: too large together, not alone.
        let [first, second] = [leaf(0, 4, 0xffff), leaf(8, 4, 0x01)];
        assert_eq!(of(&[first, second]), [false, false]);
        assert_eq!(of(&[first]), [true]);
        assert_eq!(fragments(&LATTICE, &[first]).unwrap(), [false]);
    }
}
