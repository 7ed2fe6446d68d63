//! Bitmasks: whether all pixels are set, else pixel by pixel.

use surfabet_entropy::{Bit, Coder};

use crate::hscsm::model::LevelHeader;

/// Models of mask pixels, by six neighbours coded before and whether the pixel is in the first row or column.
struct MaskModels {
    full: Bit,
    pixel: Vec<Bit>,
}

impl MaskModels {
    fn new() -> Self {
        Self { full: Bit::new(), pixel: vec![Bit::with_memory(Bit::MAX_MEMORY); 256] }
    }

    /// The model of the pixel after those in `before`, row-major, in rows of `n`.
    fn at(&mut self, before: &[u8], n: usize) -> &mut Bit {
        let (row, column) = ((before.len() / n) as i32, (before.len() % n) as i32);
        let pixel = |dy: i32, dx: i32| {
            let (y, x) = (row - dy, column + dx);
            let inside = y >= 0 && (0..n as i32).contains(&x);
            // Rows above and pixels to the left are in `before`.
            usize::from(inside && before[y as usize * n + x as usize] != 0)
        };
        let mut context = usize::from(row == 0) | usize::from(column == 0) << 1;
        for (dy, dx) in [(0, -1), (1, 0), (1, -1), (1, 1), (0, -2), (2, 0)] {
            context = context << 1 | pixel(dy, dx);
        }
        &mut self.pixel[context]
    }
}

/// Writes, reads or prices the bitmasks of one level, patch after patch, one byte per pixel; `given` is what to
/// write, and empty when reading.
///
/// # Errors
/// Those of the coder.
pub(super) fn code_masks<C: Coder>(
    coder: &mut C,
    level: &LevelHeader,
    given: &[u8],
) -> Result<Vec<u8>, C::Error> {
    let (area, side) = (level.area(), level.pixels as usize);
    let mut models = MaskModels::new();
    let mut masks = Vec::new();
    for _ in 0..level.n_patches {
        let from = masks.len();
        let given = given.get(from..from + area).unwrap_or_default();
        if coder.bit(&mut models.full, given.iter().all(|&m| m != 0))? {
            masks.resize(from + area, 1);
            continue;
        }
        for at in 0..area {
            let set = given.get(at).is_some_and(|&m| m != 0);
            let set = coder.bit(models.at(&masks[from..], side), set)?;
            masks.push(u8::from(set));
        }
    }
    Ok(masks)
}
