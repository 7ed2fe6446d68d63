//! Flat neighbourhoods: where a cloud has so few points that the cells of an octree with enough of them reach over edges.
//!
//! The cells of an octree lie where they lie; around a point, as many points as a cell needs are a third as far apart at least.

use surfabet_base::parallel;
use surfabet_geom::{KdTree, Moments, Progress};

use super::flat_cells::{moments_of, spanned};
use crate::error::Result;
use crate::planes::constants::{CELL_POINTS, FLAT_CELL_SIGMAS, NEIGHBORHOOD_SPREAD};
use crate::planes::fit::merge::{PlanarSet, Rule};
use crate::planes::fit::trim::facing;
use crate::planes::points::Points;

/// Flat neighbourhoods that share no point, and the pairs of them that touch: of which a point of one is in the neighbourhood of a
/// point of the other.
pub(super) struct Neighborhoods {
    /// The points of each, ascending.
    pub members: Vec<Vec<u32>>,
    pub parts: Vec<PlanarSet>,
    pub pairs: Vec<[u32; 2]>,
}

/// Of the neighbourhoods of all points the flattest first, as long as they are flat up to the noise and not
/// more than [`NEIGHBORHOOD_SPREAD`] times as thick as a quarter of them.
///
/// # Errors
/// [`crate::Error::Cancelled`], or a cloud that is too large to search.
pub(super) fn neighborhoods(
    points: &Points,
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Neighborhoods> {
    let tree = KdTree::new(&points.positions)?;
    let near: Vec<Vec<u32>> = parallel::try_map(&points.positions, |&p| {
        progress.check()?;
        let mut found = Vec::new();
        tree.k_nearest(p, CELL_POINTS, &mut found);
        let mut near: Vec<u32> = found.iter().map(|n| n.index() as u32).collect();
        near.sort_unstable();
        Ok::<_, crate::Error>(near)
    })?;
    let moments: Vec<Moments> = parallel::map(&near, |set| moments_of(points, set));
    let mut flat: Vec<(f64, u32)> = (0..)
        .zip(&moments)
        .filter_map(|(i, moments)| {
            let [_, _, largest] = moments.principal_axes()?.variances;
            // A line of points spans no plane.
            let (_, deviation) = spanned(moments, largest.sqrt())?;
            Some((deviation, i))
        })
        .collect();
    flat.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let quarter = flat.get(flat.len() / 4).map_or(0.0, |f| f.0);
    let rounding = f64::from(f32::EPSILON) * points.extent();
    let most = (NEIGHBORHOOD_SPREAD * quarter + rounding).min(FLAT_CELL_SIGMAS * rule.deviation);
    let mut of: Vec<Option<u32>> = vec![None; points.len()];
    let (mut members, mut parts) = (Vec::new(), Vec::new());
    for &(deviation, i) in flat.iter().take_while(|f| f.0 <= most) {
        let set = &near[i as usize];
        if set.iter().any(|&k| of[k as usize].is_some()) {
            continue;
        }
        let moments = moments[i as usize];
        let Some((frame, _)) = spanned(&moments, 0.0) else { continue };
        set.iter().for_each(|&k| of[k as usize] = Some(parts.len() as u32));
        let facing = facing(points, set).unwrap_or_default();
        parts.push(PlanarSet {
            n: set.len(),
            moments,
            frame,
            facing,
            noise: deviation * deviation,
        });
        members.push(set.clone());
    }
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for (i, set) in near.iter().enumerate() {
        let Some(a) = of[i] else { continue };
        let others = set.iter().filter_map(|&k| of[k as usize]).filter(|&b| b != a);
        pairs.extend(others.map(|b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    pairs.dedup();
    Ok(Neighborhoods { members, parts, pairs })
}
