//! A scalar, such as intensity, as a field of one channel in steps of its own.

use surfabet_entropy::Coder;

use super::borders::{BorderBlocks, Corrections, FieldCells};
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
    corrections: Option<Corrections>,
    /// Value of each cell, in steps from the low end of the scale.
    pub values: Vec<f32>,
}

impl ScalarField {
    /// The field that costs least: `targets` are the values that the `cells` should have, in steps; `lambda` the
    /// squared steps that a bit must save. `missed` gives what decoded values miss at the blocks of a border.
    pub fn choose(
        cells: FieldCells<'_>,
        targets: &[[f32; 1]],
        scale: ScalarScale,
        lambda: f32,
        missed: impl Fn(&BorderBlocks, &[[f32; 1]]) -> Vec<[f32; 1]>,
    ) -> Self {
        let mut coded = choose_field(cells.keys, STEPS, targets, lambda);
        let corrections = cells.border.map(|border| {
            let missed = missed(border, &coded.values);
            border.choose(STEPS, &missed, lambda, cells.keys, &mut coded.values)
        });
        Self::of(scale, FieldCoding::Whole, coded, corrections)
    }

    fn of(
        scale: ScalarScale,
        coding: FieldCoding,
        coded: CellValues<1>,
        corrections: Option<Corrections>,
    ) -> Self {
        let CellValues { values, coefficients } = coded;
        let values = values.into_iter().map(|[value]| value).collect();
        Self { scale, coding, coefficients, corrections, values }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: FieldCells<'_>) -> Result<(), C::Error> {
        let given = Some(self.coefficients.as_slice());
        let mut coded = code_field(coder, cells.keys, STEPS, self.coding, given)?;
        if let Some(border) = cells.border {
            let given = self.corrections.as_ref();
            border.code(coder, STEPS, given, cells.keys, &mut coded.values)?;
        }
        Ok(())
    }

    /// Reads the field that [`ScalarField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: FieldCells<'_>,
        scale: ScalarScale,
        coding: FieldCoding,
    ) -> Result<Self, C::Error> {
        let mut coded = code_field(coder, cells.keys, STEPS, coding, None)?;
        let corrections = match cells.border {
            Some(border) => Some(border.code(coder, STEPS, None, cells.keys, &mut coded.values)?),
            None => None,
        };
        Ok(Self::of(scale, coding, coded, corrections))
    }
}
