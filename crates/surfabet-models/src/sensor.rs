//! How much a measurement counts, from the depth error of its sensor.
//!
//! HSCSM averages pixels with weights that fall with the error expected at the measured distance, so that
//! near and precise views win over far and noisy ones (section III, with the error model of its reference 15).

use surfabet_geom::PointCloud;

use crate::options::choices;
use crate::vector::{minus, unit};

/// Depth error as a function of the measured distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sensor {
    /// Structured light, as in the first Kinect: the standard deviation grows with the square of the distance,
    /// σ(z) = 1.2 mm + 1.9 mm ((z - 0.4 m) / 1 m)² (C. V. Nguyen, S. Izadi, D. Lovell: Modeling Kinect Sensor
    /// Noise for Improved 3D Reconstruction and Tracking, 3DIMPVT 2012).
    #[default]
    StructuredLight,
    /// The same error at every distance, as for most laser scanners indoors.
    Constant,
}
choices!(Sensor { StructuredLight = "structured-light", Constant = "constant" });

impl Sensor {
    /// Standard deviation of a depth measurement at distance `range` (metres), metres. A range of zero means
    /// unknown and counts as one metre.
    pub fn sigma(self, range: f32) -> f32 {
        let z = if range > 0.0 { range } else { 1.0 };
        match self {
            Self::StructuredLight => 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4),
            Self::Constant => 0.001,
        }
    }

    /// Weight of a measurement at `range`: the inverse variance relative to that at one metre.
    pub fn weight(self, range: f32) -> f32 {
        let ratio = self.sigma(1.0) / self.sigma(range);
        ratio * ratio
    }

    /// Weight of point `i` of `cloud`; 1 where ranges are unknown.
    pub(crate) fn weight_of(self, cloud: &PointCloud, i: usize) -> f32 {
        cloud.ranges().map_or(1.0, |ranges| self.weight(ranges[i]))
    }
}

/// Unit direction from point `i` of `cloud` to the sensor that saw it; zero where unknown.
pub(crate) fn to_sensor(cloud: &PointCloud, i: usize) -> [f32; 3] {
    let view = |sensor| unit(minus(sensor, cloud.positions()[i]));
    cloud.local_viewpoint(i).map_or([0.0; 3], view)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_light_trusts_near_measurements() {
        let sensor = Sensor::StructuredLight;
        assert_eq!(sensor.weight(1.0), 1.0);
        assert_eq!(sensor.weight(0.0), 1.0);
        // σ(2 m) = 1.2 + 1.9 * 1.6² = 6.064 mm, σ(1 m) = 1.2 + 1.9 * 0.6² = 1.884 mm.
        assert!((sensor.sigma(2.0) - 0.006_064).abs() < 1e-6);
        assert!((sensor.weight(2.0) - (1.884_f32 / 6.064).powi(2)).abs() < 1e-5);
        assert!(sensor.weight(0.5) > 1.0 && sensor.weight(4.0) < 0.02);
    }

    #[test]
    fn a_constant_error_weighs_all_alike() {
        assert_eq!(Sensor::Constant.weight(0.3), Sensor::Constant.weight(70.0));
    }
}
