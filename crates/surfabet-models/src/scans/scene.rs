//! The scene that words are learned from and held against: distinct points, each with the deviation allowed there
//! (eq. 13).

use rayon::prelude::*;
use surfabet_geom::{KdTree, Moments, PointCloud, Progress};

use crate::error::{Error, Result};

/// Points that the angular resolution and the noise are estimated from.
const SAMPLE: usize = 4096;

/// Least deviation, metres: that of a point at the sensor itself, and where nothing tells a spacing.
const LEAST_SIGMA: f64 = 1e-4;

/// Neighbours that tell how far apart points lie: enough to reach the next ring of a scanner whose rings are apart.
const SPACING_NEIGHBORS: usize = 8;

/// Neighbours whose plane tells the noise of a point, at least.
const NOISE_NEIGHBORS: usize = 16;

/// Where points are denser, all within this distance tell it, metres: a few neighbours of a fused cloud are less than
/// its noise apart.
const NOISE_RADIUS: f32 = 0.05;

/// How far a decoded point may lie from a measured one, sigma (eq. 13):
/// `sigma_scale * hypot(tan(angular_resolution / 2) * range, noise)`.
///
/// The paper has no noise: its scanner's spacing was larger. Where a point's range is not known, half the median
/// spacing of the points stands for the first term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Lambda, a factor, not given in the paper. At 1 a random point of a surface that was sampled at the angular
    /// resolution is further than sigma from every sample in more than a fifth of the cases.
    pub sigma_scale: f64,
    /// Alpha, the angle between neighbouring beams, radians; estimated when not given, as the median over points of
    /// the side of the square that each has for itself among its eight neighbours from the same viewpoint.
    pub angular_resolution: Option<f64>,
    /// Standard deviation of a measured point about its surface, metres; estimated when not given, as the median
    /// deviation of neighbouring points from their plane: those within 5 cm, but at least 16.
    pub noise: Option<f64>,
}

impl Default for Deviation {
    /// Lambda 3, the resolution estimated, no noise: the paper's rule.
    fn default() -> Self {
        Self { sigma_scale: 3.0, angular_resolution: None, noise: Some(0.0) }
    }
}

/// Distinct points of a cloud in an order of their own, so that the order of the input does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// World position that everything is relative to, metres.
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
    /// The deviation with nothing left to estimate. Without ranges, the angular resolution is none.
    pub deviation: Deviation,
    /// Points that repeat another.
    pub duplicates: usize,
    /// Points nearer to the sensor than the least range.
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
        let range_of = |i: usize| range(cloud, i);
        let all = cloud.positions();
        let far = |&i: &u32| range_of(i as usize).is_none_or(|r| f64::from(r) >= min_range);
        let mut order: Vec<u32> = (0..all.len() as u32).into_par_iter().filter(far).collect();
        let too_near = all.len() - order.len();
        progress.check()?;
        // Zero and minus zero are one place.
        let key = |i: u32| all[i as usize].map(|c| c + 0.0);
        let attributes = |i: u32| {
            let i = i as usize;
            let viewpoint = cloud.viewpoints().map(|v| v.index[i]);
            let range = cloud.ranges().map_or(0, |r| r[i].to_bits());
            let color = cloud.colors().map(|c| c[i]);
            let intensity = cloud.intensities().map_or(0, |v| v[i].to_bits());
            (viewpoint, range, color, intensity)
        };
        order.par_sort_unstable_by(|&i, &j| {
            let [a, b] = [key(i), key(j)];
            a[0].total_cmp(&b[0])
                .then(a[1].total_cmp(&b[1]))
                .then(a[2].total_cmp(&b[2]))
                .then_with(|| attributes(i).cmp(&attributes(j)))
        });
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
            too_near,
        };
        let has_range = !order.is_empty() && order.iter().all(|&i| range_of(i as usize).is_some());
        for same in order.chunk_by(|&i, &j| key(i) == key(j)) {
            let first = same[0] as usize;
            scene.positions.push(key(same[0]));
            scene.duplicates += same.len() - 1;
            scene.viewpoints.extend(cloud.local_viewpoint(first));
            scene.ranges.extend(range_of(first).filter(|_| has_range));
            let mean = |sum: f64| sum / same.len() as f64;
            if let (Some(kept), Some(colors)) = (&mut scene.colors, cloud.colors()) {
                kept.push(std::array::from_fn(|c| {
                    mean(same.iter().map(|&i| f64::from(colors[i as usize][c])).sum()).round() as u8
                }));
            }
            if let (Some(kept), Some(values)) = (&mut scene.intensities, cloud.intensities()) {
                kept.push(mean(same.iter().map(|&i| f64::from(values[i as usize])).sum()) as f32);
            }
        }
        if scene.positions.is_empty() {
            return Err(Error::EmptyCloud);
        }
        progress.check()?;
        scene.allow_deviation(progress)?;
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

    /// Half of all points have a larger sigma, metres.
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

    /// Estimates what is not given, and sets sigma.
    fn allow_deviation(&mut self, progress: &dyn Progress) -> Result<()> {
        let tree = KdTree::new(&self.positions)?;
        progress.check()?;
        let noise = match self.deviation.noise {
            Some(noise) => noise,
            None => self.estimated_noise(&tree),
        };
        progress.check()?;
        let spread: Vec<f64> = if self.ranges.is_empty() {
            self.deviation.angular_resolution = None;
            let apart = |i: usize| spacing(&self.positions, &tree, i);
            let spacing = median(sampled(self.len(), apart)).unwrap_or(0.0);
            vec![0.5 * spacing; self.len()]
        } else {
            let alpha = match self.deviation.angular_resolution {
                Some(alpha) => alpha,
                None => self.estimated_resolution()?,
            };
            self.deviation.angular_resolution = Some(alpha);
            let half = (0.5 * alpha).tan();
            self.ranges.iter().map(|&r| half * f64::from(r)).collect()
        };
        self.deviation.noise = Some(noise);
        let scale = self.deviation.sigma_scale;
        self.sigma =
            spread.iter().map(|s| (scale * s.hypot(noise)).max(LEAST_SIGMA) as f32).collect();
        Ok(())
    }

    /// Median angle between neighbouring points, over the viewpoint that saw most points.
    fn estimated_resolution(&self) -> Result<f64> {
        let mut seen: Vec<u32> = (0..self.len() as u32).collect();
        if !self.viewpoints.is_empty() {
            let from = |i: u32| self.viewpoints[i as usize].map(f32::to_bits);
            seen.sort_by_key(|&i| (from(i), i));
            let groups = seen.chunk_by(|&i, &j| from(i) == from(j));
            seen = groups.max_by_key(|g| g.len()).map(<[u32]>::to_vec).unwrap_or_default();
            seen.sort_unstable();
        }
        let positions: Vec<[f32; 3]> = seen.iter().map(|&i| self.positions[i as usize]).collect();
        let tree = KdTree::new(&positions)?;
        let angles = sampled(positions.len(), |i| {
            let range = f64::from(self.ranges[seen[i] as usize]);
            spacing(&positions, &tree, i).filter(|_| range > 0.0).map(|d| (d / range).atan())
        });
        // One point has no neighbour: any angle does, as long as its sigma is not zero.
        Ok(median(angles).unwrap_or(0.01))
    }

    /// Median deviation of neighbouring points from their plane.
    fn estimated_noise(&self, tree: &KdTree) -> f64 {
        let deviations = sampled(self.len(), |i| {
            let mut near = Vec::new();
            tree.within(self.positions[i], NOISE_RADIUS, &mut near);
            if near.len() < NOISE_NEIGHBORS {
                tree.k_nearest(self.positions[i], NOISE_NEIGHBORS, &mut near);
            }
            let points = near.iter().map(|n| self.positions[n.index()]);
            let axes = Moments::about(self.positions[i], points).principal_axes()?;
            Some(axes.variances[0].sqrt())
        });
        median(deviations).unwrap_or(0.0)
    }
}

/// What `measure` finds at points spread evenly over `n`.
fn sampled(n: usize, measure: impl Fn(usize) -> Option<f64> + Send + Sync) -> Vec<f64> {
    let step = n.div_ceil(SAMPLE).max(1);
    (0..n).into_par_iter().step_by(step).filter_map(measure).collect()
}

/// Side of the square that point `i` has for itself: its nearest neighbours share a disc.
fn spacing(positions: &[[f32; 3]], tree: &KdTree, i: usize) -> Option<f64> {
    let mut near = Vec::new();
    tree.k_nearest(positions[i], SPACING_NEIGHBORS + 1, &mut near);
    let last = near.last().filter(|_| near.len() > 1)?;
    let squares = (near.len() - 1) as f64;
    Some((std::f64::consts::PI * f64::from(last.squared_distance()) / squares).sqrt())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Distance of point `i` from its sensor: the one stored, else that to its viewpoint.
fn range(cloud: &PointCloud, i: usize) -> Option<f32> {
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
    fn resolution_and_noise_are_found() {
        let (cloud, _) = PointCloud::from_parts(wall()).unwrap();
        let rule = Deviation { noise: None, ..Deviation::default() };
        let scene = Scene::new(&cloud, rule, 0.0, &Silent).unwrap();
        let alpha = scene.deviation.angular_resolution.unwrap();
        assert!((0.008..0.011).contains(&alpha), "{alpha}");
        assert!(scene.deviation.noise.unwrap() < 1e-4);
        // Without a sensor, the spacing stands in.
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
