//! Colours as luma and two chromas (YCoCg), which vary more independently than red, green and blue do.

use surfabet_base::rounding::{round_f32, round_f64};

/// Luma, orange and green chroma.
pub fn to_ycocg([r, g, b]: [f32; 3]) -> [f32; 3] {
    let co = r - b;
    let t = b + 0.5 * co;
    let cg = g - t;
    [t + 0.5 * cg, co, cg]
}

/// Red, green and blue of luma, orange and green chroma; the inverse of [`to_ycocg`]. Exact for integers below 2^20.
pub(crate) fn to_rgb([y, co, cg]: [f32; 3]) -> [f32; 3] {
    let t = y - 0.5 * cg;
    let green = cg + t;
    let blue = t - 0.5 * co;
    [blue + co, green, blue]
}

/// Largest number of a [`code`], either way.
pub(crate) const MAX_COLOR_CODE: i16 = 512;

/// Luma, orange and green chroma of red, green and blue, in whole steps.
pub(crate) fn code([r, g, b]: [f64; 3], step: u32) -> [i16; 3] {
    let limit = f64::from(MAX_COLOR_CODE);
    let ycc = [0.25 * (r + 2.0 * g + b), r - b, g - 0.5 * (r + b)];
    ycc.map(|c| round_f64((c / f64::from(step)).clamp(-limit, limit)) as i16)
}

/// Red, green and blue of a [`code`].
pub(crate) fn of_code(code: [i16; 3], step: u32) -> [f32; 3] {
    to_rgb(code.map(|c| f32::from(c) * step as f32))
}

/// A colour as three bytes.
pub(crate) fn rounded(color: [f32; 3]) -> [u8; 3] {
    color.map(|c| round_f32(c).clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn bytes_come_back(rgb in prop::array::uniform3(0_u8..)) {
            prop_assert_eq!(to_rgb(to_ycocg(rgb.map(f32::from))), rgb.map(f32::from));
        }

        #[test]
        fn integers_are_transformed_exactly(code in prop::array::uniform3(-(1_i32 << 20)..1 << 20)) {
            let [y, co, cg] = code.map(f64::from);
            let low = y - 0.5 * cg;
            let exact = [low + 0.5 * co, y + 0.5 * cg, low - 0.5 * co];
            prop_assert_eq!(to_rgb(code.map(|c| c as f32)).map(f64::from), exact);
        }
    }
}
