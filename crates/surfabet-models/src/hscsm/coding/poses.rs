//! Poses: an octree over the cells of one patch size, then where in its cell each centre lies, and its normal.

use surfabet_entropy::{Cells, Coder, Octree, SInt, Symbols, UInt};
use surfabet_geom::morton::encode_wide;

use crate::hscsm::frame::PatchPose;
use crate::hscsm::model::{LevelHeader, MAX_POSITION};
use crate::hscsm::order;

/// Bits of the height of the octree over patch centres.
const HEIGHT_BITS: u32 = 6;

/// Greatest height of the octree: cell coordinates then fit 32 bits with a sign.
const MAX_HEIGHT: u32 = 30;

/// Heights of the octree with models of their own.
const HEIGHTS: u32 = 3;

/// How the poses within a cell are coded.
struct PoseModels {
    /// Difference of each coordinate to the previous patch's, modulo the cell.
    offset: [Symbols; 3],
    /// Difference of each coordinate of the normal's code to the previous patch's.
    normal: [SInt; 2],
}

/// Writes, reads or prices the poses of one level; `given` is what to write, in storing order, and empty when
/// reading.
///
/// # Errors
/// Those of the coder; cells out of range, or another number of poses than the header's.
pub(super) fn code_poses<C: Coder>(
    coder: &mut C,
    level: &LevelHeader,
    given: &[PatchPose],
) -> Result<Vec<PatchPose>, C::Error> {
    let n_patches = level.n_patches;
    if n_patches == 0 {
        return Ok(Vec::new());
    }
    let side = level.steps_per_cell();
    let (mut low, given_cells) = order::cells(given, side);
    let span = given_cells.iter().flatten().copied().fold(0, u32::max);
    let mut corner = SInt::new();
    for c in &mut low {
        *c = coder.sint(&mut corner, *c)?;
    }
    let height = coder.bypass(u64::from(u32::BITS - span.leading_zeros()), HEIGHT_BITS)? as u32;
    let limit = MAX_POSITION / side + 2;
    if height > MAX_HEIGHT || low.iter().any(|c| !(-limit..=limit).contains(c)) {
        return Err(coder.corrupt(format!("cells from {low:?} over 2^{height} are out of range")));
    }

    let keys: Vec<u128> = given_cells.into_iter().map(encode_wide).collect();
    let mut octree = Octree::new(HEIGHTS);
    let mut cells = Cells::new(&keys, height, n_patches);
    let mut found = Vec::new();
    while let Some(cell) = cells.next(coder, &mut octree)? {
        found.push(cell);
    }

    let mut count = UInt::new();
    let symbols = |coder: &C| Symbols::new(side as u32).map_err(|e| coder.corrupt(e.to_string()));
    let mut models = PoseModels {
        offset: [symbols(coder)?, symbols(coder)?, symbols(coder)?],
        normal: [SInt::new(), SInt::new()],
    };
    let mut poses = Vec::new();
    let mut previous = PatchPose::default();
    for cell in found {
        let given_others = cell.given.len().saturating_sub(1) as u32;
        let n = u64::from(coder.uint(&mut count, given_others)?) + 1;
        if n > (n_patches - poses.len()) as u64 {
            return Err(coder.corrupt(format!("more poses than {n_patches} patches")));
        }
        // Cells are below 2^30 and within MAX_POSITION / side + 2 + 2^30 of zero, times a side of at most 2^12:
        // i64 holds them.
        let corner =
            std::array::from_fn(|a| (i64::from(low[a]) + i64::from(cell.at[a])) * i64::from(side));
        for _ in 0..n {
            let given = given.get(poses.len()).copied().unwrap_or_default();
            previous = code_pose(coder, &mut models, side, corner, previous, given)?;
            poses.push(previous);
        }
    }
    if poses.len() == n_patches {
        Ok(poses)
    } else {
        Err(coder.corrupt(format!("{} poses for {n_patches} patches", poses.len())))
    }
}

/// A pose whose centre lies in the cell of `side` steps at `corner`, after the pose `previous`.
fn code_pose<C: Coder>(
    coder: &mut C,
    models: &mut PoseModels,
    side: i32,
    corner: [i64; 3],
    previous: PatchPose,
    given: PatchPose,
) -> Result<PatchPose, C::Error> {
    let side = i64::from(side);
    let mut pose = PatchPose::default();
    for a in 0..3 {
        let predicted = i64::from(previous.position[a]);
        let difference = (i64::from(given.position[a]) - predicted).rem_euclid(side) as u32;
        let difference = i64::from(coder.symbol(&mut models.offset[a], difference)?);
        let at = corner[a] + (predicted + difference).rem_euclid(side);
        pose.position[a] = i32::try_from(at)
            .ok()
            .filter(|c| c.abs() <= MAX_POSITION)
            .ok_or_else(|| coder.corrupt(format!("a patch centre at {at} steps")))?;
    }
    for a in 0..2 {
        let predicted = i32::from(previous.normal[a]);
        let difference = i32::from(given.normal[a]) - predicted;
        let difference = coder.sint(&mut models.normal[a], difference)?;
        let code = i64::from(predicted) + i64::from(difference);
        pose.normal[a] =
            i16::try_from(code).map_err(|_| coder.corrupt(format!("a normal's code of {code}")))?;
    }
    Ok(pose)
}
