//! The size of a robot, and what it can climb.

use crate::error::{Error, Result};

/// A robot that moves upright over ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robot {
    /// Radius of the upright cylinder that holds the robot, metres.
    pub radius: f64,
    /// Height of that cylinder above the ground, metres.
    pub height: f64,
    /// Largest step up or down, metres: what is lower is no obstacle.
    pub max_step: f64,
    /// Steepest ground, degrees against the level.
    pub max_slope: f64,
}

impl Default for Robot {
    /// A small robot on wheels, for use indoors.
    fn default() -> Self {
        Self { radius: 0.25, height: 1.0, max_step: 0.05, max_slope: 15.0 }
    }
}

impl Robot {
    /// Checks that all numbers are in their domains.
    pub(super) fn check(self) -> Result<()> {
        let positive = |name, value: f64| {
            let fits = value.is_finite() && value > 0.0;
            if fits {
                Ok(())
            } else {
                Err(Error::invalid(name, value, "a positive number of metres"))
            }
        };
        positive("radius", self.radius)?;
        positive("height", self.height)?;
        if !(self.max_step >= 0.0 && self.max_step < self.height) {
            let requirement = "a number of metres from 0 to below the height";
            return Err(Error::invalid("max_step", self.max_step, requirement));
        }
        if !(0.0..80.0).contains(&self.max_slope) {
            let requirement = "a number of degrees from 0 to below 80";
            return Err(Error::invalid("max_slope", self.max_slope, requirement));
        }
        Ok(())
    }
}
