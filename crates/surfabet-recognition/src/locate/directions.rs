//! The directions that surfaces face, up to sign.

use nalgebra::{Matrix3, SymmetricEigen};
use surfabet_geom::vector::{cross, dot, unit};

use super::constants::{LEAST_DIRECTION_SHARE, SAME_DIRECTION};

/// Cells that can be the middle of a direction: the fullest.
const FULLEST: usize = 64;

/// Side of a face of the cube that normals are counted on.
const SIDE: usize = 24;

/// Directions, the most frequent first, and the density of normals.
#[derive(Debug, Clone, Default)]
pub(super) struct Directions {
    /// Unit vectors and their shares of all normals.
    pub all: Vec<([f64; 3], f64)>,
    /// The normals, those of one cell of three faces of a cube as one, with their shares.
    pub bins: Vec<([f64; 3], f64)>,
}

/// How dense normals are about every direction.
#[derive(Debug, Clone)]
pub(super) struct Density {
    /// Share of the normals within 12 degrees of the middle of each cell.
    shares: Vec<f32>,
}

impl Directions {
    /// Of unit normals with weights: at most `most`.
    pub fn of(normals: &[([f64; 3], f64)], most: usize) -> Self {
        let mut bins = vec![([0.0; 6], 0.0); 3 * SIDE * SIDE];
        let total: f64 = normals.iter().map(|n| n.1).sum();
        if total <= 0.0 {
            return Self::default();
        }
        for &(n, w) in normals {
            let (sums, weight) = &mut bins[bin_of(n)];
            let products = outer(n);
            (0..6).for_each(|k| sums[k] += w * products[k]);
            *weight += w / total;
        }
        let used: Vec<([f64; 3], f64, [f64; 6])> = bins
            .iter()
            .filter(|b| b.1 > 0.0)
            .map(|&(sums, weight)| (main_axis(sums), weight, sums))
            .collect();
        let about = |d: [f64; 3], taken: &[bool]| -> f64 {
            let near = |i: &usize| !taken[*i] && dot(used[*i].0, d).abs() > SAME_DIRECTION;
            (0..used.len()).filter(near).map(|i| used[i].1).sum()
        };
        let mut taken = vec![false; used.len()];
        let mut fullest: Vec<usize> = (0..used.len()).collect();
        fullest.sort_by(|&i, &j| used[j].1.total_cmp(&used[i].1).then(i.cmp(&j)));
        let mut all = Vec::new();
        while all.len() < most {
            let best = fullest
                .iter()
                .filter(|&&i| !taken[i])
                .take(FULLEST)
                .map(|&i| (about(used[i].0, &taken), i))
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let Some((share, i)) = best.filter(|b| b.0 >= LEAST_DIRECTION_SHARE) else { break };
            let mut sums = [0.0; 6];
            for (k, bin) in used.iter().enumerate() {
                if !taken[k] && dot(bin.0, used[i].0).abs() > SAME_DIRECTION {
                    (0..6).for_each(|c| sums[c] += bin.2[c]);
                }
            }
            let direction = main_axis(sums);
            for (k, bin) in used.iter().enumerate() {
                taken[k] |= dot(bin.0, direction).abs() > SAME_DIRECTION;
            }
            all.push((direction, share));
        }
        Self { all, bins: used.iter().map(|b| (b.0, b.1)).collect() }
    }

    /// Share of the normals about every direction.
    pub fn density(&self) -> Density {
        let about = |d: [f64; 3]| -> f64 {
            self.bins.iter().filter(|b| dot(b.0, d).abs() > SAME_DIRECTION).map(|b| b.1).sum()
        };
        Density { shares: (0..3 * SIDE * SIDE).map(|b| about(middle_of(b)) as f32).collect() }
    }
}

impl Density {
    /// Share of the normals within 12 degrees of a direction, about.
    pub fn at(&self, direction: [f64; 3]) -> f64 {
        f64::from(self.shares[bin_of(direction)])
    }
}

/// xx, xy, xz, yy, yz, zz of v v^T.
fn outer([x, y, z]: [f64; 3]) -> [f64; 6] {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

/// The direction of the largest sum of squares.
fn main_axis([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> [f64; 3] {
    let eigen = SymmetricEigen::new(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
    let largest = (1..3)
        .fold(0, |best, i| if eigen.eigenvalues[i] > eigen.eigenvalues[best] { i } else { best });
    eigen.eigenvectors.column(largest).into_owned().into()
}

/// The cell of a direction and its opposite on the cube: the face of the largest component.
fn bin_of(d: [f64; 3]) -> usize {
    let magnitudes = d.map(f64::abs);
    let face = surfabet_geom::vector::largest(magnitudes);
    let scale = if d[face] == 0.0 { 1.0 } else { 1.0 / d[face] };
    let at = |c: f64| (((c * scale + 1.0) * 0.5 * SIDE as f64) as usize).min(SIDE - 1);
    (face * SIDE + at(d[(face + 1) % 3])) * SIDE + at(d[(face + 2) % 3])
}

fn middle_of(bin: usize) -> [f64; 3] {
    let (face, u, v) = (bin / (SIDE * SIDE), bin / SIDE % SIDE, bin % SIDE);
    let at = |i: usize| (2 * i + 1) as f64 / SIDE as f64 - 1.0;
    let mut d = [0.0; 3];
    d[face] = 1.0;
    d[(face + 1) % 3] = at(u);
    d[(face + 2) % 3] = at(v);
    unit(d)
}

/// Three orthogonal axes: the most frequent direction, the one most across it, and what is across both. Without
/// directions those of the coordinates.
pub(super) fn axes_of(directions: &Directions) -> [[f64; 3]; 3] {
    let Some(&(first, _)) = directions.all.first() else {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    };
    let across = directions.all.iter().skip(1).find(|d| dot(d.0, first).abs() < 0.5);
    let second = across.map_or(surfabet_geom::vector::least_axis(first), |d| d.0);
    let third = unit(cross(first, second));
    [first, cross(third, first), third]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_walls_give_three_directions_by_share() {
        let tilted = unit([1.0, 0.2, 0.0]);
        let mut normals = vec![([0.0, 0.0, 1.0], 1.0); 50];
        normals.extend(vec![(tilted, 1.0); 30]);
        normals.extend(vec![(tilted.map(|c| -c), 1.0); 5]);
        normals.extend(vec![(cross([0.0, 0.0, 1.0], tilted), 1.0); 14]);
        normals.push((unit([1.0, 1.0, 1.0]), 1.0));
        let found = Directions::of(&normals, 8);
        let shares: Vec<f64> = found.all.iter().map(|d| d.1).collect();
        assert_eq!(found.all.len(), 3);
        for (share, expected) in shares.iter().zip([0.5, 0.35, 0.14]) {
            assert!((share - expected).abs() < 1e-9);
        }
        assert!(dot(found.all[1].0, tilted).abs() > 0.999_999);
        assert!((found.density().at(tilted) - 0.35).abs() < 1e-6);
        let axes = axes_of(&found);
        for i in 0..3 {
            for j in 0..i {
                assert!(dot(axes[i], axes[j]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_direction_and_its_opposite_share_a_cell() {
        for d in [[0.3, -0.7, 0.2], [-0.9, 0.1, 0.4], [0.0, 0.0, -1.0]] {
            assert_eq!(bin_of(d), bin_of(d.map(|c: f64| -c)));
            assert!(dot(unit(d), middle_of(bin_of(d))).abs() > 0.99);
        }
    }
}
