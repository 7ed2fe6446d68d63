//! What to look for, and how.

use crate::error::{Error, Result, positive};
use crate::vector::{self, minus};

/// What to look for, in world coordinates, metres.
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
    /// [`Error::InvalidParameter`] when there is no room in it.
    pub(super) fn check(&self) -> Result<()> {
        match *self {
            Self::Box { low, high } => {
                let room = (0..3).all(|a| low[a] < high[a] && (high[a] - low[a]).is_finite());
                if !room {
                    let corners = format!("{low:?} to {high:?}");
                    return Err(Error::invalid(
                        "region",
                        corners,
                        "from a lower to a higher corner",
                    ));
                }
            }
            Self::Ball { center, radius } => {
                if !center.iter().all(|c| c.is_finite()) {
                    return Err(Error::invalid("point", format!("{center:?}"), "finite"));
                }
                positive("radius", radius, "positive and finite")?;
            }
        }
        Ok(())
    }

    pub(super) fn contains(&self, p: [f64; 3]) -> bool {
        match *self {
            Self::Box { low, high } => (0..3).all(|a| (low[a]..=high[a]).contains(&p[a])),
            Self::Ball { center, radius } => {
                (0..3).map(|a| (p[a] - center[a]).powi(2)).sum::<f64>() <= radius * radius
            }
        }
    }

    pub(super) fn center(&self) -> [f64; 3] {
        match *self {
            Self::Box { low, high } => std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            Self::Ball { center, .. } => center,
        }
    }

    /// Metres; of a ball its diameter.
    pub(super) fn diagonal(&self) -> f64 {
        match *self {
            Self::Box { low, high } => vector::length(minus(high, low)),
            Self::Ball { radius, .. } => 2.0 * radius,
        }
    }

    pub(super) fn about(&self, origin: [f64; 3]) -> Self {
        let minus = |p: [f64; 3]| std::array::from_fn(|a| p[a] - origin[a]);
        match *self {
            Self::Box { low, high } => Self::Box { low: minus(low), high: minus(high) },
            Self::Ball { center, radius } => Self::Ball { center: minus(center), radius },
        }
    }
}

/// How to look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FindOptions {
    /// Least score of what is found, 0 to 1. Things of one kind seen from different sides score 0.5 to 0.85 against
    /// each other; unlike things score up to 0.55 by shape alone, less with colours.
    pub min_score: f64,
    /// Most places that are found.
    pub max_found: usize,
    /// Spacing of the samples that are compared, metres; by default a 64th of the diagonal of what the example shows.
    pub resolution: Option<f64>,
    /// Deviation of equal surfaces, metres; by default sigma of the example's occurrences, their median.
    pub tolerance: Option<f64>,
    /// Deviation of equal colours in chroma, grey levels; luma, which changes with the light, may differ three times as
    /// much. `None` goes by shape alone, as in a model without colours.
    pub color_tolerance: Option<f64>,
}

impl Default for FindOptions {
    fn default() -> Self {
        Self {
            min_score: 0.5,
            max_found: 1000,
            resolution: None,
            tolerance: None,
            color_tolerance: Some(10.0),
        }
    }
}

impl FindOptions {
    pub(super) fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.min_score) {
            return Err(Error::invalid("least score", self.min_score, "0 to 1"));
        }
        for (name, value) in [
            ("resolution", self.resolution),
            ("tolerance", self.tolerance),
            ("color_tolerance", self.color_tolerance),
        ] {
            if let Some(value) = value {
                positive(name, value, "positive and finite")?;
            }
        }
        Ok(())
    }
}
