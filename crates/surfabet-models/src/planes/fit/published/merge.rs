//! Merging as printed (section II-D).

use surfabet_geom::Progress;

use super::trim::trim;
use crate::error::Result;
use crate::planes::fit::m_step::plane;
use crate::planes::fit::merge::expanded;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Merges pairs of patches, the first first, until all are dissimilar: boxes expanded by G that overlap, and the smaller of
/// the mean distances of the points of either reduced support set from the other's plane below G.
pub(super) fn merge(
    points: &Points,
    mut patches: Vec<Patch>,
    grid_size: f64,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let mut a = 0;
    while a < patches.len() {
        progress.check()?;
        let others = a + 1..patches.len();
        let joined = others.into_iter().find_map(|b| {
            let merged = joined(points, &patches[a], &patches[b], grid_size)?;
            Some((b, merged))
        });
        match joined {
            Some((b, merged)) => {
                patches.remove(b);
                patches[a] = merged;
                // The union may be similar to patches that neither of both was.
                a = 0;
            }
            None => a += 1,
        }
    }
    Ok(patches)
}

/// The plane of both reduced support sets, trimmed to a patch, if the patches are similar.
fn joined(points: &Points, a: &Patch, b: &Patch, grid_size: f64) -> Option<Patch> {
    let ((al, ah), (bl, bh)) = (expanded(a, grid_size), expanded(b, grid_size));
    if (0..3).any(|k| al[k] > bh[k] || bl[k] > ah[k]) {
        return None;
    }
    if mean_distance(points, a, b).min(mean_distance(points, b, a)) >= grid_size {
        return None;
    }
    let mut set: Vec<u32> = a.support.iter().chain(&b.support).copied().collect();
    set.sort_unstable();
    let moments = points.moments_about(a.frame.center, set.iter().map(|&i| (i, 1.0)));
    trim(points, plane(&moments)?, &set, grid_size)
}

/// Mean distance of the reduced support set of `a` from the plane of `b`.
fn mean_distance(points: &Points, a: &Patch, b: &Patch) -> f64 {
    let height = |&i: &u32| b.frame.local(points.positions[i as usize])[2].abs();
    a.support.iter().map(height).sum::<f64>() / a.support.len() as f64
}
