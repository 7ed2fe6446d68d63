//! Masks of supported tiles, each tile by the six coded before around it.

use surfabet_entropy::{Bit, Coder};

use super::stored::StoredPatch;

/// Adaptive models of the tiles by their contexts.
pub(super) struct MaskModels {
    supported: Vec<Bit>,
}

impl MaskModels {
    pub fn new() -> Self {
        Self { supported: vec![Bit::with_memory(Bit::MAX_MEMORY); 1 << 6] }
    }
}

/// Codes which tiles of a patch are supported.
pub(super) fn code_mask<C: Coder>(
    coder: &mut C,
    models: &mut MaskModels,
    wanted: &StoredPatch,
    shape: [u32; 2],
) -> Result<Vec<bool>, C::Error> {
    let [nx, ny] = shape.map(|n| n as usize);
    let mut coded: Vec<bool> = Vec::new();
    for y in 0..ny {
        for x in 0..nx {
            // Columns to the left and rows up; tiles outside count as not supported.
            let at = |left: isize, up: usize| {
                let column = x.wrapping_add_signed(-left);
                let inside = column < nx && up <= y;
                usize::from(inside && coded[(y - up) * nx + column])
            };
            let context = at(1, 0) << 5
                | at(0, 1) << 4
                | at(1, 1) << 3
                | at(-1, 1) << 2
                | at(2, 0) << 1
                | at(0, 2);
            let value = wanted.supported.get(y * nx + x).copied().unwrap_or_default();
            coded.push(coder.bit(&mut models.supported[context], value)?);
        }
    }
    Ok(coded)
}
