//! What to learn, checked before anything is computed.

use super::model::MAX_LEVELS;
use crate::error::{Error, Result, positive};
use crate::sensor::Sensor;

/// Parameters of [`learn`](super::learn).
#[derive(Debug, Clone, PartialEq)]
pub struct PatchesOptions {
    /// Side of the finest pixel, metres.
    pub resolution: f64,
    /// Number of levels, 1 to 4; patches of the finest are 8 pixels wide, each further level doubles.
    pub levels: u32,
    /// What a bit of geometry must save (lambda): squared error in squared pixels, summed over both directions and
    /// over pixels.
    pub lambda: f64,
    /// Depth step, in sixteenths of a pixel.
    pub depth_step: u32,
    /// Rounds of choosing and training the coder's models.
    pub rounds: u32,
    /// Quantiser step of luma, grey levels of a single node (0..255).
    pub color_step: u32,
    /// Quantiser step of chroma as a multiple of luma's.
    pub chroma_ratio: f64,
    /// What a bit of colour must save, in squared colour steps.
    pub color_lambda: f64,
    /// Largest distance of any input point to the decoded cloud, metres: points further away are kept.
    pub max_error: Option<f64>,
    /// How far a depth measurement can be trusted, for clouds that know their ranges.
    pub sensor: Sensor,
}

impl Default for PatchesOptions {
    fn default() -> Self {
        Self {
            resolution: 0.01,
            levels: 2,
            lambda: 1.4,
            depth_step: 12,
            rounds: 3,
            color_step: 90,
            chroma_ratio: 1.5,
            color_lambda: 0.15,
            max_error: None,
            sensor: Sensor::default(),
        }
    }
}

impl PatchesOptions {
    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        positive("resolution", self.resolution, "a positive number of metres")?;
        if !(1..=MAX_LEVELS).contains(&self.levels) {
            return Err(Error::invalid("levels", self.levels, "1 to 4"));
        }
        let ratio = self.chroma_ratio;
        for (name, value) in
            [("lambda", self.lambda), ("color_lambda", self.color_lambda), ("chroma_ratio", ratio)]
        {
            positive(name, value, "a positive number")?;
        }
        if !(1..=256).contains(&self.depth_step) {
            return Err(Error::invalid(
                "depth_step",
                self.depth_step,
                "1 to 256 sixteenths of a pixel",
            ));
        }
        if !(1..=1024).contains(&self.color_step) {
            return Err(Error::invalid("color_step", self.color_step, "1 to 1024"));
        }
        if !(0.25..=4.0).contains(&ratio) {
            return Err(Error::invalid("chroma_ratio", ratio, "0.25 to 4"));
        }
        if !(1..=10).contains(&self.rounds) {
            return Err(Error::invalid("rounds", self.rounds, "1 to 10"));
        }
        if let Some(error) = self.max_error {
            positive("max_error", error, "a positive number of metres")?;
        }
        Ok(())
    }
}
