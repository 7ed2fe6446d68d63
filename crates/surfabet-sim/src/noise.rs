//! Noise of sensors and of their poses.

use nalgebra::UnitQuaternion;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use surfabet_geom::{Error, Result};

use crate::pose::{Frame, Vec3};

/// Standard deviation of a Kinect's depth in metres at `depth` metres and an angle of `incidence` radians
/// between the viewing ray and the normal.
///
/// `0.0012 + 0.0019 (z - 0.4)^2 + 0.0001 / sqrt(z) * (theta / (pi/2 - theta))^2`: the axial model that Nguyen,
/// Izadi and Lovell measured (Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking, 3DIMPVT
/// 2012). The last term matters beyond 60 degrees only. `theta` is held at 85 degrees, where their
/// measurements end.
pub fn axial_noise_std(depth: f64, incidence: f64) -> f64 {
    let theta = incidence.clamp(0.0, 85_f64.to_radians());
    let grazing = theta / (std::f64::consts::FRAC_PI_2 - theta);
    0.0012 + 0.0019 * (depth - 0.4).powi(2) + 0.0001 / depth.sqrt() * grazing * grazing
}

/// Error of the pose that a scan is placed with, drawn once per scan.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseError {
    /// Standard deviation of the position along each axis, metres.
    pub translation_std: f64,
    /// Standard deviation of the rotation about each axis, degrees.
    pub rotation_std: f64,
}

/// `value` when it is finite and within `low..=high`.
pub(crate) fn check_within(
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
    requirement: &'static str,
) -> Result<()> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(Error::invalid(name, value, requirement))
    }
}

impl PoseError {
    pub(crate) fn check(&self) -> Result<()> {
        check_within("translation_std", self.translation_std, 0.0, 1.0, "0 to 1 m")?;
        check_within("rotation_std", self.rotation_std, 0.0, 30.0, "0 to 30 degrees")
    }

    /// The pose that is believed of a sensor whose true one is `frame`.
    pub(crate) fn believed(&self, frame: &Frame, rng: &mut ChaCha8Rng) -> Frame {
        // Six numbers are drawn in any case, so that one error does not change the other.
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let shift = Vec3::new(normal(), normal(), normal()) * self.translation_std;
        let turn = Vec3::new(normal(), normal(), normal()) * self.rotation_std.to_radians();
        let turned = frame.rotation * UnitQuaternion::from_scaled_axis(turn);
        Frame::from_parts((frame.translation.vector + shift).into(), turned)
    }
}

/// The random stream of one line of one scan, or of the scan's pose: no two share one.
pub(crate) enum Stream {
    Pose,
    Line(u32),
}

pub(crate) fn random_stream(seed: u64, scan: usize, stream: &Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let line = match stream {
        Stream::Pose => 0,
        Stream::Line(line) => u64::from(*line) + 1,
    };
    // Scans number at most 10^4 and lines at most 10^5 (both checked): the two fields do not meet.
    rng.set_stream(((scan as u64) << 32) | line);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axial_model_has_its_published_values() {
        assert!((axial_noise_std(0.4, 0.0) - 0.0012).abs() < 1e-15);
        assert!((axial_noise_std(2.4, 0.0) - 0.0088).abs() < 1e-15);
        // theta = 60 degrees: (pi/3) / (pi/6) = 2.
        let theta = std::f64::consts::FRAC_PI_3;
        assert!((axial_noise_std(1.0, theta) - (0.0012 + 0.0019 * 0.36 + 0.0004)).abs() < 1e-12);
    }

    #[test]
    fn pose_errors_have_the_spread_asked_for() {
        let error = PoseError { translation_std: 0.01, rotation_std: 0.5 };
        let frame = crate::pose::looking(Vec3::new(1.0, 2.0, 3.0), 1.0, -0.2);
        let n = 4000;
        let (mut shift, mut turn) = (0.0, 0.0);
        for scan in 0..n {
            let believed = error.believed(&frame, &mut random_stream(1, scan, &Stream::Pose));
            shift += (believed.translation.vector - frame.translation.vector).norm_squared();
            turn += frame.rotation.angle_to(&believed.rotation).powi(2);
        }
        let rms = |sum: f64| (sum / (3 * n) as f64).sqrt();
        // The relative deviation of a standard deviation from 12000 values is 0.65 percent; five of these.
        assert!((rms(shift) / 0.01 - 1.0).abs() < 0.033);
        assert!((rms(turn).to_degrees() / 0.5 - 1.0).abs() < 0.033);
    }
}
