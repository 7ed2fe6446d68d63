//! The channels that colour is coded in, and their steps.

use crate::patches::constants::STEP_SHARES;

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

    /// Step of a channel at a level of the pyramid.
    pub(super) fn of(self, channel: usize, level: usize) -> f32 {
        let step = if channel == 0 { self.luma } else { self.chroma };
        step as f32 * STEP_SHARES[level.min(STEP_SHARES.len() - 1)]
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
pub(super) fn to_rgb([y, o, g]: [f32; 3]) -> [f32; 3] {
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
