//! The one knob above all others, the same for every method.

use crate::options::choices;

/// Small files or fine detail. What it sets of a method, options that are given override.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// Smaller files: lengths are twice those of `Balanced`.
    Small,
    /// In between.
    #[default]
    Balanced,
    /// Finer detail: lengths are half of those of `Balanced`.
    Fine,
}
choices!(Quality { Small = "small", Balanced = "balanced", Fine = "fine" });

impl Quality {
    /// What lengths that follow from the data are multiplied by.
    pub(crate) fn scale(self) -> f64 {
        match self {
            Self::Small => 2.0,
            Self::Balanced => 1.0,
            Self::Fine => 0.5,
        }
    }
}
