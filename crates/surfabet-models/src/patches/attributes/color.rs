//! Colour as a field of luma and two chromas.

use surfabet_entropy::Coder;

use super::borders::{BorderBlocks, Corrections, FieldCells};
use super::field::{CellValues, Steps, choose_field, code_field};
use super::field_coding::FieldCoding;
use crate::color::rounded;

/// How finely colour is coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColorSteps {
    /// Rounding of the luma coefficients, 0..255 times the root of the number of cells; 1 to 4096.
    pub luma: u32,
    /// Rounding of the chroma coefficients, 1 to 4096.
    pub chroma: u32,
}

impl ColorSteps {
    /// Checks that both are in their domain.
    pub fn is_valid(self) -> bool {
        [self.luma, self.chroma].iter().all(|s| (1..=4096).contains(s))
    }

    /// By channel.
    fn of_channels(self) -> Steps<3> {
        Steps([self.luma, self.chroma, self.chroma])
    }
}

/// Colours of the cells around the surface.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::patches) struct ColorField {
    pub steps: ColorSteps,
    coding: FieldCoding,
    /// Coefficients of the transform, as a file stores them.
    coefficients: Vec<i32>,
    corrections: Option<Corrections>,
    /// Red, green and blue of each cell.
    pub colors: Vec<[u8; 3]>,
}

impl ColorField {
    /// The field that costs least: `targets` are the colours that the `cells` should have, red, green and blue,
    /// 0 to 255; `lambda` the squared grey levels that a bit must save. `missed` gives what decoded values, channels, miss at the
    /// blocks of a border.
    pub fn choose(
        cells: FieldCells<'_>,
        targets: &[[f32; 3]],
        steps: ColorSteps,
        lambda: f32,
        missed: impl Fn(&BorderBlocks, &[[f32; 3]]) -> Vec<[f32; 3]>,
    ) -> Self {
        let values: Vec<[f32; 3]> = targets.iter().map(|&color| to_channels(color)).collect();
        let mut coded = choose_field(cells.keys, steps.of_channels(), &values, lambda);
        let corrections = cells.border.map(|border| {
            let missed = missed(border, &coded.values);
            let values = &mut coded.values;
            border.choose(steps.of_channels(), &missed, lambda, cells.keys, values)
        });
        Self::of(steps, FieldCoding::Whole, coded, corrections)
    }

    fn of(
        steps: ColorSteps,
        coding: FieldCoding,
        coded: CellValues<3>,
        corrections: Option<Corrections>,
    ) -> Self {
        let CellValues { values, coefficients } = coded;
        let colors = values.into_iter().map(|value| rounded(to_rgb(value))).collect();
        Self { steps, coding, coefficients, corrections, colors }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: FieldCells<'_>) -> Result<(), C::Error> {
        let (steps, given) = (self.steps.of_channels(), Some(self.coefficients.as_slice()));
        let mut coded = code_field(coder, cells.keys, steps, self.coding, given)?;
        if let Some(border) = cells.border {
            let given = self.corrections.as_ref();
            border.code(coder, steps, given, cells.keys, &mut coded.values)?;
        }
        Ok(())
    }

    /// Reads the field that [`ColorField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder, also for steps that no model has.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: FieldCells<'_>,
        steps: ColorSteps,
        coding: FieldCoding,
    ) -> Result<Self, C::Error> {
        if !steps.is_valid() {
            return Err(coder.corrupt(format!("{steps:?} are not 1 to 4096")));
        }
        let channels = steps.of_channels();
        let mut coded = code_field(coder, cells.keys, channels, coding, None)?;
        let corrections = match cells.border {
            Some(border) => {
                Some(border.code(coder, channels, None, cells.keys, &mut coded.values)?)
            }
            None => None,
        };
        Ok(Self::of(steps, coding, coded, corrections))
    }
}

/// sqrt(1/3).
const T: f32 = 0.577_350_26;

/// sqrt(1/2).
const H: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// sqrt(1/6).
const S: f32 = 0.408_248_3;

/// Luma and two chromas, orange and green, by an orthonormal matrix.
pub(super) fn to_channels([r, g, b]: [f32; 3]) -> [f32; 3] {
    [T * (r + g + b), H * (r - b), S * (2.0 * g - r - b)]
}

/// Red, green and blue of [`to_channels`].
fn to_rgb([y, o, g]: [f32; 3]) -> [f32; 3] {
    [T * y + H * o - S * g, T * y + 2.0 * S * g, T * y - H * o - S * g]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn channels_come_back_and_keep_lengths(color in prop::array::uniform3(0.0_f32..255.0)) {
            let channels = to_channels(color);
            let square = |v: [f32; 3]| v.iter().map(|x| x * x).sum::<f32>();
            prop_assert!((square(channels) - square(color)).abs() <= 1e-5 * square(color) + 1e-3);
            for (back, c) in to_rgb(channels).into_iter().zip(color) {
                prop_assert!((back - c).abs() < 1e-3);
            }
        }
    }
}
