//! What to learn.

use super::lattice::MAX_SCALE;
use crate::options::{Range, options};
use crate::quality::Quality;
use crate::scans::Deviation;

/// Most words of an alphabet.
pub const MAX_WORDS: u32 = 4096;

/// What explaining a point is worth, bits.
fn inlier_bits(quality: Quality) -> f64 {
    match quality {
        Quality::Small => 4.0,
        Quality::Balanced => 7.0,
        Quality::Fine => 24.0,
    }
}

options! {
    /// Options of [`learn`](super::learn) and [`describe`](super::describe).
    #[derive(Copy)]
    pub struct AlphabetOptions {
        /// Small files or fine detail. Sets `inlier_bits`, unless that is given, to 4, 7 or 24.
        quality: Quality = Quality::Balanced, another_scene = true;
        /// Smallest radius of a word (delta).
        radius: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "from the data: three spacings of the points, or one and a half times the median sigma where that is more";
        /// Number of radii, each twice the one before.
        scales: u32 = 4, range = Range::from_to(1.0, (MAX_SCALE + 1) as f64);
        /// Most words beside the plane. Those that do not pay for themselves are dropped.
        max_words: u32 = 24, range = Range::from_to(0.0, (MAX_WORDS - 1) as f64);
        /// What explaining a point is worth. Points denser than half a sigma count once.
        inlier_bits: Option<f64> = None, range = Range::POSITIVE, unit = "bits", none = "by `quality`",
            another_scene = true;
        /// What a decoded point that explains nothing costs.
        outlier_bits: Option<f64> = None, range = Range::NOT_NEGATIVE, unit = "bits", none = "as `inlier_bits`",
            another_scene = true;
        /// Distance of decoded points.
        spacing: f64 = 1.0, range = Range::from_to(0.25, 4.0), unit = "sigma", another_scene = true;
        /// Rounds of covering the scene. Each uses the prices that the coder learned in the round before.
        rounds: u32 = 4, range = Range::from_to(1.0, 64.0), another_scene = true;
        /// Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma is this times
        /// hypot(tan(`angular_resolution` / 2) * range, `noise`).
        sigma_scale: f64 = 3.0, range = Range::above_to(0.0, 1e6), another_scene = true;
        /// Angle between neighbouring beams (alpha, eq. 13).
        angular_resolution: Option<f64> = None, range = Range::between(0.0, 180.0), unit = "degrees",
            none = "estimated from the spacing of the points", another_scene = true;
        /// Standard deviation of a measured point about its surface.
        noise: Option<f64> = None, range = Range::LENGTH_OR_ZERO, unit = "metres",
            none = "estimated as the median deviation of neighbouring points from their plane",
            another_scene = true;
        /// Points nearer to the sensor are left out, such as the robot's own body.
        min_range: f64 = 0.0, range = Range::LENGTH_OR_ZERO, unit = "metres", another_scene = true;
        /// Keeps points that are far from all others. Otherwise those of which a few would make the scene many times as
        /// large as it is are left out, and counted in the report.
        keep_outliers: bool = false, another_scene = true;
        /// Rounding of the mean colours of occurrences.
        color_step: u32 = 8, range = Range::from_to(1.0, 255.0), unit = "grey levels", another_scene = true;
    }
}

impl AlphabetOptions {
    /// Bits in force for a point that is explained.
    pub fn inlier_bits(&self) -> f64 {
        self.inlier_bits.unwrap_or_else(|| inlier_bits(self.quality))
    }

    /// Bits in force for a decoded point that explains nothing.
    pub fn outlier_bits(&self) -> f64 {
        self.outlier_bits.unwrap_or_else(|| self.inlier_bits())
    }

    /// The deviation that is allowed (eq. 13).
    pub fn deviation(&self) -> Deviation {
        Deviation {
            sigma_scale: self.sigma_scale,
            angular_resolution: self.angular_resolution.map(f64::to_radians),
            noise: self.noise,
        }
    }
}
