//! The scene's own axes: walls, floors and furniture of a building follow three orthogonal directions.
//!
//! Patches whose frames follow these directions need no orientation of their own, share one pixel lattice, and
//! meet without gaps. A scene without such directions loses nothing but compactness: any frame is a valid one.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use surfabet_base::parallel;
use surfabet_geom::{Moments, PointCloud};

use super::constants::{
    ACROSS_AXIS, ALONG_AXIS, AXES_ROUNDS, MAX_AXES_CANDIDATES, MAX_AXES_POINTS,
};
use super::samples::cells::{CellGroups, cell_of, key};
use crate::vector::dot;

/// Quaternions are stored in units of this: 2e-6 rad, so 0.2 mm at 100 m.
const QUATERNION_STEP: f64 = 1.0 / (1 << 19) as f64;

/// Largest component of a stored quaternion.
pub const MAX_QUATERNION: i32 = 1 << 19;

/// A rotation as the file stores it: w, x, y, z of a quaternion in steps of 2^-19, not exactly of unit length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Orientation {
    /// Components w, x, y, z.
    pub quaternion: [i32; 4],
}

impl Default for Orientation {
    fn default() -> Self {
        Self { quaternion: [MAX_QUATERNION, 0, 0, 0] }
    }
}

impl Orientation {
    /// The nearest orientation that a file can store.
    fn nearest(rotation: &Rotation3<f64>) -> Self {
        let q = UnitQuaternion::from_rotation_matrix(rotation);
        let store = |c: f64| (c / QUATERNION_STEP).round() as i32;
        Self { quaternion: [q.w, q.i, q.j, q.k].map(store) }
    }

    /// Rows of the matrix that takes directions of the lattice to directions of the world.
    pub fn rotation(self) -> [[f64; 3]; 3] {
        let [w, x, y, z] = self.quaternion.map(f64::from);
        let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let m = q.to_rotation_matrix();
        std::array::from_fn(|row| std::array::from_fn(|column| m[(row, column)]))
    }

    /// Checks that it is a rotation at all.
    pub(super) fn is_valid(self) -> bool {
        let length: i64 = self.quaternion.iter().map(|&c| i64::from(c) * i64::from(c)).sum();
        self.quaternion.iter().all(|c| c.abs() <= MAX_QUATERNION + 1) && length >= 1 << 36
    }

    /// The orientation that most of the surface of `cloud` follows, from planes in cells of side `cell` metres.
    pub(super) fn of(cloud: &PointCloud, cell: f32) -> Self {
        let normals = normals(cloud, cell);
        let Some(first) = strongest(&normals, |_| true) else { return Self::default() };
        let second =
            strongest(&normals, |c| dot(c, first).abs() < ACROSS_AXIS).unwrap_or_else(|| {
                // Nothing else stands across the first axis: any direction does.
                let axis = (0..3).min_by(|&a, &b| first[a].abs().total_cmp(&first[b].abs()));
                std::array::from_fn(|a| f64::from(u8::from(Some(a) == axis)))
            });
        let mut axes = orthonormal(first, second);
        for _ in 0..AXES_ROUNDS {
            // Directions as close to the means as a rotation can be (orthogonal Procrustes).
            let mut sums = Matrix3::<f64>::zeros();
            for (n, weight) in &normals {
                for (a, axis) in axes.iter().enumerate() {
                    let along = dot(*n, *axis);
                    if along.abs() >= ALONG_AXIS {
                        for k in 0..3 {
                            sums[(k, a)] += weight * along.signum() * n[k];
                        }
                    }
                }
            }
            for (a, axis) in axes.iter().enumerate() {
                // An axis without followers stays where it is.
                (0..3).for_each(|k| sums[(k, a)] += 1e-9 * axis[k]);
            }
            let svd = sums.svd(true, true);
            let (Some(u), Some(v)) = (svd.u, svd.v_t) else { break };
            let mut turned = u * v;
            if turned.determinant() < 0.0 {
                turned.column_mut(2).neg_mut();
            }
            axes = std::array::from_fn(|a| std::array::from_fn(|k| turned[(k, a)]));
        }
        let matrix = Matrix3::from_fn(|row, column| axes[column][row]);
        Self::nearest(&Rotation3::from_matrix_unchecked(matrix))
    }
}

/// Plane normals of the cells of a thinned cloud, each weighted by the number of points times `1 - sqrt(v0 / v1)`, with
/// the variances `v0 <= v1 <= v2` along the principal axes.
fn normals(cloud: &PointCloud, cell: f32) -> Vec<([f64; 3], f64)> {
    let stride = cloud.len().div_ceil(MAX_AXES_POINTS).max(1);
    let points: Vec<[f32; 3]> = cloud.positions().iter().step_by(stride).copied().collect();
    let cells = CellGroups::new(points.len(), |i| key(cell_of(points[i], cell)));
    let normal = |g: usize| {
        let members = cells.of(g);
        let moments = Moments::about(
            points[members[0] as usize],
            members.iter().map(|&i| points[i as usize]),
        );
        let axes = moments.principal_axes()?;
        let [thin, middle, _] = axes.variances;
        (members.len() >= 6 && middle > 0.0).then_some(())?;
        Some((axes.normal(), members.len() as f64 * (1.0 - (thin / middle).sqrt())))
    };
    parallel::gather(cells.len(), |g, normals| normals.extend(normal(g)))
}

/// The allowed normal with most weight of normals along it, either way.
fn strongest(
    normals: &[([f64; 3], f64)],
    allowed: impl Fn([f64; 3]) -> bool + Sync,
) -> Option<[f64; 3]> {
    let stride = normals.len().div_ceil(MAX_AXES_CANDIDATES).max(1);
    let candidates: Vec<[f64; 3]> =
        normals.iter().step_by(stride).map(|n| n.0).filter(|&n| allowed(n)).collect();
    let votes: Vec<f64> = parallel::map(&candidates, |c| {
        normals.iter().filter(|(n, _)| dot(*n, *c).abs() >= ALONG_AXIS).map(|n| n.1).sum()
    });
    let best =
        (0..candidates.len()).max_by(|&a, &b| votes[a].total_cmp(&votes[b]).then(b.cmp(&a)))?;
    Some(candidates[best])
}

/// The right-handed frame whose first axis is along `first` and whose second is as near to `second` as it can be.
fn orthonormal(first: [f64; 3], second: [f64; 3]) -> [[f64; 3]; 3] {
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    };
    let x = unit(first);
    let along = dot(second, x);
    let y = unit(std::array::from_fn(|a| second[a] - along * x[a]));
    let z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    [x, y, z]
}

/// A position along the axes of a rotation from them to the world.
pub(super) fn to_axes(rotation: &[[f64; 3]; 3], p: [f32; 3]) -> [f64; 3] {
    std::array::from_fn(|a| (0..3).map(|k| rotation[k][a] * f64::from(p[k])).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three orthogonal squares of two metres, turned.
    fn corner(rotation: &Rotation3<f64>) -> PointCloud {
        let mut points = Vec::new();
        for i in 0..80 {
            for j in 0..80 {
                let (a, b) = (f64::from(i) * 0.025, f64::from(j) * 0.025);
                for p in [[a, b, 0.0], [a, 0.0, b], [0.0, a, b]] {
                    let p = rotation * nalgebra::Vector3::from(p);
                    points.push([p.x as f32, p.y as f32, p.z as f32]);
                }
            }
        }
        PointCloud::from_positions(points).0
    }

    #[test]
    fn a_turned_corner_is_found_to_a_tenth_of_a_degree() {
        for angles in [[0.0, 0.0, 0.0], [0.3, -0.7, 1.1], [1.2, 0.4, -2.0]] {
            let turned = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
            let found = Orientation::of(&corner(&turned), 0.1).rotation();
            for axis in 0..3 {
                let wanted = turned * nalgebra::Vector3::ith(axis, 1.0);
                // Each true axis is one of the lattice's, in either direction.
                let best = (0..3)
                    .map(|a| (0..3).map(|k| found[k][a] * wanted[k]).sum::<f64>().abs())
                    .fold(0.0, f64::max);
                assert!(best > 0.1_f64.to_radians().cos(), "{angles:?}: {best}");
            }
        }
    }

    #[test]
    fn rotations_are_orthonormal_even_for_coarse_quaternions() {
        let rows = Orientation { quaternion: [300_000, -200_000, 10, 77_777] }.rotation();
        for a in 0..3 {
            for b in 0..3 {
                let product: f64 = (0..3).map(|k| rows[a][k] * rows[b][k]).sum();
                assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn no_planes_no_turn() {
        let line = (0..100).map(|i| [i as f32 * 0.01, 0.0, 0.0]).collect();
        assert_eq!(
            Orientation::of(&PointCloud::from_positions(line).0, 0.1),
            Orientation::default()
        );
    }
}
