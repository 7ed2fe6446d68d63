//! What to learn.

use crate::options::{Range, options};
use crate::quality::Quality;
use crate::scans::{Deviation, Upright};

options! {
    /// Options of [`learn`](super::learn) and [`describe`](super::BicAlphabet::describe).
    ///
    /// The paper gives the radius and the number of iterations. Its lambda is not given; 3 reaches its figures.
    pub struct BicAlphabetOptions {
        /// Small files or fine detail. Sets `radius`, unless that is given: 'small' doubles it, 'fine' halves it.
        quality: Quality = Quality::Balanced;
        /// Radius of a word (delta, eq. 1).
        radius: Option<f64> = None, range = Range::from_to(1e-6, 1e5), unit = "metres",
            none = "from the data: four spacings of the points, or a 300th of the scene where that is more";
        /// Factor of the deviation sigma within which a point is explained (lambda, eq. 13). Sigma is this times
        /// hypot(tan(`angular_resolution` / 2) * range, `noise`).
        sigma_scale: f64 = 3.0, range = Range::above_to(0.0, 1e6), another_scene = true;
        /// Angle between neighbouring beams (alpha, eq. 13).
        angular_resolution: Option<f64> = None, range = Range::between(0.0, 180.0), unit = "degrees",
            none = "estimated from the spacing of the points", another_scene = true;
        /// Standard deviation of a measured point about its surface. The paper has none.
        noise: Option<f64> = Some(0.0), range = Range::LENGTH_OR_ZERO, unit = "metres",
            none = "estimated as the median deviation of neighbouring points from their plane",
            another_scene = true;
        /// Points nearer to the sensor are left out, such as the robot's own body.
        min_range: f64 = 0.0, range = Range::LENGTH_OR_ZERO, unit = "metres", another_scene = true;
        /// Least distance of decoded points (epsilon, eq. 3). It should be below the sigma of near points.
        epsilon: Option<f64> = None, range = Range::from_to(1e-9, 1e5), unit = "metres", none = "a fifth of the radius",
            another_scene = true;
        /// Largest distance of a point of the scene to a feature.
        feature_spacing: Option<f64> = None, range = Range::LENGTH, unit = "metres", none = "the radius",
            another_scene = true;
        /// Scales of the Laplacian of Gaussian that finds interest points in the range image. Without scales, or where
        /// the cloud has no viewpoints, features are spread uniformly only.
        interest_scales: Vec<f64> = vec![1.0, 2.0, 4.0], range = Range::from_to(0.5, 32.0), unit = "pixels",
            another_scene = true;
        /// Least response of an interest point: squared scale times the Laplacian of the logarithm of the range.
        interest_threshold: f64 = 0.05, range = Range::POSITIVE, another_scene = true;
        /// Least number of neighbours that a feature's normal is fitted to, where fewer lie within the radius.
        normal_neighbors: u32 = 12, range = Range::from_to(3.0, 1000.0), another_scene = true;
        /// What is up where the normal is vertical. It is an axis of the world, or away from the sensor for 'view'.
        upright: Upright = Upright::WorldX;
        /// Pixels per side of a descriptor; those within the inscribed circle count.
        descriptor_pixels: u32 = 8, range = Range::from_to(2.0, 32.0);
        /// Part of the distance of two descriptors for a pixel that is empty in only one of them, as a share of the
        /// radius.
        empty_penalty: f64 = 0.5, range = Range::from_to(0.0, 1.0), another_scene = true;
        /// Distance at which a point without a decoded one nearby counts as having one. Its likelihood would be zero
        /// otherwise; the paper has no floor.
        floor: f64 = 3.0, range = Range::from_to(3.0, 40.0), unit = "sigma", another_scene = true;
        /// Least number of points of a word.
        min_points: u32 = 8, range = Range::count_from(1.0);
        /// Most candidate words that are tried.
        iterations: u32 = 500, range = Range::count_from(1.0);
        /// Learning ends after this many candidates in a row that did not lower the BIC.
        max_rejections: u32 = 100, range = Range::count_from(1.0);
        /// Removes occurrences without which the likelihood does not fall (section III-D).
        reduce: bool = true, another_scene = true;
        /// How far the logarithm of the likelihood may fall with each occurrence that is removed (section III-D). The
        /// likelihood is then that without the factor 1/M (eq. 9), which rewards fewer decoded points.
        reduce_tolerance: Option<f64> = Some(3.0), range = Range::NOT_NEGATIVE, unit = "nats",
            none = "not at all, and the factor 1/M counts", another_scene = true;
        /// Keeps points that are far from all others. Otherwise those of which a few would make the scene many times as
        /// large as it is are left out, and counted in the report.
        keep_outliers: bool = false, another_scene = true;
        /// Seed of the order in which candidates are tried and features are spread.
        random_state: u64 = 0, range = Range::SEED, another_scene = true;
    }
}

impl BicAlphabetOptions {
    /// The radius in force, metres. Learning chooses it before anything asks.
    pub fn radius(&self) -> f64 {
        self.radius.unwrap_or(f64::NAN)
    }

    /// Epsilon in force, metres.
    pub fn epsilon(&self) -> f64 {
        self.epsilon.unwrap_or(0.2 * self.radius())
    }

    /// Feature spacing in force, metres.
    pub fn feature_spacing(&self) -> f64 {
        self.feature_spacing.unwrap_or(self.radius())
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
