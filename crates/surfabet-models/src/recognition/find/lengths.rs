//! The lengths that a search works with.

use super::options::{FindOptions, Region};
use crate::alphabet::model::AlphabetModel;
use crate::error::Result;
use crate::recognition::constants::{LEAST_SPACING, LEAST_TOLERANCE, SAMPLES_PER_DIAGONAL};

/// Lengths of a search, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lengths {
    /// Of the example's region.
    pub diagonal: f64,
    /// Distance of samples.
    pub spacing: f64,
    /// Standard deviation of equal surfaces.
    pub tolerance: f64,
}

impl Lengths {
    /// What `options` leaves open follows from the size of the example, and from the median sigma of the occurrences in
    /// it.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for an example without occurrences.
    pub fn new(model: &AlphabetModel, example: &Region, options: &FindOptions) -> Result<Self> {
        let diagonal = example.about(model.header().origin).diagonal();
        let spacing =
            options.resolution.unwrap_or((diagonal / SAMPLES_PER_DIAGONAL).max(LEAST_SPACING));
        let inside = model.occurrences().filter(|o| example.contains(o.center));
        let mut sigmas: Vec<f64> = inside.map(|o| o.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let Some(&sigma) = sigmas.get(sigmas.len() / 2) else {
            return Err(example.invalid("a region with occurrences of words"));
        };
        let tolerance = options.tolerance.unwrap_or(sigma.max(LEAST_TOLERANCE * spacing));
        Ok(Self { diagonal, spacing, tolerance })
    }
}
