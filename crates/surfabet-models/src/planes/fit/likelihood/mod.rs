//! Patches whose sides are not long beside the noise, fitted together by maximum likelihood.
//!
//! Where surfaces meet, noise mixes their points, and over the edge of a surface it carries points away. A rule that gives
//! each point to a patch by its distance sees noise that is cut off, and planes lean into the corner. Here rectangles that
//! are blurred by the noise explain all points near them at once: planes, outlines, shares and noise are those of the
//! largest likelihood, and patches merge or fold where the likelihood gains more than chance.

mod mixture;
mod rectangle;
mod search;
mod ties;

use surfabet_geom::Progress;

use self::mixture::Mixture;
use self::rectangle::Rectangle;
use self::search::{around, search};
use super::merge::close_pairs;
use crate::error::Result;
use crate::planes::constants::{
    FIRST_UNEVEN, FITTED_POINTS, JUDGED_POINTS, LAST_STEPS, LEAST_GAIN, LEAST_PATCH_POINTS,
    LEAST_SUPPORTING, LONG_SIGMAS, MIXED_SIGMAS, MOST_FITTED, MOST_UNEVEN, MOVE_STEPS,
};
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use surfabet_geom::disjoint::root;

/// What limits the fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Grid size G, metres.
    pub grid_size: f64,
    /// Standard deviation of the points about their patches, metres.
    pub deviation: f64,
    /// Noise as far as it is known beforehand, metres. The deviation is more where patches lie across several surfaces.
    pub noise: f64,
    /// Points that a patch needs.
    pub min_points: usize,
}

/// The planes and half sides of patches fitted together, and the patches that they stand for.
pub(super) struct Fitted {
    /// The patches that were fitted, ascending.
    pub replaced: Vec<u32>,
    /// Planes about the middle of their rectangles, and half the sides of these.
    pub rectangles: Vec<(Frame, [f64; 2])>,
}

/// Fits the patches that have a side that is short beside the noise, with those that they touch; each group of such
/// patches on its own.
pub(super) fn refine(
    points: &Points,
    patches: &[Patch],
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Vec<Fitted>> {
    let mut found = Vec::new();
    // Scan lines are not even over a rectangle; and in a scene of many patches corners are few.
    if points.line_spacing.is_some() || patches.len() > MOST_FITTED {
        return Ok(found);
    }
    for group in groups(patches, limits) {
        progress.check()?;
        if let Some(fitted) = together(points, patches, group, limits, progress)? {
            found.push(fitted);
        }
    }
    Ok(found)
}

/// Groups of patches that touch, of which one has a short side.
fn groups(patches: &[Patch], limits: Limits) -> Vec<Vec<u32>> {
    let short = |patch: &Patch| shortest(patch) < LONG_SIGMAS * limits.deviation;
    let mut parent: Vec<u32> = (0..patches.len() as u32).collect();
    for [a, b] in close_pairs(patches, limits.grid_size, true) {
        if short(&patches[a as usize]) || short(&patches[b as usize]) {
            let (a, b) = (root(&mut parent, a), root(&mut parent, b));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); patches.len()];
    for j in 0..patches.len() as u32 {
        groups[root(&mut parent, j) as usize].push(j);
    }
    groups.retain(|group| group.iter().any(|&j| short(&patches[j as usize])));
    groups
}

/// Fits a group of patches; `None` where points are not even over their rectangles, before and after.
fn together(
    points: &Points,
    patches: &[Patch],
    group: Vec<u32>,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Option<Fitted>> {
    let Some(rectangles) = first(points, patches, &group, limits.deviation) else {
        return Ok(None);
    };
    let reach = 2.0 * limits.grid_size;
    let mut blocks: Vec<u32> =
        group.iter().flat_map(|&j| patches[j as usize].blocks(points, reach)).collect();
    blocks.sort_unstable();
    blocks.dedup();
    let near = |i: &usize| {
        let p = points.positions[*i];
        group.iter().any(|&j| patches[j as usize].distance(p, reach).is_some())
    };
    let set: Vec<[f64; 3]> = blocks
        .iter()
        .flat_map(|&b| points.block(b as usize))
        .filter(near)
        .map(|i| points.positions[i].map(f64::from))
        .collect();
    let supporting: usize = group.iter().map(|&j| patches[j as usize].n_supporting()).sum();
    if (supporting as f64) < LEAST_SUPPORTING * set.len() as f64 {
        return Ok(None);
    }
    let judged = some(&set, JUDGED_POINTS);
    let start = Mixture::new(rectangles, limits.deviation, 1.0 / volume(&set));
    let least = limits.min_points * judged.len() / set.len();
    let mut found = start.climb(&judged, MOVE_STEPS, 1.0, progress)?;
    if group.iter().any(|&j| shortest(&patches[j as usize]) < MIXED_SIGMAS * limits.deviation) {
        let least = least.max(LEAST_PATCH_POINTS);
        let Some(better) = search(&judged, found, limits.noise, least, progress)? else {
            return Ok(None);
        };
        found = better;
    }
    let members = found.members(&judged);
    let even = |(r, of): (&Rectangle, &Vec<u32>)| {
        r.unevenness(of.iter().map(|&i| judged[i as usize])) <= MOST_UNEVEN
    };
    if !found.rectangles.iter().zip(&members).all(even) {
        return Ok(None);
    }
    let all = some(&set, FITTED_POINTS);
    let free = found.climb(&all, LAST_STEPS, LEAST_GAIN, progress)?;
    let fitted = free.tied(&all).climb(&all, LAST_STEPS, LEAST_GAIN, progress)?;
    let rectangles = fitted.rectangles.iter().map(|r| (r.frame, r.half)).collect();
    Ok(Some(Fitted { replaced: group, rectangles }))
}

/// The rectangles of the patches of a group; `None` where points are not even over them, on average over all points. A sliver
/// that competes with two walls for the points in their corner is uneven, as a patch across the corner is, and both are what
/// the search is for: they hold few of the points.
fn first(
    points: &Points,
    patches: &[Patch],
    group: &[u32],
    deviation: f64,
) -> Option<Vec<Rectangle>> {
    let (mut uneven, mut all) = (0.0, 0.0);
    let mut rectangles = Vec::new();
    for &j in group {
        let Patch { moments, whole, .. } = &patches[j as usize];
        let own: Vec<[f64; 3]> =
            whole.iter().map(|&i| points.positions[i as usize].map(f64::from)).collect();
        let rectangle = around(&own, moments, 0..own.len() as u32, deviation)?;
        let n = own.len() as f64;
        uneven += n * rectangle.unevenness(own.into_iter());
        all += n;
        rectangles.push(rectangle);
    }
    (uneven <= FIRST_UNEVEN * all).then_some(rectangles)
}

/// The shorter side of a patch, metres.
fn shortest(patch: &Patch) -> f64 {
    let [x, y] = patch.tiles.size();
    x.min(y)
}

/// At most `most` of some points, evenly along their order.
fn some(points: &[[f64; 3]], most: usize) -> Vec<[f64; 3]> {
    points.iter().step_by(points.len().div_ceil(most).max(1)).copied().collect()
}

/// Volume of the box around points, cubic metres.
fn volume(points: &[[f64; 3]]) -> f64 {
    let extent = |a: usize| {
        let ends = points
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |e, p| [e[0].min(p[a]), e[1].max(p[a])]);
        ends[1] - ends[0]
    };
    (extent(0) * extent(1) * extent(2)).max(f64::MIN_POSITIVE)
}
