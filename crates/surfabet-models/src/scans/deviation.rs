//! The deviation that is allowed at each point (eq. 13), and the estimation of what is not given of it.

use surfabet_base::parallel;
use surfabet_geom::{KdTree, Progress, estimate_noise};

use super::Scene;
use crate::error::Result;

/// Points that the angular resolution and the noise are estimated from; bounds the time.
const MAX_SAMPLED: usize = 4096;

/// Least deviation, metres: that of a point at the sensor itself, and where no spacing is known.
pub(super) const LEAST_SIGMA: f64 = 1e-4;

/// Neighbours that give the spacing of a point: enough to reach the next ring of a scanner whose rings are apart.
const SPACING_NEIGHBORS: usize = 8;

/// Angular resolution of a single point, radians: it has no neighbour, and any value above zero does.
const LONE_POINT_RESOLUTION: f64 = 0.01;

/// How far a decoded point may lie from a measured one (eq. 13):
/// `sigma = sigma_scale * hypot(tan(angular_resolution / 2) * range, noise)`.
///
/// The paper has no noise: its scanner's spacing was larger. Where a point's range is not known, half the median
/// spacing of the points stands for the first term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Lambda, a factor, not given in the paper. At 1 a random point of a surface that was sampled at the angular
    /// resolution is farther than sigma from every sample in more than a fifth of the cases.
    pub sigma_scale: f64,
    /// Alpha, the angle between neighbouring beams, radians; estimated when not given, as the median over points of
    /// the angle to the eighth neighbour among the beams from the same viewpoint, over the root of two. That is the
    /// angle of a square lattice, and of one with two angles their root mean square, or less where rows are far apart.
    pub angular_resolution: Option<f64>,
    /// Standard deviation of a measured point about its surface, metres; estimated when not given, as the median
    /// deviation of neighbouring points from their plane ([`surfabet_geom::Survey::noise`]).
    pub noise: Option<f64>,
}

impl Default for Deviation {
    /// Lambda 3, the resolution estimated, no noise: the paper's rule.
    fn default() -> Self {
        Self { sigma_scale: 3.0, angular_resolution: None, noise: Some(0.0) }
    }
}

impl Scene {
    /// Sets sigma of every point, after estimating what is not given.
    pub(super) fn set_sigma(&mut self, progress: &dyn Progress) -> Result<()> {
        let noise = match self.deviation.noise {
            Some(noise) => noise,
            None => estimate_noise(&self.positions)?,
        };
        progress.check()?;
        let spread: Vec<f64> = if self.ranges.is_empty() {
            self.deviation.angular_resolution = None;
            let tree = KdTree::new(&self.positions)?;
            let spacing_at = |i: usize| spacing(&self.positions, &tree, i);
            let spacing = median(sampled(self.len(), spacing_at)).unwrap_or(0.0);
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

    /// Median angle between neighbouring beams over the points of the viewpoint that saw most.
    ///
    /// Where viewpoints are known it is that between directions, which the slant of a surface does not widen; else
    /// `atan(spacing / range)` stands for it.
    fn estimated_resolution(&self) -> Result<f64> {
        if self.viewpoints.is_empty() {
            let tree = KdTree::new(&self.positions)?;
            let angles = sampled(self.len(), |i| {
                let range = f64::from(self.ranges[i]);
                let spacing = spacing(&self.positions, &tree, i).filter(|_| range > 0.0);
                spacing.map(|d| (d / range).atan())
            });
            return Ok(median(angles).unwrap_or(LONE_POINT_RESOLUTION));
        }
        let mut seen: Vec<u32> = (0..self.len() as u32).collect();
        let from = |i: u32| self.viewpoints[i as usize].map(f32::to_bits);
        seen.sort_by_key(|&i| (from(i), i));
        let groups = seen.chunk_by(|&i, &j| from(i) == from(j));
        let mut seen = groups.max_by_key(|g| g.len()).map(<[u32]>::to_vec).unwrap_or_default();
        seen.sort_unstable();
        let directions: Vec<[f32; 3]> = seen.iter().filter_map(|&i| self.direction(i)).collect();
        let tree = KdTree::new(&directions)?;
        let angles = sampled(directions.len(), |i| beam_angle(&directions, &tree, i));
        Ok(median(angles).unwrap_or(LONE_POINT_RESOLUTION))
    }

    /// The unit vector from the sensor to a point; `None` for a point at the sensor.
    fn direction(&self, i: u32) -> Option<[f32; 3]> {
        let (p, v) = (self.positions[i as usize], self.viewpoints[i as usize]);
        let d: [f64; 3] = std::array::from_fn(|a| f64::from(p[a]) - f64::from(v[a]));
        let length = d.iter().map(|c| c * c).sum::<f64>().sqrt();
        (length > 0.0).then(|| d.map(|c| (c / length) as f32))
    }
}

/// The values of `measure` at points spread evenly over `n`, where there are any.
fn sampled(n: usize, measure: impl Fn(usize) -> Option<f64> + Send + Sync) -> Vec<f64> {
    let step = n.div_ceil(MAX_SAMPLED).max(1);
    parallel::gather(n.div_ceil(step), |k, values| values.extend(measure(k * step)))
}

/// Side of the square that point `i` has for itself: `sqrt(pi r^2 / k)`, with r the distance of its k-th neighbour.
fn spacing(positions: &[[f32; 3]], tree: &KdTree, i: usize) -> Option<f64> {
    let mut near = Vec::new();
    tree.k_nearest(positions[i], SPACING_NEIGHBORS + 1, &mut near);
    let last = near.last().filter(|_| near.len() > 1)?;
    let squares = (near.len() - 1) as f64;
    Some((std::f64::consts::PI * f64::from(last.squared_distance()) / squares).sqrt())
}

/// Angle between direction `i` and its neighbours: in a square lattice the eighth neighbour is at the corner, the root of
/// two sides away, and in one of two sides at the root of the sum of their squares.
fn beam_angle(directions: &[[f32; 3]], tree: &KdTree, i: usize) -> Option<f64> {
    let mut near = Vec::new();
    tree.k_nearest(directions[i], SPACING_NEIGHBORS + 1, &mut near);
    let corner = near.last().filter(|_| near.len() > 1)?;
    let chord = f64::from(corner.squared_distance()).sqrt();
    Some(2.0 * (0.5 * chord).min(1.0).asin() / std::f64::consts::SQRT_2)
        .filter(|&angle| angle > 0.0)
}

/// The middle of the sorted values, of an even number the upper one; `None` of none.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
