//! The example of a search, and its options.

use std::borrow::Cow;

use surfabet_geom::vector::{self, minus};
use surfabet_models::options::{Range, options};
use surfabet_models::{Error, Result};

/// The region of the example, in world coordinates, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// An upright box by its lowest and highest corner.
    Box {
        /// Lowest corner.
        low: [f64; 3],
        /// Highest corner.
        high: [f64; 3],
    },
    /// All within a distance of a point.
    Ball {
        /// The point.
        center: [f64; 3],
        /// The distance.
        radius: f64,
    },
}

impl Region {
    /// # Errors
    /// [`Error::InvalidParameter`] for a region without extent.
    pub(super) fn check(&self) -> Result<()> {
        match *self {
            Self::Box { low, high } => {
                let has_extent = (0..3).all(|a| low[a] < high[a] && (high[a] - low[a]).is_finite());
                if !has_extent {
                    return Err(self.invalid("from a lower to a higher corner"));
                }
            }
            Self::Ball { center, radius } => {
                if !center.iter().all(|c| c.is_finite()) {
                    return Err(Error::invalid("point", format!("{center:?}"), "finite"));
                }
                if !(radius > 0.0 && radius.is_finite()) {
                    return Err(Error::invalid("radius", radius, "positive and finite"));
                }
            }
        }
        Ok(())
    }

    /// The error of a region that does not meet a requirement.
    pub(super) fn invalid(&self, requirement: impl Into<Cow<'static, str>>) -> Error {
        match self {
            Self::Box { low, high } => {
                Error::invalid("box", format!("{low:?} to {high:?}"), requirement)
            }
            Self::Ball { center, radius } => {
                let value = format!("{center:?} with radius {radius}");
                Error::invalid("point", value, requirement)
            }
        }
    }

    /// The middle of the region.
    pub(super) fn middle(&self) -> [f64; 3] {
        match *self {
            Self::Box { low, high } => std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            Self::Ball { center, .. } => center,
        }
    }

    /// Whether a point is in the region.
    pub(crate) fn contains(&self, p: [f64; 3]) -> bool {
        match *self {
            Self::Box { low, high } => (0..3).all(|a| (low[a]..=high[a]).contains(&p[a])),
            Self::Ball { center, radius } => {
                (0..3).map(|a| (p[a] - center[a]).powi(2)).sum::<f64>() <= radius * radius
            }
        }
    }

    /// Lowest and highest corner of the box around the region.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        match *self {
            Self::Box { low, high } => [low, high],
            Self::Ball { center, radius } => {
                [center.map(|c| c - radius), center.map(|c| c + radius)]
            }
        }
    }

    /// What two boxes have in common, which overlap.
    pub(crate) fn shared_with(&self, other: &Self) -> Self {
        let ([low, high], [other_low, other_high]) = (self.corners(), other.corners());
        Self::Box {
            low: std::array::from_fn(|a| low[a].max(other_low[a])),
            high: std::array::from_fn(|a| high[a].min(other_high[a])),
        }
    }

    /// Middle of the region.
    pub(super) fn center(&self) -> [f64; 3] {
        match *self {
            Self::Box { low, high } => std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            Self::Ball { center, .. } => center,
        }
    }

    /// Longest distance within the region: of a ball its diameter.
    pub(crate) fn diagonal(&self) -> f64 {
        match *self {
            Self::Box { low, high } => vector::length(minus(high, low)),
            Self::Ball { radius, .. } => 2.0 * radius,
        }
    }

    /// The region relative to `origin`.
    pub(crate) fn about(&self, origin: [f64; 3]) -> Self {
        let minus = |p: [f64; 3]| std::array::from_fn(|a| p[a] - origin[a]);
        match *self {
            Self::Box { low, high } => Self::Box { low: minus(low), high: minus(high) },
            Self::Ball { center, radius } => Self::Ball { center: minus(center), radius },
        }
    }
}

options! {
    /// Options of [`find`](crate::find()).
    pub struct FindOptions {
        /// Least score of what is found. Things of one kind seen from different sides score 0.5 to 0.85 against each
        /// other; unlike things score up to 0.55 by shape alone, less with colours.
        min_score: Option<f64> = None, range = Range::from_to(0.0, 1.0),
            none = "0.5; for examples of another model 0.525 by shape alone, 0.48 with colours";
        /// Most places that are found.
        max_found: usize = 1000, range = Range::NOT_NEGATIVE;
        /// Spacing of the samples that are compared.
        resolution: Option<f64> = None, range = Range::POSITIVE, unit = "metres",
            none = "a 64th of the diagonal of the example's region";
        /// Standard deviation of equal surfaces.
        tolerance: Option<f64> = None, range = Range::POSITIVE, unit = "metres",
            none = "the median sigma of the example's occurrences";
        /// Standard deviation of equal chromas; luma, which changes with the light, may differ three times as much.
        color_tolerance: Option<f64> = Some(10.0), range = Range::POSITIVE, unit = "grey levels",
            none = "shape alone counts, as in a model without colours: things of one shape are found in any colour, \
                but not what lies flush with a wall, such as a door";
        /// Largest change of a size, what is level and what is upright each by its own factor: other things of a kind are
        /// larger or smaller than the example.
        size_tolerance: Option<f64> = None, range = Range::from_to(0.0, 0.3), unit = "as a share",
            none = "0.1 for an example of another model; 0 within one scene, where copies are looked for";
    }
}
