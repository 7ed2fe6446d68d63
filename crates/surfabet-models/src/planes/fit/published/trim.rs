//! Trimming as printed (section II-A): along the principal axes, tiles of side G, T over all tiles.

use crate::planes::fit::trim::{Members, count, supported_patch, to_principal};
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::{MAX_TILES, Tiles};

/// Trims a plane to the patch that the points of `set` support; `None` when no tile is supported.
pub(super) fn trim(points: &Points, frame: Frame, set: &[u32], grid_size: f64) -> Option<Patch> {
    if set.len() < 3 {
        return None;
    }
    let mut members = Members::new(points, &frame, set);
    let (frame, (low, size)) = to_principal(frame, &mut members);
    let mut edge = grid_size;
    while (size[0] / edge + 1.0) * (size[1] / edge + 1.0) > MAX_TILES {
        edge *= 2.0;
    }
    let mut tiles = Tiles::new(low, size, edge);
    let counts = count(&tiles, &members.local, grid_size);
    tiles.support(supported(&counts));
    supported_patch(points, frame, tiles, set, &members, grid_size)
}

/// Tiles with more points than `T = mean(c) - 2 std(c)` over all tiles, and with one at least: T is negative where points
/// are not evenly spread, and would let tiles without any count.
fn supported(counts: &[u32]) -> Vec<bool> {
    let n = counts.len() as f64;
    let mean = counts.iter().map(|&c| f64::from(c)).sum::<f64>() / n;
    let variance = counts.iter().map(|&c| (f64::from(c) - mean).powi(2)).sum::<f64>() / n;
    let threshold = (mean - 2.0 * variance.sqrt()).max(0.0);
    counts.iter().map(|&c| f64::from(c) > threshold).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_over_all_tiles_and_none_without_points_counts() {
        // mean 4, standard deviation 4: T is -4.
        assert_eq!(supported(&[0, 0, 8, 8]), [false, false, true, true]);
        // mean 99.1, standard deviation 9.0: T is 81.1.
        let mut counts = vec![100; 100];
        counts[7] = 10;
        let wanted: Vec<bool> = (0..100).map(|t| t != 7).collect();
        assert_eq!(supported(&counts), wanted);
    }
}
