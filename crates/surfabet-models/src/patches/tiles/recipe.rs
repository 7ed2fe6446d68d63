//! What a map in tiles remembers of how it was learned, so that a tile can be learned again.

use surfabet_geom::Survey;

use super::{Cubes, TilePlan, Views};
use crate::error::{Error, Result, positive};
use crate::options::Options;
use crate::patches::attributes::FieldCoding;
use crate::patches::model::PatchesHeader;
use crate::patches::options::{DEPTH_STEPS, PatchesOptions};
use crate::sensor::Sensor;

/// What of the data and of the options tiles are learned by, as far as the header does not hold it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Recipe {
    /// Samples of a pixel, mean.
    pub density: f64,
    /// How far from a point its surface may be decoded and still show it, metres.
    pub tolerance: f64,
    /// Distance of surfaces that lie close behind one another, metres, where many do.
    pub layer_gap: Option<f64>,
    /// How the sides of surfaces are known.
    pub views: Views,
    /// Squared pixels that a bit of geometry must save.
    pub rate: f64,
    /// Least share of the points that are within the tolerance.
    pub completeness: f64,
    /// Squared colour steps that a bit of colour must save.
    pub color_rate: f64,
    /// Squared steps that a bit of a scalar must save.
    pub attribute_rate: f64,
    /// Rounds of choosing patches.
    pub rounds: u32,
    /// How the error of a measurement grows with its range.
    pub sensor: Sensor,
}

impl Recipe {
    /// What a plan and options have.
    pub fn of(plan: &TilePlan, options: &PatchesOptions) -> Self {
        Self {
            density: plan.density,
            tolerance: plan.tolerance,
            layer_gap: plan.survey.layer_gap,
            views: plan.views,
            rate: options.rate,
            completeness: options.completeness,
            color_rate: options.color_rate,
            attribute_rate: options.attribute_rate,
            rounds: options.rounds,
            sensor: options.sensor,
        }
    }

    /// Checks that learning may have it.
    ///
    /// # Errors
    /// [`Error::Inconsistent`].
    pub fn check(&self) -> Result<()> {
        let options = PatchesOptions { levels: 1, ..self.options() };
        let in_words = |error: Error| Error::Inconsistent(error.to_string());
        options.check().map_err(in_words)?;
        positive("density", self.density, "a positive number").map_err(in_words)?;
        let lengths = [Some(self.tolerance), self.layer_gap];
        let is_length = |length: &f64| length.is_finite() && *length >= 0.0;
        match lengths.iter().flatten().find(|length| !is_length(length)) {
            Some(length) => Err(Error::Inconsistent(format!("a length of {length} m"))),
            None => Ok(()),
        }
    }

    /// The options, where they are no matter of the header.
    fn options(&self) -> PatchesOptions {
        PatchesOptions {
            rate: self.rate,
            completeness: self.completeness,
            color_rate: self.color_rate,
            attribute_rate: self.attribute_rate,
            rounds: self.rounds,
            sensor: self.sensor,
            ..PatchesOptions::default()
        }
    }

    /// The plan and the options of a map with so many levels of detail, of which `header` is the last.
    pub fn plan_of(
        &self,
        header: &PatchesHeader,
        cubes: Cubes,
        details: u32,
    ) -> (TilePlan, PatchesOptions) {
        let lattice = header.lattice;
        let survey = Survey {
            layer_gap: self.layer_gap,
            has_facings: self.views != Views::None,
            ..Survey::default()
        };
        let plan = TilePlan {
            lattice,
            cubes,
            survey,
            tolerance: self.tolerance,
            density: self.density,
            views: self.views,
            attributes: header.attributes.clone(),
            corrected: header.border.is_some(),
            estimated: header.coding == FieldCoding::Estimated,
            details,
            chosen: Vec::new(),
        };
        let colors = header.color.map(|_| "colors".to_owned());
        let others = header.attributes.iter().map(|attribute| attribute.name.clone());
        let mut options = PatchesOptions {
            resolution: Some(lattice.pixel_size),
            levels: lattice.levels,
            depth_step: Some(f64::from(lattice.depth_step) / DEPTH_STEPS),
            attributes: Some(colors.into_iter().chain(others).collect()),
            ..self.options()
        };
        if let Some(steps) = header.color {
            options.color_step = steps.luma;
            options.chroma_ratio = f64::from(steps.chroma) / f64::from(steps.luma);
        }
        (plan, options)
    }
}
