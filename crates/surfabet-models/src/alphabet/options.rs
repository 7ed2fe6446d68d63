//! Options of the method.

use super::lattice::MAX_SCALE;
use crate::error::{Error, Result, positive};
use crate::scans::Deviation;

/// Most words of an alphabet.
pub const MAX_WORDS: u32 = 4096;

/// How an alphabet is learned and a scene described.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlphabetOptions {
    /// Smallest radius of a word, metres (delta); when not given, 0.1, or one and a half times the median sigma where
    /// that is more: a word smaller than what its samples may be off says nothing.
    pub radius: Option<f64>,
    /// Radii: the smallest, doubled again and again.
    pub scales: u32,
    /// Most words beside the plane; those that do not pay for themselves are dropped.
    pub max_words: u32,
    /// What a measured point within sigma of a decoded one is worth, bits. Points denser than half a sigma count once.
    pub point_bits: f64,
    /// What a decoded point without a measured one within sigma costs, bits.
    pub lone_bits: f64,
    /// Spacing of decoded points, in sigma.
    pub spacing: f64,
    /// Rounds of covering, each with the prices that the round before taught.
    pub rounds: u32,
    /// Sigma.
    pub deviation: Deviation,
    /// What is nearer to the sensor is left out, metres.
    pub min_range: f64,
    /// Steps of colour, 0 to 255.
    pub color_step: u32,
}

impl Default for AlphabetOptions {
    fn default() -> Self {
        Self {
            radius: None,
            scales: 4,
            max_words: 24,
            point_bits: 7.0,
            lone_bits: 7.0,
            spacing: 1.0,
            rounds: 4,
            deviation: Deviation { noise: None, ..Deviation::default() },
            min_range: 0.0,
            color_step: 8,
        }
    }
}

impl AlphabetOptions {
    /// # Errors
    /// [`Error::InvalidParameter`] for values outside of their domain.
    pub fn check(&self) -> Result<()> {
        for (name, value) in [
            ("radius", self.radius.unwrap_or(1.0)),
            ("bits of a point", self.point_bits),
            ("spacing", self.spacing),
        ] {
            positive(name, value, "positive and finite")?;
        }
        if !(self.lone_bits >= 0.0 && self.lone_bits.is_finite()) {
            return Err(Error::invalid("bits of a lone sample", self.lone_bits, "0 or more"));
        }
        if !(0.25..=4.0).contains(&self.spacing) {
            return Err(Error::invalid("spacing", self.spacing, "0.25 to 4 sigma"));
        }
        if !(1..=MAX_SCALE + 1).contains(&self.scales) {
            return Err(Error::invalid("number of scales", self.scales, "1 to 8"));
        }
        if self.max_words >= MAX_WORDS {
            return Err(Error::invalid("number of words", self.max_words, "below 4096"));
        }
        if !(1..=64).contains(&self.rounds) {
            return Err(Error::invalid("number of rounds", self.rounds, "1 to 64"));
        }
        if !(1..=255).contains(&self.color_step) {
            return Err(Error::invalid("step of colour", self.color_step, "1 to 255"));
        }
        self.deviation.check()
    }
}
