//! A scalar, such as intensity, as a field of one channel in steps of its own.

use surfabet_entropy::Coder;

use super::borders::{BorderBlocks, FieldCells, Stored};
use super::field::Steps;
use super::wanted::Wanted;
use crate::scalar::ScalarScale;

/// Values are in steps already.
const STEPS: Steps<1> = Steps([1]);

/// A scalar on the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct ScalarField {
    pub scale: ScalarScale,
    stored: Stored,
    /// Value of each cell, in steps from the low end of the scale.
    pub values: Vec<f32>,
}

impl ScalarField {
    /// The field that costs least: `wanted` are the values that the `cells` should have, in steps; `lambda` the
    /// squared steps that a bit must save. `missed` gives what decoded values miss at the blocks of a border.
    pub fn choose(
        cells: FieldCells<'_>,
        wanted: &Wanted<'_, 1>,
        scale: ScalarScale,
        lambda: f32,
        missed: impl Fn(&BorderBlocks, &[[f32; 1]]) -> Vec<[f32; 1]>,
    ) -> Self {
        let (values, stored) = cells.choose(STEPS, wanted, lambda, missed);
        Self::of(scale, values, stored)
    }

    fn of(scale: ScalarScale, values: Vec<[f32; 1]>, stored: Stored) -> Self {
        let values = values.into_iter().map(|[value]| value).collect();
        Self { scale, stored, values }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: FieldCells<'_>) -> Result<(), C::Error> {
        cells.code(coder, STEPS, Some(&self.stored)).map(|_| ())
    }

    /// Reads the field that [`ScalarField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: FieldCells<'_>,
        scale: ScalarScale,
    ) -> Result<Self, C::Error> {
        let (values, stored) = cells.code(coder, STEPS, None)?;
        Ok(Self::of(scale, values, stored))
    }
}
