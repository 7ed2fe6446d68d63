//! Where surfaces are, by level: what bounds the score of a whole box of translations.

use surfabet_base::parallel;

use super::grid::Lattice;
use crate::locate::constants::LEVELS;

/// Bits of the axes that surfaces face, around every cell, by level.
///
/// A node of level l is a box of translations `2^(l + 1)` finest cells wide. Cells of the level have half that side on level
/// 0 and a quarter above, and hold the bits of all surfaces in them and the two or four cells after them along each axis. A
/// box takes a sample from its lowest place over at most those cells, so what is not in them no translation of the box can
/// reach.
#[derive(Debug, Clone)]
pub(in crate::locate) struct Pyramid {
    pub levels: Vec<Level>,
}

/// One level.
#[derive(Debug, Clone)]
pub(in crate::locate) struct Level {
    pub lattice: Lattice,
    bits: Vec<u8>,
}

impl Pyramid {
    /// Of surfaces at `points` that face the axes of `bits`.
    pub fn new(lattice: Lattice, points: &[[f32; 3]], bits: &[u8]) -> Self {
        let mut occupied = Level::empty(lattice);
        for (&p, &b) in points.iter().zip(bits) {
            if let Some(i) = lattice.index(lattice.cell_of(p)) {
                occupied.bits[i] |= b;
            }
        }
        let mut levels = vec![occupied.windows(2)];
        for level in 1..LEVELS {
            if level > 1 {
                occupied = occupied.halved();
            }
            levels.push(occupied.windows(4));
        }
        Self { levels }
    }
}

impl Level {
    fn empty(lattice: Lattice) -> Self {
        Self { lattice, bits: vec![0; lattice.len()] }
    }

    /// The bits at a position, 0 outside.
    #[inline]
    pub fn at(&self, p: [f32; 3]) -> u8 {
        let lattice = &self.lattice;
        lattice.index(lattice.cell_of(p)).map_or(0, |i| self.bits[i])
    }

    /// Cells of double side.
    fn halved(&self) -> Self {
        let fine = &self.lattice;
        let size = fine.size.map(|n| (n + 1) / 2);
        let mut coarse = Self::empty(Lattice::new(fine.low, 2.0 * fine.cell, size));
        let rows = (size[0] as usize, fine.size[0] as usize);
        for z in 0..fine.size[2] as usize {
            for y in 0..fine.size[1] as usize {
                let from = (z * fine.size[1] as usize + y) * rows.1;
                let to = ((z / 2) * size[1] as usize + y / 2) * rows.0;
                for x in 0..rows.1 {
                    coarse.bits[to + x / 2] |= self.bits[from + x];
                }
            }
        }
        coarse
    }

    /// Each cell with the `after` ones after it along each axis, from as many cells below on.
    fn windows(&self, after: usize) -> Self {
        let fine = &self.lattice;
        let size = fine.size.map(|n| n + after as i32);
        let low = fine.low.map(|c| c - after as f32 * fine.cell);
        let mut wide = Self::empty(Lattice::new(low, fine.cell, size));
        let [nx, ny, nz] = size.map(|n| n as usize);
        for z in 0..fine.size[2] as usize {
            for y in 0..fine.size[1] as usize {
                let from = (z * fine.size[1] as usize + y) * fine.size[0] as usize;
                let to = ((z + after) * ny + y + after) * nx + after;
                wide.bits[to..to + fine.size[0] as usize]
                    .copy_from_slice(&self.bits[from..from + fine.size[0] as usize]);
            }
        }
        // The last cells of a row see the first of the next, which are empty.
        for stride in [1, nx, nx * ny] {
            // Two more cells by each pass: of one, and of that one's.
            for _ in 0..after / 2 {
                for i in 0..nx * ny * nz {
                    let at = |k: usize| wide.bits.get(i + k * stride).copied().unwrap_or(0);
                    wide.bits[i] |= at(1) | at(2);
                }
            }
        }
        wide
    }
}

/// Bits that the samples of all `directions` face along three `axes`: see [`crate::locate::constants::FACES_AXIS`].
pub(in crate::locate) fn facing_bits(
    normals: &[[f32; 3]],
    axes: &[[f32; 3]; 3],
    least: f32,
) -> Vec<u8> {
    parallel::map(normals, |&n| {
        if n == [0.0; 3] {
            return 7;
        }
        let along = |a: usize| surfabet_geom::vector::dot(n, axes[a]).abs();
        (0..3).fold(0, |bits, a| bits | u8::from(along(a) >= least) << a)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_cell_knows_what_a_box_of_two_cells_reaches(
            surface in prop::array::uniform3(0.0_f32..6.0),
            low in prop::array::uniform3(-2.0_f32..6.0),
            inside in prop::array::uniform3(0.0_f32..1.0),
            level in 0..LEVELS,
        ) {
            let lattice = Lattice::new([0.0; 3], 0.2, [30; 3]);
            let pyramid = Pyramid::new(lattice, &[surface], &[2]);
            let width = 0.4 * (1 << level) as f32;
            let level = &pyramid.levels[level];
            // A place of the box from `low` on whose cell holds the surface.
            let place: [f32; 3] = std::array::from_fn(|a| low[a] + inside[a] * width);
            let meets = lattice.cell_of(place) == lattice.cell_of(surface);
            if meets {
                prop_assert_eq!(level.at(low), 2);
            }
        }
    }

    #[test]
    fn what_is_far_is_not_known() {
        let lattice = Lattice::new([0.0; 3], 0.2, [30; 3]);
        let pyramid = Pyramid::new(lattice, &[[3.1, 3.1, 3.1]], &[1]);
        assert_eq!(pyramid.levels[0].at([3.1, 3.1, 3.1]), 1);
        assert_eq!(pyramid.levels[0].at([2.7, 2.7, 2.7]), 1);
        assert_eq!(pyramid.levels[0].at([2.5, 3.1, 3.1]), 0);
        assert_eq!(pyramid.levels[0].at([3.3, 3.1, 3.1]), 0);
        assert_eq!(pyramid.levels[0].at([-9.0, 3.1, 3.1]), 0);
    }
}
