//! Patches to start from: at random, or where the data are flat (sections II-B and III).

mod discs;
mod flat_cells;
mod neighborhoods;
mod noise;
mod random;

use surfabet_base::parallel;
use surfabet_geom::{Progress, morton};

use self::flat_cells::{flat_cells, touching};
use self::neighborhoods::{Neighborhoods, neighborhoods};
pub(super) use self::noise::noise;
pub(in crate::planes) use self::random::random;
use super::m_step::plane;
use super::merge::{Rule, agglomerate};
use super::trim::trim;
use crate::error::Result;
use crate::planes::constants::{
    LARGEST_CELL_SIGMAS, LARGEST_CELL_SPACINGS, SMALLEST_CELL_SIGMAS, SMALLEST_CELL_SPACINGS,
};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Patches where the points `ids`, ascending, are flat: cells of an octree that are flat up to the noise, which is G/3,
/// joined with their neighbours where both are in one plane by `rule`. Cells are up to so many levels larger as `coarser`
/// says. Those with fewer than `min_points` are left out.
pub(in crate::planes::fit) fn from_data(
    points: &Points,
    ids: &[u32],
    rule: &Rule,
    coarser: u32,
    min_points: usize,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let noise = rule.deviation;
    let level_of =
        |side: f64| (side / points.cell).log2().ceil().clamp(0.0, f64::from(morton::BITS)) as u32;
    let largest = (LARGEST_CELL_SIGMAS * noise).max(LARGEST_CELL_SPACINGS * points.resolution());
    let first = (level_of(largest) + coarser).min(morton::BITS);
    let smallest = (SMALLEST_CELL_SIGMAS * noise).max(SMALLEST_CELL_SPACINGS * points.resolution());
    // The level whose side is nearest to it.
    let last = level_of(smallest * std::f64::consts::FRAC_1_SQRT_2).min(first);
    let cells = flat_cells(points, ids, [first, last], rule, progress)?;
    let pairs = touching(&cells, 1 << first);
    let (members, parts) = cells.into_iter().map(|cell| (cell.members, cell.part)).unzip();
    joined(points, Neighborhoods { members, parts, pairs }, rule, min_points, progress)
}

/// Patches where the neighbourhoods of points are flat, joined with those that they touch as by [`from_data`].
pub(in crate::planes::fit) fn from_neighborhoods(
    points: &Points,
    rule: &Rule,
    min_points: usize,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    joined(points, neighborhoods(points, rule, progress)?, rule, min_points, progress)
}

/// The patches of flat parts, of which those that touch are joined where they are in one plane.
fn joined(
    points: &Points,
    Neighborhoods { members, parts, pairs }: Neighborhoods,
    rule: &Rule,
    min_points: usize,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let into = agglomerate(parts, &pairs, rule, progress)?;
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); members.len()];
    for (set, to) in members.iter().zip(into) {
        groups[to as usize].extend(set);
    }
    groups.retain(|set| set.len() >= min_points);
    let patches = parallel::map_owned(groups, |mut set| {
        // Faster than the unstable one, as the points of each cell are sorted.
        set.sort();
        let center = points.positions[set[0] as usize].map(f64::from);
        let moments = points.moments_about(center, set.iter().map(|&i| (i, 1.0)));
        trim(points, plane(&moments)?, &set, rule.distance)
    });
    Ok(patches.into_iter().flatten().collect())
}
