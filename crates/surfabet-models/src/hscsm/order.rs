//! The order of patches in a model: along a Morton curve over cells of one patch size.
//!
//! Neighbours in space are then neighbours in the list, where a file lets them predict each other.

use surfabet_geom::morton::encode_wide;

use super::frame::PatchPose;

/// Position steps per side of the ordering cells: about one patch, at least 1 and at most 4096.
pub fn steps_per_cell(pixel_size: f64, pixels: u32, position_step: f64) -> i32 {
    let ratio = pixel_size * f64::from(pixels) / position_step;
    // Whatever a damaged file holds, the cast saturates and the clamp makes it usable.
    (ratio.round() as i32).clamp(1, 1 << 12)
}

/// Cells of `poses`, counted from the lowest in each axis, and that lowest cell.
pub fn cells(poses: &[PatchPose], steps_per_cell: i32) -> ([i32; 3], Vec<[u32; 3]>) {
    let absolute = |p: &PatchPose| p.position.map(|c| c.div_euclid(steps_per_cell));
    let low = poses.iter().map(absolute).reduce(|a, b| std::array::from_fn(|i| a[i].min(b[i])));
    let low = low.unwrap_or_default();
    // Lattice coordinates are within ±2^28, so differences fit.
    let relative =
        poses.iter().map(|p| std::array::from_fn(|a| (absolute(p)[a] - low[a]) as u32)).collect();
    (low, relative)
}

/// Indices of `poses` in storing order: by Morton code of the cell, then by position and normal.
pub(super) fn storing_order(poses: &[PatchPose], steps_per_cell: i32) -> Vec<usize> {
    let (_, cells) = cells(poses, steps_per_cell);
    let mut order: Vec<usize> = (0..poses.len()).collect();
    order.sort_by_cached_key(|&i| (encode_wide(cells[i]), poses[i], i));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_round_down_below_zero_too() {
        let at = |x| PatchPose { position: [x, 0, 0], normal: [0, 0] };
        let (low, cells) = cells(&[at(-1), at(0), at(31), at(32)], 32);
        assert_eq!(low, [-1, 0, 0]);
        assert_eq!(cells.iter().map(|c| c[0]).collect::<Vec<_>>(), [0, 1, 1, 2]);
    }
}
