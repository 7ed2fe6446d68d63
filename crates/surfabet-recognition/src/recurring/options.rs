//! Options of recurring things.

use surfabet_models::options::{Range, options};

options! {
    /// Options of [`recurring`](crate::recurring()).
    pub struct RecurringOptions {
        /// How often a thing must occur.
        min_count: u32 = 3, range = Range::from_to(2.0, 1_000_000.0);
        /// Smallest diagonal of a thing.
        min_size: f64 = 0.2, range = Range::POSITIVE, unit = "metres";
        /// Largest diagonal of a thing; smooth surfaces that are larger, such as walls and floors, are no part of any.
        max_size: f64 = 2.2, range = Range::POSITIVE, unit = "metres";
        /// Least score of an occurrence against the thing that stands for its class, as of `find`; 0.85 of it where the
        /// thing grew from a piece.
        min_score: f64 = 0.5, range = Range::from_to(0.0, 1.0);
        /// Spacing of the samples that are compared.
        resolution: Option<f64> = None, range = Range::POSITIVE, unit = "metres",
            none = "the median sigma of all occurrences, at least 0.015 m, and no closer than 4 million samples allow";
        /// Standard deviation of equal surfaces.
        tolerance: Option<f64> = None, range = Range::POSITIVE, unit = "metres",
            none = "the median sigma of all occurrences";
        /// Standard deviation of equal chromas.
        color_tolerance: Option<f64> = None, range = Range::POSITIVE, unit = "grey levels",
            none = "shape alone counts";
        /// Largest change of a size, what is level and what is upright each by its own factor.
        size_tolerance: f64 = 0.0, range = Range::from_to(0.0, 0.3), unit = "as a share";
    }
}
