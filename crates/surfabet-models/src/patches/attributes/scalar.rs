//! A scalar, such as intensity, as a field of one channel in steps of its own.

use surfabet_entropy::{Coder, Price};

use super::field::{CellValues, FieldSource, Steps, code_field};
use super::prediction::Prediction;
use crate::scalar::ScalarScale;

/// Values are in steps already.
fn steps(prediction: Prediction) -> Steps<1> {
    Steps { of_channels: [1.0], prediction }
}

/// A scalar on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct ScalarField {
    pub scale: ScalarScale,
    prediction: Prediction,
    /// Coefficients of the transform, as a file stores them.
    coefficients: Vec<i32>,
    /// Value of each cell, in steps from the low end of the scale.
    pub values: Vec<f32>,
}

impl ScalarField {
    /// The field that costs least: `targets` are the values that the sorted `cells` should have, in steps; `lambda` the
    /// squared steps that a bit must save.
    pub fn choose(cells: &[u64], targets: &[[f32; 1]], scale: ScalarScale, lambda: f32) -> Self {
        let source = FieldSource::Targets { values: targets, lambda };
        let prediction = Prediction::Beside;
        let Ok(coded) = code_field(&mut Price::default(), cells, steps(prediction), source);
        Self::of(scale, prediction, coded)
    }

    fn of(scale: ScalarScale, prediction: Prediction, coded: CellValues<1>) -> Self {
        let CellValues { values, coefficients } = coded;
        let values = values.into_iter().map(|[value]| value).collect();
        Self { scale, prediction, coefficients, values }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: &[u64]) -> Result<(), C::Error> {
        let source = FieldSource::Model(&self.coefficients);
        code_field(coder, cells, steps(self.prediction), source).map(|_| ())
    }

    /// Reads the field that [`ScalarField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: &[u64],
        scale: ScalarScale,
        prediction: Prediction,
    ) -> Result<Self, C::Error> {
        let coded = code_field(coder, cells, steps(prediction), FieldSource::Stream)?;
        Ok(Self::of(scale, prediction, coded))
    }
}
