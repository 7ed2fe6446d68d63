//! Surface normals and curvature from the neighbours of each point.

use std::sync::atomic::{AtomicUsize, Ordering};

use surfabet_base::parallel;

use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::kdtree::{KdTree, Neighbor};
use crate::moments::Moments;
use surfabet_base::Meter;
use surfabet_base::Progress;

/// Points per unit of parallel work.
const BATCH: usize = 1024;

/// Which points around a point, itself included, its plane is fitted to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighborhood {
    /// The k nearest.
    Nearest(usize),
    /// All within a distance in metres.
    Within(f32),
    /// The k nearest within a distance in metres.
    NearestWithin(usize, f32),
}

/// Normals of a cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Normals {
    /// A unit normal per point, zero where unknown.
    pub normals: Vec<[f32; 3]>,
    /// Surface variation per point: the share of the variance along the normal, 0 to 1/3; zero where unknown.
    pub curvatures: Vec<f32>,
    /// How many are unknown: fewer than three neighbours, or all of them on a line.
    pub unknown: usize,
}

impl Neighborhood {
    fn check(self) -> Result<()> {
        let (k, radius) = match self {
            Self::Nearest(k) => (k, 1.0),
            Self::Within(radius) => (3, radius),
            Self::NearestWithin(k, radius) => (k, radius),
        };
        if k < 3 {
            return Err(Error::invalid("neighbors", k, "at least 3 to span a plane"));
        }
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::invalid("radius", radius, "a positive distance in metres"));
        }
        Ok(())
    }

    /// Puts the neighbours of `query` in place of the contents of `found`.
    fn gather(self, tree: &KdTree, query: [f32; 3], found: &mut Vec<Neighbor>) {
        match self {
            Self::Nearest(k) => tree.k_nearest(query, k, found),
            Self::Within(radius) => tree.within(query, radius, found),
            Self::NearestWithin(k, radius) => {
                tree.k_nearest(query, k, found);
                found.truncate(found.partition_point(|n| n.squared_distance() <= radius * radius));
            }
        }
    }
}

/// Least-squares normal and curvature of `points`, summed about `center`; `None` when they span no plane.
///
/// They span none when there are fewer than three or when they lie on a line, as closely as `f32` coordinates
/// can tell. The sign of the normal carries no meaning.
pub fn fit_normal(
    center: [f32; 3],
    points: impl IntoIterator<Item = [f32; 3]>,
) -> Option<([f64; 3], f64)> {
    let magnitude = center.iter().fold(0.0_f32, |m, c| m.max(c.abs()));
    let plane = Moments::about(center, points).plane(f64::from(f32::EPSILON * magnitude))?;
    Some((plane.normal, plane.curvature))
}

/// Estimates the normal of each point from its neighbours, in parallel.
///
/// A normal points to where its point was measured from where the cloud knows, else so that its largest
/// component in magnitude is positive (x before y before z among equal ones). Results do not depend on the number
/// of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for fewer than three neighbours or a radius that is not positive,
/// [`Error::Cancelled`].
pub fn estimate_normals(
    cloud: &PointCloud,
    neighborhood: Neighborhood,
    progress: &dyn Progress,
) -> Result<Normals> {
    neighborhood.check()?;
    let positions = cloud.positions();
    let tree = KdTree::new(positions)?;
    let mut normals = vec![[0.0; 3]; positions.len()];
    let mut curvatures = vec![0.0; positions.len()];
    let meter = Meter::new(progress, "normals", positions.len().div_ceil(BATCH));
    let unknown = AtomicUsize::new(0);
    let chunks = normals.chunks_mut(BATCH).zip(curvatures.chunks_mut(BATCH));
    parallel::try_for_each(chunks, |chunk, (normals, curvatures)| {
        let mut found = Vec::new();
        for (j, (normal, curvature)) in normals.iter_mut().zip(curvatures).enumerate() {
            let i = chunk * BATCH + j;
            let position = positions[i];
            neighborhood.gather(&tree, position, &mut found);
            match fit_normal(position, found.iter().map(|n| positions[n.index()])) {
                Some((direction, share)) => {
                    let viewpoint = cloud.local_viewpoint(i);
                    *normal = orient_normal(direction, position, viewpoint);
                    *curvature = share as f32;
                }
                None => {
                    unknown.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
        meter.step()
    })?;
    Ok(Normals { normals, curvatures, unknown: unknown.into_inner() })
}

/// The normal with the sign that [`estimate_normals`] promises.
pub fn orient_normal(
    normal: [f64; 3],
    position: [f32; 3],
    viewpoint: Option<[f32; 3]>,
) -> [f32; 3] {
    let towards = viewpoint.map_or(0.0, |viewpoint| {
        (0..3).map(|a| normal[a] * (f64::from(viewpoint[a]) - f64::from(position[a]))).sum()
    });
    let positive = if towards == 0.0 {
        let largest = (1..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m });
        normal[largest] > 0.0
    } else {
        towards > 0.0
    };
    normal.map(|c| if positive { c as f32 } else { -c as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{CloudParts, Viewpoints};
    use surfabet_base::Silent;

    fn cloud(positions: Vec<[f32; 3]>, viewpoint: Option<[f64; 3]>) -> PointCloud {
        let index = vec![0; positions.len()];
        let viewpoints = viewpoint.map(|v| Viewpoints { origins: vec![v], index });
        PointCloud::from_parts(CloudParts { positions, viewpoints, ..CloudParts::default() })
            .unwrap()
            .0
    }

    fn grid(f: impl Fn(f32, f32) -> [f32; 3]) -> Vec<[f32; 3]> {
        (0..400).map(|i| f((i % 20) as f32 * 0.1, (i / 20) as f32 * 0.1)).collect()
    }

    fn sphere() -> Vec<[f32; 3]> {
        // A Fibonacci lattice of radius 2.
        (0..4000)
            .map(|i| {
                let z = 1.0 - (2 * i + 1) as f64 / 4000.0;
                let angle = i as f64 * 2.399_963_229_728_653;
                let r = (1.0 - z * z).sqrt();
                [(2.0 * r * angle.cos()) as f32, (2.0 * r * angle.sin()) as f32, (2.0 * z) as f32]
            })
            .collect()
    }

    #[test]
    fn a_plane_has_its_normal_and_no_curvature() {
        // 6x + 3y - 2z = 0, normal (6, 3, -2) / 7: the largest component, x, comes out positive.
        let plane = cloud(grid(|x, y| [x, y, 3.0 * x + 1.5 * y]), None);
        for n in [
            Neighborhood::Nearest(9),
            Neighborhood::Within(0.5),
            Neighborhood::NearestWithin(12, 0.6),
        ] {
            let found = estimate_normals(&plane, n, &Silent).unwrap();
            assert_eq!(found.unknown, 0);
            for (normal, curvature) in found.normals.iter().zip(&found.curvatures) {
                for (c, e) in normal.iter().zip([6.0 / 7.0, 3.0 / 7.0, -2.0 / 7.0]) {
                    assert!((c - e).abs() < 1e-4, "{normal:?}");
                }
                assert!(*curvature < 1e-9);
            }
        }
    }

    #[test]
    fn a_sphere_seen_from_its_centre_has_radial_normals() {
        let points = sphere();
        let found = estimate_normals(
            &cloud(points.clone(), Some([0.0; 3])),
            Neighborhood::Nearest(12),
            &Silent,
        )
        .unwrap();
        for (p, n) in points.iter().zip(&found.normals) {
            let inward: f32 = (0..3).map(|a| -p[a] * n[a] / 2.0).sum();
            assert!(inward > 0.998, "{p:?} {n:?}");
        }
    }

    #[test]
    fn utm_coordinates_change_nothing() {
        let near = cloud(grid(|x, y| [x, y, 0.3 * x]), None);
        let mut parts = near.clone().into_parts();
        parts.origin = [500_000.0, 5_400_000.0, 300.0];
        let far = PointCloud::from_parts(parts).unwrap().0;
        let of = |c| estimate_normals(c, Neighborhood::Nearest(8), &Silent).unwrap();
        assert_eq!(of(&near), of(&far));
    }

    #[test]
    fn collinear_few_and_identical_points_are_unknown() {
        let diagonal: Vec<[f32; 3]> =
            (0..50).map(|i| [0.1, 0.37, 0.73].map(|c| c * i as f32 + 100.0)).collect();
        for positions in [diagonal, vec![[1.0; 3]; 30], vec![[0.0; 3], [1.0; 3]], vec![]] {
            let n = positions.len();
            let found =
                estimate_normals(&cloud(positions, None), Neighborhood::Nearest(8), &Silent)
                    .unwrap();
            assert_eq!(found.unknown, n);
            assert!(found.normals.iter().all(|&n| n == [0.0; 3]));
        }
    }

    #[test]
    fn refuses_neighbourhoods_that_cannot_span_a_plane() {
        let c = cloud(vec![[0.0; 3]], None);
        for n in [
            Neighborhood::Nearest(2),
            Neighborhood::Within(0.0),
            Neighborhood::NearestWithin(5, f32::NAN),
        ] {
            assert!(estimate_normals(&c, n, &Silent).is_err());
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let c = cloud(sphere(), None);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| estimate_normals(&c, Neighborhood::Nearest(10), &Silent).unwrap())
        };
        assert_eq!(run(1), run(2));
        assert_eq!(run(1), run(8));
    }
}
