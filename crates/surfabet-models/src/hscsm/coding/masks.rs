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

/// Models of the blocks of mask pixels that make up a pixel, where bitmasks are finer than images.
struct BlockModels {
    /// Whether a block has a set pixel, and whether it has all, by what the blocks left and above have.
    any: Vec<Bit>,
    all: Vec<Bit>,
}

/// What a block has: no set pixel, some, all.
#[derive(Clone, Copy, PartialEq, Eq)]
enum BlockFill {
    Empty,
    Mixed,
    Full,
}

impl BlockModels {
    fn new() -> Self {
        Self { any: vec![Bit::new(); 9], all: vec![Bit::new(); 9] }
    }

    /// Writes, reads or prices the block after those in `before`, row-major, in rows of `n`.
    fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        before: &[BlockFill],
        n: usize,
        given: BlockFill,
    ) -> Result<BlockFill, C::Error> {
        let at = before.len();
        let left = if at.is_multiple_of(n) { BlockFill::Empty } else { before[at - 1] };
        let above = if at < n { BlockFill::Empty } else { before[at - n] };
        let context = left as usize * 3 + above as usize;
        if !coder.bit(&mut self.any[context], given != BlockFill::Empty)? {
            return Ok(BlockFill::Empty);
        }
        let all = coder.bit(&mut self.all[context], given == BlockFill::Full)?;
        Ok(if all { BlockFill::Full } else { BlockFill::Mixed })
    }
}

/// Writes, reads or prices the bitmask of a patch of `n` x `n` blocks of `scale` x `scale` mask pixels, not all set.
fn code_fine_mask<C: Coder>(
    coder: &mut C,
    pixels: &mut MaskModels,
    blocks: &mut BlockModels,
    (n, scale): (usize, usize),
    given: &[u8],
) -> Result<Vec<u8>, C::Error> {
    let side = n * scale;
    let block_of = |at: usize| at / side / scale * n + at % side / scale;
    let mut counts = vec![0; n * n];
    for (at, _) in given.iter().enumerate().filter(|(_, m)| **m != 0) {
        counts[block_of(at)] += 1;
    }
    let mut states = Vec::with_capacity(n * n);
    for count in counts {
        let given = match count {
            0 => BlockFill::Empty,
            count if count == scale * scale => BlockFill::Full,
            _ => BlockFill::Mixed,
        };
        let state = blocks.code(coder, &states, n, given)?;
        states.push(state);
    }
    let mut mask = Vec::with_capacity(side * side);
    for at in 0..side * side {
        let set = match states[block_of(at)] {
            BlockFill::Empty => false,
            BlockFill::Full => true,
            BlockFill::Mixed => {
                let set = given.get(at).is_some_and(|&m| m != 0);
                coder.bit(pixels.at(&mask, side), set)?
            }
        };
        mask.push(u8::from(set));
    }
    Ok(mask)
}

/// Writes, reads or prices the bitmasks of one level, patch after patch, one byte per mask pixel; `given` is what to
/// write, and empty when reading.
///
/// # Errors
/// Those of the coder.
pub(super) fn code_masks<C: Coder>(
    coder: &mut C,
    level: &LevelHeader,
    given: &[u8],
) -> Result<Vec<u8>, C::Error> {
    let (area, scale) = (level.mask_area(), level.mask_scale as usize);
    let n = level.pixels as usize;
    let (mut models, mut blocks) = (MaskModels::new(), BlockModels::new());
    let mut masks = Vec::new();
    for _ in 0..level.n_patches {
        let from = masks.len();
        let given = given.get(from..from + area).unwrap_or_default();
        if coder.bit(&mut models.full, given.iter().all(|&m| m != 0))? {
            masks.resize(from + area, 1);
            continue;
        }
        if scale > 1 {
            masks.extend(code_fine_mask(coder, &mut models, &mut blocks, (n, scale), given)?);
            continue;
        }
        for at in 0..area {
            let set = given.get(at).is_some_and(|&m| m != 0);
            let set = coder.bit(models.at(&masks[from..], n), set)?;
            masks.push(u8::from(set));
        }
    }
    Ok(masks)
}
