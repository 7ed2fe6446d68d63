//! The nearest sample of the map's surface, at every cell near one.

use super::grid::Lattice;
use crate::locate::constants::REACH;
use surfabet_geom::vector::squared_distance;

/// Numbers of the nearest samples by cell.
#[derive(Debug, Clone)]
pub(in crate::locate) struct Nearest {
    lattice: Lattice,
    number: Vec<u32>,
}

/// No sample within reach.
const NONE: u32 = u32::MAX;

impl Nearest {
    /// For cells up to [`REACH`] cells from a sample. A cell keeps the one of its samples that is nearest to its middle; from
    /// cell to cell the nearest of these is handed on, so that it may be missed by less than a tenth of a cell.
    pub fn new(lattice: Lattice, points: &[[f32; 3]]) -> Self {
        let mut number = vec![NONE; lattice.len()];
        let mut front: Vec<[i32; 3]> = Vec::new();
        for (i, &p) in points.iter().enumerate() {
            let cell = lattice.cell_of(p);
            let Some(at) = lattice.index(cell) else { continue };
            if number[at] == NONE {
                front.push(cell);
                number[at] = i as u32;
            } else {
                let middle = lattice.middle(cell);
                let before = squared_distance(points[number[at] as usize], middle);
                if squared_distance(p, middle) < before {
                    number[at] = i as u32;
                }
            }
        }
        for _ in 0..REACH {
            let mut next = Vec::new();
            for &cell in &front {
                let Some(at) = lattice.index(cell) else { continue };
                let candidate = number[at];
                for around in surfabet_geom::cells::around(cell) {
                    let Some(there) = lattice.index(around) else { continue };
                    let middle = lattice.middle(around);
                    let distance = squared_distance(points[candidate as usize], middle);
                    let is_nearer = match number[there] {
                        NONE => true,
                        other => distance < squared_distance(points[other as usize], middle),
                    };
                    if is_nearer {
                        number[there] = candidate;
                        next.push(around);
                    }
                }
            }
            front = next;
        }
        Self { lattice, number }
    }

    /// The number of the sample nearest to a position.
    #[inline]
    pub fn at(&self, p: [f32; 3]) -> Option<usize> {
        let at = self.lattice.index(self.lattice.cell_of(p))?;
        let number = self.number[at];
        (number != NONE).then_some(number as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_know_a_sample_about_as_near_as_the_nearest() {
        let points: Vec<[f32; 3]> = (0..200)
            .map(|i| {
                let t = i as f32 * 0.37;
                [2.0 + 1.5 * t.sin(), 2.0 + 1.2 * (1.7 * t).cos(), 2.0 + 0.4 * (0.9 * t).sin()]
            })
            .collect();
        let lattice = Lattice::new([0.0; 3], 0.2, [20; 3]);
        let nearest = Nearest::new(lattice, &points);
        // Of each cell with points the one nearest to its middle.
        let off_middle =
            |i: usize| squared_distance(points[i], lattice.middle(lattice.cell_of(points[i])));
        let is_kept = |i: usize| {
            let cell = lattice.cell_of(points[i]);
            let same = |&j: &usize| lattice.cell_of(points[j]) == cell;
            (0..points.len()).filter(same).all(|j| off_middle(i) <= off_middle(j))
        };
        let kept: Vec<usize> = (0..points.len()).filter(|&i| is_kept(i)).collect();
        assert!(kept.len() < points.len());
        for z in 0..20 {
            for y in 0..20 {
                for x in 0..20 {
                    let middle = lattice.middle([x, y, z]);
                    let distance = |i: usize| squared_distance(points[i], middle).sqrt();
                    let least = kept.iter().map(|&i| distance(i)).fold(f32::INFINITY, f32::min);
                    match nearest.at(middle) {
                        Some(i) => assert!(distance(i) < least + 0.02),
                        None => assert!(least > 0.8),
                    }
                }
            }
        }
    }
}
