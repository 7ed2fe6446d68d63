//! Colour as a field of luma and two chromas.

use surfabet_entropy::Coder;

use super::borders::{BorderBlocks, FieldCells, Stored};
use super::field::Steps;
use super::wanted::Wanted;
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
    stored: Stored,
    /// Red, green and blue of each cell.
    pub colors: Vec<[u8; 3]>,
}

impl ColorField {
    /// The field that costs least: `wanted` are the channels that the `cells` should have; `lambda` the squared grey levels that a
    /// bit must save. `missed` gives what decoded values, channels, miss at the
    /// blocks of a border.
    pub fn choose(
        cells: FieldCells<'_>,
        wanted: &Wanted<'_, 3>,
        steps: ColorSteps,
        lambda: f32,
        missed: impl Fn(&BorderBlocks, &[[f32; 3]]) -> Vec<[f32; 3]>,
    ) -> Self {
        let (values, stored) = cells.choose(steps.of_channels(), wanted, lambda, missed);
        Self::of(steps, values, stored)
    }

    fn of(steps: ColorSteps, values: Vec<[f32; 3]>, stored: Stored) -> Self {
        let colors = values.into_iter().map(|value| rounded(to_rgb(value))).collect();
        Self { steps, stored, colors }
    }

    /// Writes or prices the field.
    ///
    /// # Errors
    /// Those of the coder.
    pub fn write<C: Coder>(&self, coder: &mut C, cells: FieldCells<'_>) -> Result<(), C::Error> {
        let steps = self.steps.of_channels();
        cells.code(coder, steps, Some(&self.stored)).map(|_| ())
    }

    /// Reads the field that [`ColorField::write`] wrote.
    ///
    /// # Errors
    /// Those of the coder, also for steps that no model has.
    pub fn read<C: Coder>(
        coder: &mut C,
        cells: FieldCells<'_>,
        steps: ColorSteps,
    ) -> Result<Self, C::Error> {
        if !steps.is_valid() {
            return Err(coder.corrupt(format!("{steps:?} are not 1 to 4096")));
        }
        let (values, stored) = cells.code(coder, steps.of_channels(), None)?;
        Ok(Self::of(steps, values, stored))
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
