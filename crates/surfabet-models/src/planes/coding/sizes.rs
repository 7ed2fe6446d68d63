//! Numbers and sizes of tiles, standard deviations and numbers of points; the latter two by those of the patch before.

use surfabet_entropy::{Coder, SInt, UInt};

use super::stored::{MAX_DOUBLINGS, MAX_PATCH_TILES, PARTS, StoredPatch};
use super::syntax::code_residual;
use crate::size_code::MAX_SIZE_CODE;

/// Adaptive models of the sizes, and those of the patch before.
pub(super) struct SizeModels {
    doublings: UInt,
    shape: [UInt; 2],
    last: [UInt; 2],
    deviation: SInt,
    count: SInt,
    /// Standard deviation and number of points of the patch before.
    before: [u8; 2],
    /// Tiles of all patches so far, and the most there may be.
    tiles: u64,
    max_tiles: u64,
}

impl SizeModels {
    pub fn new(max_tiles: u64) -> Self {
        Self {
            doublings: UInt::new(),
            shape: [const { UInt::new() }; 2],
            last: [const { UInt::new() }; 2],
            deviation: SInt::new(),
            count: SInt::new(),
            before: [0; 2],
            tiles: 0,
            max_tiles,
        }
    }
}

/// Codes numbers and sizes of tiles, standard deviation and number of points of a patch.
pub(super) fn code_sizes<C: Coder>(
    coder: &mut C,
    models: &mut SizeModels,
    wanted: &StoredPatch,
    patch: &mut StoredPatch,
) -> Result<(), C::Error> {
    let doublings = coder.uint(&mut models.doublings, u32::from(wanted.doublings))?;
    if doublings > u32::from(MAX_DOUBLINGS) {
        return Err(coder.corrupt(format!("tiles of 2^{doublings} grid sizes")));
    }
    patch.doublings = doublings as u8;
    for axis in 0..2 {
        let model = &mut models.shape[axis];
        let less = coder.uint(model, wanted.shape[axis].wrapping_sub(1))?;
        patch.shape[axis] = less.saturating_add(1);
    }
    let [nx, ny] = patch.shape.map(u64::from);
    // Of numbers below 2^32 each.
    let tiles = nx * ny;
    models.tiles = models.tiles.saturating_add(tiles);
    if tiles > MAX_PATCH_TILES {
        return Err(coder.corrupt(format!("{nx} x {ny} tiles, more than {MAX_PATCH_TILES}")));
    }
    if models.tiles > models.max_tiles {
        return Err(coder.corrupt(format!("more than {} tiles", models.max_tiles)));
    }
    for axis in 0..2 {
        let model = &mut models.last[axis];
        let less = coder.uint(model, u32::from(PARTS.wrapping_sub(wanted.last[axis])))?;
        if less >= u32::from(PARTS) {
            return Err(coder.corrupt(format!("a last tile less {less} eighths")));
        }
        patch.last[axis] = PARTS - less as u8;
    }
    let domain = 0..=i32::from(MAX_SIZE_CODE);
    let [deviation, count] = models.before.map(i32::from);
    let (model, to) = (&mut models.deviation, i32::from(wanted.deviation));
    let what = "a standard deviation";
    patch.deviation = code_residual(coder, model, deviation, to, domain.clone(), what)? as u8;
    let (model, to) = (&mut models.count, i32::from(wanted.count));
    patch.count = code_residual(coder, model, count, to, domain, "a number of points")? as u8;
    models.before = [patch.deviation, patch.count];
    Ok(())
}
