//! A scalar, such as intensity, as a field of one channel in steps of its own.

use surfabet_entropy::{Coder, Price};

use super::field::{CellValues, FieldSource, Steps, code_field};
use crate::scalar::ScalarScale;

/// Values are in steps already.
const STEPS: Steps<1> = Steps([1.0]);

/// A scalar on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct ScalarField {
    pub scale: ScalarScale,
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
        let Ok(coded) = code_field(&mut Price::default(), cells, STEPS, source);
        Self::of(scale, coded)
    }

    fn of(scale: ScalarScale, CellValues { values, coefficients }: CellValues<1>) -> Self {
        Self { scale, coefficients, values: values.into_iter().map(|[value]| value).collect() }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: &[u64]) -> Result<(), C::Error> {
        let source = FieldSource::Model(&self.coefficients);
        code_field(coder, cells, STEPS, source).map(|_| ())
    }

    /// Reads the field that [`ScalarField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: &[u64],
        scale: ScalarScale,
    ) -> Result<Self, C::Error> {
        Ok(Self::of(scale, code_field(coder, cells, STEPS, FieldSource::Stream)?))
    }
}
