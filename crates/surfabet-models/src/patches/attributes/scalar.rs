//! A scalar, such as intensity, as a field of one channel in steps of its own.

use surfabet_entropy::Coder;

use super::field::{CellValues, Steps, choose_field, code_field};
use super::field_coding::FieldCoding;
use crate::scalar::ScalarScale;

/// Values are in steps already.
const STEPS: Steps<1> = Steps([1]);

/// A scalar on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct ScalarField {
    pub scale: ScalarScale,
    coding: FieldCoding,
    /// Coefficients of the transform, as a file stores them.
    coefficients: Vec<i32>,
    /// Value of each cell, in steps from the low end of the scale.
    pub values: Vec<f32>,
}

impl ScalarField {
    /// The field that costs least: `targets` are the values that the sorted `cells` should have, in steps; `lambda` the
    /// squared steps that a bit must save.
    pub fn choose(cells: &[u64], targets: &[[f32; 1]], scale: ScalarScale, lambda: f32) -> Self {
        Self::of(scale, FieldCoding::Whole, choose_field(cells, STEPS, targets, lambda))
    }

    fn of(scale: ScalarScale, coding: FieldCoding, coded: CellValues<1>) -> Self {
        let CellValues { values, coefficients } = coded;
        let values = values.into_iter().map(|[value]| value).collect();
        Self { scale, coding, coefficients, values }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: &[u64]) -> Result<(), C::Error> {
        let given = Some(self.coefficients.as_slice());
        code_field(coder, cells, STEPS, self.coding, given).map(|_| ())
    }

    /// Reads the field that [`ScalarField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: &[u64],
        scale: ScalarScale,
        coding: FieldCoding,
    ) -> Result<Self, C::Error> {
        let coded = code_field(coder, cells, STEPS, coding, None)?;
        Ok(Self::of(scale, coding, coded))
    }
}
