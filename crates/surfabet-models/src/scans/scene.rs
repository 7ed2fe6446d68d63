//! The scene that words are learned from: the distinct points of a cloud, each with the deviation allowed there (eq. 13).

use surfabet_base::parallel;
use surfabet_geom::{PointCloud, Progress};

use super::deviation::{Deviation, LEAST_SIGMA, median};
use crate::error::{Error, Result};

/// The distinct points of a cloud, sorted by position: the order of the input does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// World position of the frame, metres.
    pub origin: [f64; 3],
    /// Positions relative to `origin`, metres, ascending by x, then y, then z.
    pub positions: Vec<[f32; 3]>,
    /// Where each point was measured from, relative to `origin`; empty when unknown.
    pub viewpoints: Vec<[f32; 3]>,
    /// Distance from the sensor per point, metres; empty when unknown.
    pub ranges: Vec<f32>,
    /// Sigma per point, metres.
    pub sigma: Vec<f32>,
    /// Mean colour of each point's duplicates.
    pub colors: Option<Vec<[u8; 3]>>,
    /// Mean intensity of each point's duplicates.
    pub intensities: Option<Vec<f32>>,
    /// The deviation that was applied: values that were not given are estimated. Without ranges, `angular_resolution` is
    /// `None`.
    pub deviation: Deviation,
    /// Points that repeat another.
    pub duplicates: usize,
    /// Points nearer to the sensor than `min_range`.
    pub too_near: usize,
}

impl Scene {
    /// Takes the distinct points of `cloud` whose range is at least `min_range`, and all whose range is unknown. Both
    /// `deviation` and `min_range` are those of options that have been checked.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`] when no point is left, [`Error::Cancelled`].
    pub(crate) fn new(
        cloud: &PointCloud,
        deviation: Deviation,
        min_range: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let keys = sorted_points(cloud, min_range, progress)?;
        progress.check()?;
        let too_near = cloud.len() - keys.len();
        let has_range = !keys.is_empty() && keys.iter().all(|&k| range(cloud, number(k)).is_some());
        // The points at each place.
        let places: Vec<&[u128]> = keys.chunk_by(|&a, &b| is_one_place(a, b)).collect();
        let firsts = parallel::map(&places, |same| number(same[0]));
        let with_viewpoint: &[u32] = if cloud.viewpoints().is_some() { &firsts } else { &[] };
        let with_range: &[u32] = if has_range { &firsts } else { &[] };
        let mean = |same: &[u128], value: &dyn Fn(usize) -> f64| {
            same.iter().map(|&k| value(number(k) as usize)).sum::<f64>() / same.len() as f64
        };
        let mut scene = Self {
            origin: cloud.origin(),
            positions: parallel::map(&firsts, |&i| position(cloud, i)),
            viewpoints: parallel::gather(with_viewpoint.len(), |k, found| {
                found.extend(cloud.local_viewpoint(with_viewpoint[k] as usize));
            }),
            ranges: parallel::gather(with_range.len(), |k, found| {
                found.extend(range(cloud, with_range[k]));
            }),
            sigma: Vec::new(),
            colors: cloud.colors().map(|colors| {
                let channel = |same: &[u128], c: usize| {
                    mean(same, &|i| f64::from(colors[i][c])).round() as u8
                };
                parallel::map(&places, |same| std::array::from_fn(|c| channel(same, c)))
            }),
            intensities: cloud.intensities().map(|values| {
                parallel::map(&places, |same| mean(same, &|i| f64::from(values[i])) as f32)
            }),
            deviation,
            duplicates: keys.len() - places.len(),
            too_near,
        };
        if scene.positions.is_empty() {
            return Err(Error::EmptyCloud);
        }
        progress.check()?;
        scene.set_sigma(progress)?;
        Ok(scene)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Never: a scene has at least one point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The median of sigma over the points, metres.
    pub fn median_sigma(&self) -> f64 {
        // A scene has at least one point.
        median(self.sigma.iter().map(|&s| f64::from(s)).collect()).unwrap_or(LEAST_SIGMA)
    }

    /// The points at `indices`, in that order.
    pub(crate) fn select(&self, indices: &[u32]) -> Self {
        fn pick<T: Copy>(values: &[T], indices: &[u32]) -> Vec<T> {
            // A column of a scene is empty or has a value per point.
            indices.iter().filter_map(|&i| values.get(i as usize).copied()).collect()
        }
        Self {
            positions: pick(&self.positions, indices),
            viewpoints: pick(&self.viewpoints, indices),
            ranges: pick(&self.ranges, indices),
            sigma: pick(&self.sigma, indices),
            colors: self.colors.as_ref().map(|v| pick(v, indices)),
            intensities: self.intensities.as_ref().map(|v| pick(v, indices)),
            ..*self
        }
    }
}

/// The points that are not nearer than `min_range`, sorted by position, then by attributes, so that the first of several
/// at one position is always the same. A key has a point's number in its lowest 32 bits and its place above.
fn sorted_points(cloud: &PointCloud, min_range: f64, progress: &dyn Progress) -> Result<Vec<u128>> {
    let far = |i: u32| range(cloud, i).is_none_or(|r| f64::from(r) >= min_range);
    // Ascending as the numbers are.
    let ordered = |c: f32| {
        let bits = c.to_bits();
        u128::from(if c.is_sign_negative() { !bits } else { bits | 1 << 31 })
    };
    let key = |i: u32| {
        let [x, y, z] = position(cloud, i).map(ordered);
        x << 96 | y << 64 | z << 32 | u128::from(i)
    };
    let mut keys: Vec<u128> = parallel::gather(cloud.len(), |i, keys| {
        keys.extend(Some(i as u32).filter(|&i| far(i)).map(key));
    });
    progress.check()?;
    let attributes = |key: u128| {
        let i = number(key) as usize;
        let viewpoint = cloud.viewpoints().map(|v| v.index[i]);
        let range = cloud.ranges().map_or(0, |r| r[i].to_bits());
        let color = cloud.colors().map(|c| c[i]);
        let intensity = cloud.intensities().map_or(0, |v| v[i].to_bits());
        (viewpoint, range, color, intensity)
    };
    parallel::sort_wide_keys(&mut keys);
    let places = keys.chunk_by_mut(|&a, &b| is_one_place(a, b)).filter(|same| same.len() > 1);
    places.for_each(|same| same.sort_unstable_by_key(|&key| attributes(key)));
    Ok(keys)
}

/// The number of the point of a key.
fn number(key: u128) -> u32 {
    key as u32
}

/// Whether the points of two keys are at one place.
fn is_one_place(a: u128, b: u128) -> bool {
    a >> 32 == b >> 32
}

/// Position of point `i`, minus zero as zero.
fn position(cloud: &PointCloud, i: u32) -> [f32; 3] {
    cloud.positions()[i as usize].map(|c| c + 0.0)
}

/// Distance of point `i` from its sensor: the one stored, else that to its viewpoint.
fn range(cloud: &PointCloud, i: u32) -> Option<f32> {
    let i = i as usize;
    let stored = cloud.ranges().map(|r| r[i]).filter(|&r| r > 0.0);
    stored.or_else(|| {
        let [from, to] = [cloud.local_viewpoint(i)?, cloud.positions()[i]];
        let squared: f64 = (0..3).map(|a| (f64::from(to[a]) - f64::from(from[a])).powi(2)).sum();
        Some(squared.sqrt() as f32)
    })
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{CloudParts, Silent, Viewpoints};

    use super::*;

    /// A wall 2 m away, a point every 20 mm, every point twice.
    fn wall() -> CloudParts {
        let grid = (0..10_000).map(|i| (i / 2 % 50, i / 2 / 50));
        let positions: Vec<[f32; 3]> =
            grid.map(|(y, z)| [2.0, y as f32 * 0.02 - 0.5, z as f32 * 0.02 - 1.0]).collect();
        let viewpoints = Viewpoints { origins: vec![[0.0; 3]], index: vec![0; positions.len()] };
        CloudParts { positions, viewpoints: Some(viewpoints), ..CloudParts::default() }
    }

    #[test]
    fn sigma_follows_equation_13() {
        let (cloud, _) = PointCloud::from_parts(wall()).unwrap();
        let alpha = 0.01;
        let rule = Deviation { angular_resolution: Some(alpha), ..Deviation::default() };
        let scene = Scene::new(&cloud, rule, 0.0, &Silent).unwrap();
        assert_eq!((scene.len(), scene.duplicates), (5000, 5000));
        for (sigma, p) in scene.sigma.iter().zip(&scene.positions) {
            let range = p.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
            assert!((f64::from(*sigma) - 3.0 * (0.5 * alpha).tan() * range).abs() < 1e-6);
        }
    }

    #[test]
    fn resolution_and_noise_are_estimated() {
        let (cloud, _) = PointCloud::from_parts(wall()).unwrap();
        let rule = Deviation { noise: None, ..Deviation::default() };
        let scene = Scene::new(&cloud, rule, 0.0, &Silent).unwrap();
        let alpha = scene.deviation.angular_resolution.unwrap();
        assert!((0.008..0.011).contains(&alpha), "{alpha}");
        assert!(scene.deviation.noise.unwrap() < 1e-4);
        // Without a sensor, the spacing takes the place of the range.
        let parts = CloudParts { viewpoints: None, ..wall() };
        let (cloud, _) = PointCloud::from_parts(parts).unwrap();
        let scene = Scene::new(&cloud, rule, 0.5, &Silent).unwrap();
        assert!(scene.sigma.iter().all(|s| (0.025..0.04).contains(s)));
        assert_eq!(scene.deviation.angular_resolution, None);
    }

    #[test]
    fn the_order_of_the_input_does_not_matter() {
        let parts = wall();
        let mut turned = wall();
        turned.positions.reverse();
        let clouds = [parts, turned].map(|p| PointCloud::from_parts(p).unwrap().0);
        let [a, b] = clouds.map(|c| Scene::new(&c, Deviation::default(), 2.1, &Silent).unwrap());
        assert_eq!(a, b);
        assert!(a.too_near > 0 && a.ranges.iter().all(|&r| r >= 2.1));
    }

    #[test]
    fn a_scene_has_points() {
        let (cloud, _) = PointCloud::from_parts(wall()).unwrap();
        assert_eq!(Scene::new(&cloud, Deviation::default(), 50.0, &Silent), Err(Error::EmptyCloud));
    }
}
