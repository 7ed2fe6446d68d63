//! Colour as a field of luma and two chromas.

use surfabet_entropy::Coder;

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
    /// Red, green and blue of each cell.
    pub colors: Vec<[u8; 3]>,
}

impl ColorField {
    /// The field that costs least: `targets` are the colours that the sorted `cells` should have, red, green and blue,
    /// 0 to 255; `lambda` the squared grey levels that a bit must save.
    pub fn choose(cells: &[u64], targets: &[[f32; 3]], steps: ColorSteps, lambda: f32) -> Self {
        let values: Vec<[f32; 3]> = targets.iter().map(|&color| to_channels(color)).collect();
        let coded = choose_field(cells, steps.of_channels(), &values, lambda);
        Self::of(steps, FieldCoding::Whole, coded)
    }

    fn of(steps: ColorSteps, coding: FieldCoding, coded: CellValues<3>) -> Self {
        let CellValues { values, coefficients } = coded;
        let colors = values.into_iter().map(|value| rounded(to_rgb(value))).collect();
        Self { steps, coding, coefficients, colors }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: &[u64]) -> Result<(), C::Error> {
        let given = Some(self.coefficients.as_slice());
        code_field(coder, cells, self.steps.of_channels(), self.coding, given).map(|_| ())
    }

    /// Reads the field that [`ColorField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder, also for steps that no model has.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: &[u64],
        steps: ColorSteps,
        coding: FieldCoding,
    ) -> Result<Self, C::Error> {
        if !steps.is_valid() {
            return Err(coder.corrupt(format!("{steps:?} are not 1 to 4096")));
        }
        let coded = code_field(coder, cells, steps.of_channels(), coding, None)?;
        Ok(Self::of(steps, coding, coded))
    }
}

/// sqrt(1/3).
const T: f32 = 0.577_350_26;

/// sqrt(1/2).
const H: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// sqrt(1/6).
const S: f32 = 0.408_248_3;

/// Luma and two chromas, orange and green, by an orthonormal matrix.
fn to_channels([r, g, b]: [f32; 3]) -> [f32; 3] {
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
