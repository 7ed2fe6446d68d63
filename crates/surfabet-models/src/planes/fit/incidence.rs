//! Noise across a surface and the angle at which it was seen.
//!
//! A laser errs along its rays, so that the points of a surface scatter across it by `sigma_r cos(theta)`, where `theta` is the angle
//! between ray and normal: a wall in front of the sensor appears rougher than one seen at a grazing angle. Other noise, of merged scans or of
//! positions of the sensor, is the same at every angle. Which of both it is, is measured on the flat cells of the cloud.

use crate::planes::constants::{INCIDENCE_GAIN, LEAST_COSINE, LEAST_NOISE_FACTOR, MOST_ALONG_RAYS};

/// How the noise across a surface depends on the angle at which it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::planes::fit) struct Incidence {
    /// Noise along the rays by the median noise across surfaces; `None` where the noise is the same at every angle.
    along_rays: Option<f64>,
}

impl Incidence {
    /// The same noise at every angle.
    pub const EVEN: Self = Self { along_rays: None };

    /// From cells: standard deviation across their plane, mean cosine of the angle between their normal and where they were
    /// seen from, and weight. Noise is along the rays where that makes the deviations of all cells clearly more alike: their
    /// median distance from the median, in logarithms. Where most was seen at a small angle, as the ground of a street, that
    /// holds little about the rest.
    pub fn of(cells: &[(f64, f64, f64)]) -> Self {
        let cells: Vec<_> = cells.iter().filter(|c| c.0.is_finite() && c.0 > 0.0).collect();
        let across: Vec<_> = cells.iter().map(|c| (c.0.ln(), c.2)).collect();
        let along: Vec<_> =
            cells.iter().map(|c| ((c.0 / c.1.max(LEAST_COSINE)).ln(), c.2)).collect();
        let (median_across, spread_across) = center_and_spread(across);
        let (median_along, spread_along) = center_and_spread(along);
        let along_rays = (median_along - median_across).exp();
        let clear = spread_along < INCIDENCE_GAIN * spread_across && along_rays <= MOST_ALONG_RAYS;
        Self { along_rays: clear.then_some(along_rays) }
    }

    /// The noise across a surface seen at this cosine of the angle between ray and normal, by the median noise.
    pub fn factor(self, cosine: f64) -> f64 {
        self.along_rays.map_or(1.0, |ray| (ray * cosine).max(LEAST_NOISE_FACTOR))
    }
}

/// Weighted median of values with weights, and that of the distances from it.
fn center_and_spread(mut values: Vec<(f64, f64)>) -> (f64, f64) {
    let center = weighted_median(&mut values);
    let mut distances: Vec<_> = values.iter().map(|v| ((v.0 - center).abs(), v.1)).collect();
    (center, weighted_median(&mut distances))
}

/// The weighted median of values with weights: half of the weight is of values up to it.
pub(in crate::planes::fit) fn weighted_median(values: &mut [(f64, f64)]) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut seen = 0.0;
    for &(value, weight) in values.iter() {
        seen += weight;
        if seen >= half {
            return value;
        }
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Deviations of 2000 cells of 20 points each, a tenth about the true one, seen at any angle.
    fn cells(deviation: impl Fn(f64) -> f64) -> Vec<(f64, f64, f64)> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        (0..2000)
            .map(|_| {
                let cosine: f64 = rng.random_range(0.2..1.0);
                (deviation(cosine) * rng.random_range(0.85..1.15), cosine, 20.0)
            })
            .collect()
    }

    #[test]
    fn noise_along_rays_is_told_from_noise_of_every_direction() {
        let along = Incidence::of(&cells(|cosine| 0.01 * cosine));
        // The median cosine is 0.6.
        assert!((along.factor(1.0) - 1.0 / 0.6).abs() < 0.1, "{along:?}");
        assert!((along.factor(0.6) - 1.0).abs() < 0.1);
        let even = Incidence::of(&cells(|_| 0.01));
        assert_eq!([even.factor(1.0), even.factor(0.2)], [1.0, 1.0]);
    }
}
