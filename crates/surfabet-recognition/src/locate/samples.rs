//! The scan as oriented samples, one per voxel, as the search and the refinement use it.

use rustc_hash::{FxBuildHasher, FxHashMap};
use surfabet_geom::cells::cell_of;
use surfabet_geom::{PointCloud, vector};

use super::constants::{
    BODY_RADIUS, FLATNESS, LEAST_POINTS, LEAST_WIDTH, MAX_POINTS_USED, NORMAL_ERROR, RANGE_NOISE,
    VOXELS_PER_CELL,
};

/// Points of a voxel from which the room for voxels is reserved; more are made where it is not enough.
const POINTS_PER_VOXEL: usize = 4;

/// A sample of the scan's surface: the mean of a voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Metres in the frame of the scan, about [`ScanSamples::origin`].
    pub point: [f32; 3],
    /// Unit normal towards the sensor; zero where the voxel shows no plane.
    pub normal: [f32; 3],
    /// Where it was seen from, in the same frame as `point`.
    pub viewpoint: [f32; 3],
}

impl Sample {
    /// Whether the voxel shows a plane.
    pub fn is_flat(&self) -> bool {
        self.normal != [0.0; 3]
    }

    /// The same in the mirror of a vertical plane.
    pub fn mirrored(&self) -> Self {
        let mirror = |[x, y, z]: [f32; 3]| [x, -y, z];
        Self {
            point: mirror(self.point),
            normal: mirror(self.normal),
            viewpoint: mirror(self.viewpoint),
        }
    }
}

/// The samples of a scan.
#[derive(Debug, Clone)]
pub(super) struct ScanSamples {
    /// What positions are relative to, in the frame of the scan, metres.
    pub origin: [f64; 3],
    /// In the order of the first point of each voxel.
    pub all: Vec<Sample>,
}

/// Sums over the points of a voxel, about the voxel's own corner.
#[derive(Clone, Copy)]
struct VoxelSums {
    corner: [f32; 3],
    n: f32,
    first: [f64; 3],
    /// xx, xy, xz, yy, yz, zz.
    second: [f64; 6],
    viewpoint: [f32; 3],
}

impl ScanSamples {
    /// Means of the voxels of a scan, for a map with cells of side `cell`. The sensor is at the scan's own origin unless
    /// the cloud has viewpoints.
    pub fn of(scan: &PointCloud, cell: f64) -> Self {
        let side = (VOXELS_PER_CELL * cell) as f32;
        let origin = scan.origin();
        // The sensor at zero of the frame, about the origin.
        let zero = origin.map(|c| -c as f32);
        let stride = scan.len().div_ceil(MAX_POINTS_USED).max(1);
        // 0.17 to 0.23 ms of three scans; a table of our own by open addressing took 0.16 to 0.24, the default hash 0.44 to 0.58.
        let capacity = scan.len() / stride / POINTS_PER_VOXEL;
        let mut voxels: FxHashMap<[i32; 3], usize> =
            FxHashMap::with_capacity_and_hasher(capacity, FxBuildHasher);
        let mut sums: Vec<VoxelSums> = Vec::new();
        for (i, &p) in scan.positions().iter().enumerate().step_by(stride) {
            let viewpoint = scan.local_viewpoint(i).unwrap_or(zero);
            if vector::squared_distance(p, viewpoint) < BODY_RADIUS * BODY_RADIUS {
                continue;
            }
            let voxel = cell_of(p, side);
            let at = *voxels.entry(voxel).or_insert(sums.len());
            if at == sums.len() {
                let corner = voxel.map(|c| c as f32 * side);
                sums.push(VoxelSums {
                    corner,
                    n: 0.0,
                    first: [0.0; 3],
                    second: [0.0; 6],
                    viewpoint,
                });
            }
            sums[at].add(p);
        }
        Self { origin, all: sums.iter().map(|s| s.sample(f64::from(side))).collect() }
    }

    /// Where the sensor stands in the frame of the scan: where the first sample was seen from.
    pub fn sensor(&self) -> [f64; 3] {
        let first = self.all.first().map_or([0.0; 3], |s| s.viewpoint);
        std::array::from_fn(|a| self.origin[a] + f64::from(first[a]))
    }

    /// Largest distance of a sample from where it was seen, metres.
    pub fn reach(&self) -> f32 {
        let ranges = self.all.iter().map(|s| vector::distance(s.point, s.viewpoint));
        ranges.fold(0.0, f32::max)
    }
}

impl VoxelSums {
    fn add(&mut self, p: [f32; 3]) {
        let [x, y, z] = vector::minus(p, self.corner).map(f64::from);
        self.n += 1.0;
        self.first = [self.first[0] + x, self.first[1] + y, self.first[2] + z];
        for (sum, product) in self.second.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z])
        {
            *sum += product;
        }
    }

    fn sample(&self, side: f64) -> Sample {
        let n = f64::from(self.n);
        let mean = self.first.map(|s| s / n);
        let point = std::array::from_fn(|a| self.corner[a] + mean[a] as f32);
        let [x, y, z] = mean;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        let covariance: [f64; 6] = std::array::from_fn(|k| self.second[k] / n - products[k]);
        let normal = if self.n < LEAST_POINTS { None } else { plane_normal(covariance, n, side) };
        let normal = normal.map_or([0.0; 3], |normal| {
            let normal = normal.map(|c| c as f32);
            let towards = vector::minus(self.viewpoint, point);
            if vector::dot(normal, towards) < 0.0 { normal.map(|c| -c) } else { normal }
        });
        Sample { point, normal, viewpoint: self.viewpoint }
    }
}

/// Direction of least variance of `n` points in a voxel of a `side`, if it is sure: the least variance below [`FLATNESS`] of
/// the middle one, the extent across the longest a share of the side, and the standard error of the direction small.
/// Eigenvalues of a symmetric 3 x 3 matrix in closed form (Smith 1961).
fn plane_normal([xx, xy, xz, yy, yz, zz]: [f64; 6], n: f64, side: f64) -> Option<[f64; 3]> {
    let mean = (xx + yy + zz) / 3.0;
    let off = xy * xy + xz * xz + yz * yz;
    let spread = (xx - mean).powi(2) + (yy - mean).powi(2) + (zz - mean).powi(2) + 2.0 * off;
    let p = (spread / 6.0).sqrt();
    if p <= 1e-12 {
        return None;
    }
    let [a, b, c, d, e, f] =
        [(xx - mean) / p, xy / p, xz / p, (yy - mean) / p, yz / p, (zz - mean) / p];
    let half_determinant = 0.5 * (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d));
    let angle = half_determinant.clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * p * angle.cos();
    let least = mean + 2.0 * p * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    let middle = 3.0 * mean - largest - least;
    let narrow = (LEAST_WIDTH * side).powi(2);
    let error = (least + RANGE_NOISE * RANGE_NOISE) / (n * middle.max(1e-12));
    if least > FLATNESS * middle || middle < narrow || error > NORMAL_ERROR * NORMAL_ERROR {
        return None;
    }
    // The rows of C - least I are orthogonal to the direction; the longest product of two is best conditioned.
    let rows = [[xx - least, xy, xz], [xy, yy - least, yz], [xz, yz, zz - least]];
    let products =
        [[0, 1], [0, 2], [1, 2]].map(|[i, j]: [usize; 2]| vector::cross(rows[i], rows[j]));
    let longest = products.into_iter().fold([0.0; 3], |best: [f64; 3], v| {
        if vector::dot(v, v) > vector::dot(best, best) { v } else { best }
    });
    (vector::dot(longest, longest) > 0.0).then(|| vector::unit(longest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_of_a_tilted_plane_faces_the_sensor() {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                let (x, y) = (2.0 + 0.01 * i as f32, 1.0 + 0.01 * j as f32);
                points.push([x, y, -1.5 + 0.5 * x]);
            }
        }
        let (cloud, _) = PointCloud::from_positions(points);
        let samples = ScanSamples::of(&cloud, 0.2);
        let expected = vector::unit([0.5_f32, 0.0, -1.0]);
        let flat: Vec<&Sample> = samples.all.iter().filter(|s| s.is_flat()).collect();
        assert!(flat.len() >= 4);
        for s in flat {
            let towards = vector::minus(s.viewpoint, s.point);
            assert!(vector::dot(s.normal, towards) > 0.0);
            assert!(vector::dot(s.normal, expected).abs() > 0.999);
        }
    }

    #[test]
    fn a_ball_of_points_shows_no_plane() {
        assert!(plane_normal([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], 100.0, 3.0).is_none());
        let normal = plane_normal([1.0, 0.0, 0.0, 0.01, 0.0, 1.0], 100.0, 3.0).unwrap();
        assert!(normal[1].abs() > 0.999_999);
    }
}
