//! What to learn, checked before anything is computed.

use crate::error::{Error, Result, positive};
use crate::scans::{Deviation, Upright};

/// Parameters of [`learn`](super::learn) and [`describe`](super::BicAlphabet::describe).
///
/// The paper gives delta (`radius`) and the number of iterations; what it leaves open says so.
#[derive(Debug, Clone, PartialEq)]
pub struct BicAlphabetOptions {
    /// Delta, the radius of a word (eq. 1), metres.
    pub radius: f64,
    /// Sigma of every point (eq. 13). The paper does not give lambda; 3 reaches its figures.
    pub deviation: Deviation,
    /// Points nearer to the sensor are left out, metres: the robot's own body. Not in the paper.
    pub min_range: f64,
    /// Epsilon, the least distance of decoded points (eq. 3), metres; a fifth of the radius when not given. The
    /// paper does not give it. It should be below the sigma of near points.
    pub epsilon: Option<f64>,
    /// Largest distance of a point of the scene to a feature, metres; the radius when not given. The paper says "a
    /// big enough overlap".
    pub feature_spacing: Option<f64>,
    /// Scales of the Laplacian of Gaussian, standard deviations in pixels of the range image. Without scales, or
    /// where the cloud has no viewpoints, features are spread uniformly only.
    pub interest_scales: Vec<f64>,
    /// Least response of an interest point: `scale^2` times the Laplacian of the logarithm of the range.
    pub interest_threshold: f64,
    /// Least number of neighbours that a feature's normal is fitted to, where fewer lie within the radius.
    pub normal_neighbors: u32,
    /// What is up where the normal is vertical.
    pub upright: Upright,
    /// Pixels per side of a descriptor; those within the inscribed circle count.
    pub descriptor_pixels: u32,
    /// What a pixel that is empty in only one of two descriptors adds to their distance, as a share of the radius.
    pub empty_penalty: f64,
    /// Where a point has no decoded one within 3 sigma its likelihood is zero; it counts as if one lay this many
    /// sigma away. Not in the paper.
    pub floor: f64,
    /// Least number of points of a word.
    pub min_points: u32,
    /// Most candidate words looked at.
    pub iterations: u32,
    /// Learning ends after this many candidates in a row that did not lower the BIC.
    pub max_rejections: u32,
    /// Removes redundant occurrences when the alphabet is learned (III-D).
    pub reduce: bool,
    /// Seed of the order in which candidates are sampled and features are spread.
    pub random_state: u64,
}

impl Default for BicAlphabetOptions {
    fn default() -> Self {
        Self {
            radius: 0.1,
            deviation: Deviation::default(),
            min_range: 0.0,
            epsilon: None,
            feature_spacing: None,
            interest_scales: vec![1.0, 2.0, 4.0],
            interest_threshold: 0.05,
            normal_neighbors: 12,
            upright: Upright::default(),
            descriptor_pixels: 8,
            empty_penalty: 0.5,
            floor: 3.0,
            min_points: 8,
            iterations: 500,
            max_rejections: 500,
            reduce: true,
            random_state: 0,
        }
    }
}

impl BicAlphabetOptions {
    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        let lengths = [
            ("radius", Some(self.radius)),
            ("epsilon", self.epsilon),
            ("feature_spacing", self.feature_spacing),
        ];
        for (name, value) in lengths {
            if let Some(value) = value {
                positive(name, value, "a positive number of metres")?;
            }
        }
        self.deviation.check()?;
        if let Some(scale) = self.interest_scales.iter().find(|s| !(0.5..=32.0).contains(*s)) {
            return Err(Error::invalid("interest_scales", scale, "0.5 to 32 pixels"));
        }
        positive("interest_threshold", self.interest_threshold, "a positive number")?;
        if !(3..=1000).contains(&self.normal_neighbors) {
            return Err(Error::invalid("normal_neighbors", self.normal_neighbors, "3 to 1000"));
        }
        if !(2..=32).contains(&self.descriptor_pixels) {
            return Err(Error::invalid("descriptor_pixels", self.descriptor_pixels, "2 to 32"));
        }
        if !(0.0..=1.0).contains(&self.empty_penalty) {
            return Err(Error::invalid("empty_penalty", self.empty_penalty, "0 to 1"));
        }
        if !(3.0..=40.0).contains(&self.floor) {
            return Err(Error::invalid("floor", self.floor, "3 to 40 sigma"));
        }
        for (name, value) in [
            ("min_points", self.min_points),
            ("iterations", self.iterations),
            ("max_rejections", self.max_rejections),
        ] {
            if value == 0 {
                return Err(Error::invalid(name, value, "at least 1"));
            }
        }
        Ok(())
    }

    /// Epsilon in force, metres.
    pub fn epsilon(&self) -> f64 {
        self.epsilon.unwrap_or(0.2 * self.radius)
    }

    /// Feature spacing in force, metres.
    pub fn feature_spacing(&self) -> f64 {
        self.feature_spacing.unwrap_or(self.radius)
    }
}
