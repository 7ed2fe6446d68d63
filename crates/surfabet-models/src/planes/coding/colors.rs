//! Colours of supported tiles, each predicted by those to the left and above.

use surfabet_entropy::{Coder, SInt};

use super::stored::StoredPatch;
use super::syntax::code_residual;
use crate::color::MAX_COLOR_CODE;

/// Adaptive models of the colours, and the last colour.
pub(super) struct ColorModels {
    /// By the number of neighbours.
    luma: [SInt; 3],
    /// For each chroma two, by whether the channel before had a residual of more than one step.
    chroma: [SInt; 4],
    last: [i16; 3],
}

impl ColorModels {
    pub fn new() -> Self {
        Self { luma: [const { SInt::new() }; 3], chroma: [const { SInt::new() }; 4], last: [0; 3] }
    }
}

/// Codes the colours of the supported tiles of a patch.
pub(super) fn code_colors<C: Coder>(
    coder: &mut C,
    models: &mut ColorModels,
    wanted: &StoredPatch,
    patch: &StoredPatch,
) -> Result<Vec<[i16; 3]>, C::Error> {
    let nx = patch.shape[0] as usize;
    let mut coded: Vec<[i16; 3]> = Vec::new();
    let mut above: Vec<Option<[i16; 3]>> = vec![None; nx];
    for row in patch.supported.chunks(nx) {
        let mut left = None;
        for (x, _) in row.iter().enumerate() {
            if !row[x] {
                (above[x], left) = (None, None);
                continue;
            }
            let (predicted, n) = match (left, above[x]) {
                (Some(a), Some(b)) => {
                    let mean = |c: usize| (i32::from(a[c]) + i32::from(b[c]) + 1).div_euclid(2);
                    ([mean(0), mean(1), mean(2)], 2)
                }
                (Some(one), None) | (None, Some(one)) => (one.map(i32::from), 1),
                (None, None) => (models.last.map(i32::from), 0),
            };
            let to = wanted.colors.get(coded.len()).copied().unwrap_or_default();
            let mut color = [0; 3];
            let mut active = 0;
            for channel in 0..3 {
                let model = match channel {
                    0 => &mut models.luma[n],
                    _ => &mut models.chroma[2 * (channel - 1) + active],
                };
                let limit = i32::from(MAX_COLOR_CODE);
                let (from, to) = (predicted[channel], i32::from(to[channel]));
                let value = code_residual(coder, model, from, to, -limit..=limit, "a colour")?;
                color[channel] = value as i16;
                active = usize::from((value - from).abs() > 1);
            }
            coded.push(color);
            (above[x], left, models.last) = (Some(color), Some(color), color);
        }
    }
    Ok(coded)
}
