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
        let order = sorted_points(cloud, min_range, progress)?;
        progress.check()?;
        let mut scene = Self {
            origin: cloud.origin(),
            positions: Vec::new(),
            viewpoints: Vec::new(),
            ranges: Vec::new(),
            sigma: Vec::new(),
            colors: cloud.colors().map(|_| Vec::new()),
            intensities: cloud.intensities().map(|_| Vec::new()),
            deviation,
            duplicates: 0,
            too_near: cloud.len() - order.len(),
        };
        let has_range = !order.is_empty() && order.iter().all(|&i| range(cloud, i).is_some());
        for same in order.chunk_by(|&i, &j| position(cloud, i) == position(cloud, j)) {
            scene.push(cloud, same, has_range);
        }
        if scene.positions.is_empty() {
            return Err(Error::EmptyCloud);
        }
        progress.check()?;
        scene.set_sigma(progress)?;
        Ok(scene)
    }

    /// Adds points of `cloud` at one position as one, with the viewpoint and range of the first and mean attributes.
    fn push(&mut self, cloud: &PointCloud, same: &[u32], has_range: bool) {
        self.positions.push(position(cloud, same[0]));
        self.duplicates += same.len() - 1;
        self.viewpoints.extend(cloud.local_viewpoint(same[0] as usize));
        self.ranges.extend(range(cloud, same[0]).filter(|_| has_range));
        let mean = |sum: f64| sum / same.len() as f64;
        if let (Some(kept), Some(colors)) = (&mut self.colors, cloud.colors()) {
            kept.push(std::array::from_fn(|c| {
                mean(same.iter().map(|&i| f64::from(colors[i as usize][c])).sum()).round() as u8
            }));
        }
        if let (Some(kept), Some(values)) = (&mut self.intensities, cloud.intensities()) {
            kept.push(mean(same.iter().map(|&i| f64::from(values[i as usize])).sum()) as f32);
        }
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
/// at one position is always the same.
fn sorted_points(cloud: &PointCloud, min_range: f64, progress: &dyn Progress) -> Result<Vec<u32>> {
    let far = |&i: &u32| range(cloud, i).is_none_or(|r| f64::from(r) >= min_range);
    let mut order: Vec<u32> = parallel::gather(cloud.len(), |i, order| {
        order.extend(Some(i as u32).filter(far));
    });
    progress.check()?;
    let attributes = |i: u32| {
        let i = i as usize;
        let viewpoint = cloud.viewpoints().map(|v| v.index[i]);
        let range = cloud.ranges().map_or(0, |r| r[i].to_bits());
        let color = cloud.colors().map(|c| c[i]);
        let intensity = cloud.intensities().map_or(0, |v| v[i].to_bits());
        (viewpoint, range, color, intensity)
    };
    parallel::sort_numbers_by(&mut order, &|i, j| {
        let [a, b] = [i, j].map(|k| position(cloud, k));
        a[0].total_cmp(&b[0])
            .then(a[1].total_cmp(&b[1]))
            .then(a[2].total_cmp(&b[2]))
            .then_with(|| attributes(i).cmp(&attributes(j)))
    });
    Ok(order)
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
