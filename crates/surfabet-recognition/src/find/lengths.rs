//! The lengths that a search works with.

use surfabet_geom::vector::distance;
use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::{Error, Result};

use super::options::{FindOptions, Region};
use crate::constants::{
    LEAST_SPACING, LEAST_TOLERANCE, SAMPLES_PER_DIAGONAL, SIZE_TOLERANCE, SURROUNDINGS,
};

/// Lengths of a search, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lengths {
    /// Of the example's region.
    pub diagonal: f64,
    /// Distance of samples.
    pub spacing: f64,
    /// Standard deviation of equal surfaces.
    pub tolerance: f64,
    /// How far from the example's samples a place has to be explained; `None` for all of its region.
    pub surroundings: Option<f64>,
    /// Largest change of a size, as a share.
    pub size_tolerance: f64,
}

impl Lengths {
    /// What `options` leaves open follows from the size of the example, and from the median sigma of the occurrences in
    /// it.
    ///
    /// # Errors
    /// [`surfabet_models::Error::InvalidParameter`] for an example without occurrences.
    pub fn new(model: &AlphabetModel, example: &Region, options: &FindOptions) -> Result<Self> {
        let diagonal = example.about(model.header().origin).diagonal();
        let Some(sigma) = median_sigma(model, |center| example.contains(center)) else {
            return Err(without_words(model, example));
        };
        let mut lengths = Self::of_size(diagonal, sigma, options);
        lengths.size_tolerance = options.size_tolerance.unwrap_or(0.0);
        Ok(lengths)
    }

    /// Of an example of another scene: equal surfaces differ by the larger of both median sigmas. `is_whole` when the example is
    /// all of its model.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn across(
        scene: &AlphabetModel,
        model: &AlphabetModel,
        example: &Region,
        is_whole: bool,
        options: &FindOptions,
    ) -> Result<Self> {
        let mut lengths = Self::new(model, example, options)?;
        let sigma = median_sigma(scene, |_| true).unwrap_or(0.0);
        if options.tolerance.is_none() {
            lengths.tolerance = lengths.tolerance.max(sigma);
        }
        lengths.size_tolerance = options.size_tolerance.unwrap_or(SIZE_TOLERANCE);
        lengths.surroundings = is_whole.then_some(SURROUNDINGS * lengths.diagonal);
        Ok(lengths)
    }

    fn of_size(diagonal: f64, sigma: f64, options: &FindOptions) -> Self {
        let spacing =
            options.resolution.unwrap_or((diagonal / SAMPLES_PER_DIAGONAL).max(LEAST_SPACING));
        let tolerance = options.tolerance.unwrap_or(sigma.max(LEAST_TOLERANCE * spacing));
        Self { diagonal, spacing, tolerance, surroundings: None, size_tolerance: 0.0 }
    }
}

/// The median sigma of the occurrences with their middle in a region.
pub(crate) fn median_sigma(
    model: &AlphabetModel,
    is_inside: impl Fn([f64; 3]) -> bool,
) -> Option<f64> {
    let mut sigmas: Vec<f64> =
        model.occurrences().filter(|o| is_inside(o.center)).map(|o| o.sigma).collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).copied()
}

/// The error for a region without words, which names the nearest.
fn without_words(model: &AlphabetModel, region: &Region) -> Error {
    let middle = region.middle();
    let centers = model.occurrences().map(|o| o.center);
    let nearest = centers.min_by(|a, b| distance(*a, middle).total_cmp(&distance(*b, middle)));
    let Some([x, y, z]) = nearest else {
        return region.invalid("a region with occurrences of words, of which the model has none");
    };
    let away = distance([x, y, z], middle);
    region.invalid(format!(
        "a region with occurrences of words: the nearest is at ({x:.2}, {y:.2}, {z:.2}), {away:.2} m from its middle"
    ))
}
