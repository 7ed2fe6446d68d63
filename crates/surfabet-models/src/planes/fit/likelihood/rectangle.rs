//! The density of points about a rectangle: even over it, blurred by noise along all axes.

use crate::planes::constants::{DENSITY_SIGMAS, LEAST_SIDE_SIGMAS};
use crate::planes::patch::Frame;
use crate::vector::{cross, distance, dot, length, minus};

/// Parameters of a rectangle: two tilts, its turn in the plane, its offset along the normal, and its four edges.
pub(super) const PARAMETERS: usize = 8;

/// Parts along each side in which points are counted.
const PARTS: usize = 4;

/// A rectangle in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rectangle {
    /// Its plane and axes, about its middle.
    pub frame: Frame,
    /// Half its sides, metres.
    pub half: [f64; 2],
}

/// Logarithm of a density at a point and its derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scores {
    /// Logarithm of the density, per cubic metre.
    pub log: f64,
    /// By the parameters of the rectangle.
    pub by: [f64; PARAMETERS],
    /// By sigma.
    pub by_sigma: f64,
}

/// `ln X` of the even density blurred along one axis, and its derivatives.
struct Side {
    log: f64,
    by_position: f64,
    by_low: f64,
    by_high: f64,
    by_sigma: f64,
}

impl Rectangle {
    /// Logarithm of the density at a point and its derivatives; `None` too far from the rectangle to count.
    ///
    /// With the coordinates `(x, y, z)` of the point about the middle, half sides `(a, b)` and noise `sigma`:
    ///
    /// ```text
    /// f = N(z; sigma) X(x; a) X(y; b),   X(x; a) = (erf((x + a) / q) - erf((x - a) / q)) / (4 a),   q = sqrt(2) sigma
    /// ```
    pub fn scores(&self, p: [f64; 3], sigma: f64) -> Option<Scores> {
        let frame = &self.frame;
        let d: [f64; 3] = std::array::from_fn(|a| p[a] - frame.center[a]);
        let along = |axis: [f64; 3]| d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2];
        let reach = DENSITY_SIGMAS * sigma;
        let z = along(frame.normal);
        if z.abs() > reach {
            return None;
        }
        let (x, y) = (along(frame.u), along(frame.v));
        if x.abs() > self.half[0] + reach || y.abs() > self.half[1] + reach {
            return None;
        }
        let (side_x, side_y) = (blurred(x, self.half[0], sigma)?, blurred(y, self.half[1], sigma)?);
        let (gx, gy) = (side_x.by_position, side_y.by_position);
        let gz = -z / (sigma * sigma);
        let log_normal = -0.5 * z * z / (sigma * sigma) - sigma.ln() - HALF_LOG_TAU;
        Some(Scores {
            log: log_normal + side_x.log + side_y.log,
            by: [
                gy * z - gz * y,
                gz * x - gx * z,
                gx * y - gy * x,
                -gz,
                side_x.by_low,
                side_x.by_high,
                side_y.by_low,
                side_y.by_high,
            ],
            by_sigma: z * z / sigma.powi(3) - 1.0 / sigma + side_x.by_sigma + side_y.by_sigma,
        })
    }

    /// The rectangle with its parameters changed by `step`, a turn by the first three about its axes among them.
    pub fn moved(&self, step: &[f64], sigma: f64) -> Self {
        let Frame { center, u, v, normal } = self.frame;
        let axis: [f64; 3] =
            std::array::from_fn(|k| step[0] * u[k] + step[1] * v[k] + step[2] * normal[k]);
        let (u, normal) = (turned(u, axis), turned(normal, axis));
        let v = cross(normal, u);
        let sides: [[f64; 2]; 2] = std::array::from_fn(|k| {
            let low = -self.half[k] + step[4 + 2 * k];
            let high = self.half[k] + step[5 + 2 * k];
            let middle = 0.5 * (low + high);
            [middle, (0.5 * (high - low)).max(0.5 * LEAST_SIDE_SIGMAS * sigma)]
        });
        let center = std::array::from_fn(|k| {
            center[k] + step[3] * normal[k] + sides[0][0] * u[k] + sides[1][0] * v[k]
        });
        Self { frame: Frame { center, u, v, normal }, half: [sides[0][1], sides[1][1]] }
    }

    /// How unevenly points lie over the rectangle: the standard deviation of their number in a sixteenth of it as a share of
    /// the mean, without what chance makes of it.
    pub fn unevenness(&self, points: impl Iterator<Item = [f64; 3]>) -> f64 {
        let mut counts = [0.0; PARTS * PARTS];
        for p in points {
            let d = minus(p, self.frame.center);
            let part = |along: f64, half: f64| {
                let at = (along / half + 1.0) * 0.5 * PARTS as f64;
                (0.0..PARTS as f64).contains(&at).then_some(at as usize)
            };
            let x = part(dot(d, self.frame.u), self.half[0]);
            let y = part(dot(d, self.frame.v), self.half[1]);
            if let (Some(x), Some(y)) = (x, y) {
                counts[y * PARTS + x] += 1.0;
            }
        }
        let n = counts.len() as f64;
        let mean = counts.iter().sum::<f64>() / n;
        let variance = counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (n - 1.0);
        if mean > 0.0 { (variance - mean).max(0.0).sqrt() / mean } else { f64::INFINITY }
    }

    /// The middle of the low (`side` -1) or the high (1) edge along an axis.
    pub fn edge(&self, axis: usize, side: f64) -> [f64; 3] {
        let mut at = [0.0; 2];
        at[axis] = side * self.half[axis];
        self.frame.at(at)
    }

    /// True for a place that is this near to the rectangle's plane, and beside it no further away.
    pub fn is_within(&self, p: [f64; 3], reach: f64) -> bool {
        let d = minus(p, self.frame.center);
        dot(d, self.frame.normal).abs() <= reach
            && dot(d, self.frame.u).abs() <= self.half[0] + reach
            && dot(d, self.frame.v).abs() <= self.half[1] + reach
    }

    /// True when the spheres around both rectangles overlap.
    pub fn is_near(&self, other: &Self) -> bool {
        let radius = |r: &Self| r.half[0].hypot(r.half[1]);
        distance(self.frame.center, other.frame.center) < radius(self) + radius(other)
    }

    /// Area, square metres.
    pub fn area(&self) -> f64 {
        4.0 * self.half[0] * self.half[1]
    }
}

/// `ln(2 pi) / 2`.
const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_8;

/// The blurred density along one axis at `x`, for sides at `-half` and `half`; `None` where it is zero.
fn blurred(x: f64, half: f64, sigma: f64) -> Option<Side> {
    let scale = std::f64::consts::FRAC_1_SQRT_2 / sigma;
    let mass = 0.5 * (libm::erf((x + half) * scale) - libm::erf((x - half) * scale));
    // Below that the difference is rounding.
    if mass < 1e-12 {
        return None;
    }
    let bell = |t: f64| (-0.5 * (t / sigma).powi(2) - HALF_LOG_TAU).exp() / (sigma * mass);
    let (low, high) = (bell(x + half), bell(x - half));
    let per_side = 0.5 / half;
    Some(Side {
        log: (mass * per_side).ln(),
        by_position: low - high,
        by_low: per_side - low,
        by_high: high - per_side,
        by_sigma: ((x - half) * high - (x + half) * low) / sigma,
    })
}

/// A vector turned about an axis by the axis' length, in radians (Rodrigues).
fn turned(v: [f64; 3], axis: [f64; 3]) -> [f64; 3] {
    let angle = length(axis);
    if angle == 0.0 {
        return v;
    }
    let k = axis.map(|c| c / angle);
    let (sine, cosine) = angle.sin_cos();
    let (across, along) = (cross(k, v), dot(k, v));
    std::array::from_fn(|a| cosine * v[a] + sine * across[a] + (1.0 - cosine) * along * k[a])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle() -> Rectangle {
        let normal = crate::vector::unit([0.3, -0.2, 1.0]);
        let frame = Frame::with_normal([1.0, 2.0, -0.5], normal).turned([0.8, 0.6]);
        Rectangle { frame, half: [0.7, 0.3] }
    }

    #[test]
    fn unevenness_is_the_spread_of_the_density() {
        let rectangle = rectangle();
        let at = |i: usize, skew: f64| {
            let [x, y] = [i % 100, i / 100].map(|k| (k as f64 + 0.5) / 100.0);
            // The density along x falls as 1 / (2 skew x) where skew is not zero.
            let x = if skew > 0.0 { x.powf(skew) } else { x };
            let p = [(2.0 * x - 1.0) * rectangle.half[0], (2.0 * y - 1.0) * rectangle.half[1]];
            rectangle.frame.at(p)
        };
        assert_eq!(rectangle.unevenness((0..10_000).map(|i| at(i, 0.0))), 0.0);
        // Shares of 0.5, 0.207, 0.159 and 0.134 in the quarters along x: 0.606 of the mean, over 16 parts.
        let uneven = rectangle.unevenness((0..10_000).map(|i| at(i, 2.0)));
        assert!((uneven - 0.606).abs() < 0.01, "{uneven}");
    }

    #[test]
    fn the_density_has_mass_one() {
        let (rectangle, sigma) = (rectangle(), 0.2);
        let step = 0.05;
        let mut mass = 0.0;
        let n = 80;
        for i in 0..n * n * n {
            let at = [i % n, i / n % n, i / (n * n)].map(|k| (k as f64 - 39.5) * step);
            let p = std::array::from_fn(|a| rectangle.frame.center[a] + at[a]);
            mass += rectangle.scores(p, sigma).map_or(0.0, |s| s.log.exp()) * step.powi(3);
        }
        assert!((mass - 1.0).abs() < 1e-6, "{mass}");
    }

    #[test]
    fn scores_are_the_derivatives_of_the_logarithm() {
        let (rectangle, sigma, h) = (rectangle(), 0.2, 1e-5);
        for at in [[0.1, 0.2, 0.1], [0.9, -0.4, -0.3], [-0.8, 0.1, 0.25]] {
            let p = std::array::from_fn(|a| rectangle.frame.center[a] + at[a]);
            let log = |r: &Rectangle, sigma: f64| r.scores(p, sigma).unwrap().log;
            let scores = rectangle.scores(p, sigma).unwrap();
            for k in 0..PARAMETERS {
                let moved = |by: f64| {
                    let mut step = [0.0; PARAMETERS];
                    step[k] = by;
                    log(&rectangle.moved(&step, sigma), sigma)
                };
                let wanted = (moved(h) - moved(-h)) / (2.0 * h);
                assert!((scores.by[k] - wanted).abs() < 1e-5, "{k}: {} {wanted}", scores.by[k]);
            }
            let wanted = (log(&rectangle, sigma + h) - log(&rectangle, sigma - h)) / (2.0 * h);
            assert!((scores.by_sigma - wanted).abs() < 1e-5, "{} {wanted}", scores.by_sigma);
        }
    }
}
