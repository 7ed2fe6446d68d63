//! How far points spread about small discs of surface, each no larger than shows that it is flat.
//!
//! The cells of an octree lie where they lie: beside a step or an edge, a cell that is large enough to be flat holds both
//! surfaces. A disc around a point that is six standard deviations wide is enough to see how thick its surface is.

use surfabet_base::parallel;

use super::flat_cells::moments_of;
use crate::planes::constants::{
    CELL_SPREAD, DISC_BLOCKS, DISC_DEVIATIONS, DISC_POINTS, DISC_SHARE, DISC_WIDTH, DISCS,
};
use crate::planes::fit::m_step::plane;
use crate::planes::patch::Frame;
use crate::planes::points::Points;
use crate::vector::dot;

/// The radius of a disc grows by this factor until the disc is flat.
const GROWTH: f64 = std::f64::consts::SQRT_2;

/// Parameters of a plane: the points less these are free to deviate.
const PLANE_PARAMETERS: f64 = 3.0;

/// Standard deviation of the points across the surface in the flattest third of some discs, metres; `None` where fewer are
/// flat.
pub(super) fn noise_of_discs(points: &Points) -> Option<f64> {
    let step = points.len().div_ceil(DISCS);
    let all = points.len().div_ceil(step);
    let found = parallel::map_range(all, |k| deviation_at(points, k * step));
    let mut flat: Vec<f64> = found.into_iter().flatten().collect();
    flat.sort_by(f64::total_cmp);
    flat.get((DISC_SHARE * all as f64) as usize).copied()
}

/// Standard deviation of the points across the smallest disc around point `i` that is flat, metres.
fn deviation_at(points: &Points, i: usize) -> Option<f64> {
    let mut radius = points.spacing() * (DISC_POINTS as f64 / std::f64::consts::PI).sqrt();
    while radius > 0.0 && radius <= points.extent() {
        if let Some(frame) = flat_disc(points, i, radius) {
            return across(points, i, &frame, radius);
        }
        radius *= GROWTH;
    }
    None
}

/// The plane of the points in a ball of this radius about the foot of point `i` on their plane, if they are flat.
fn flat_disc(points: &Points, i: usize, radius: f64) -> Option<Frame> {
    let at = points.positions[i].map(f64::from);
    let first = plane(&moments_of(points, &within(points, i, at, radius)?))?;
    // A ball about a point beside the surface holds only what is on one side of it.
    let height = first.local(points.positions[i])[2];
    let foot = std::array::from_fn(|a| at[a] - height * first.normal[a]);
    let members = within(points, i, foot, radius)?;
    let moments = moments_of(points, &members);
    let [across, along, _] = moments.principal_axes()?.variances;
    let n = members.len() as f64;
    let is_flat = across * n / (n - PLANE_PARAMETERS) <= (radius / DISC_DEVIATIONS).powi(2);
    let is_filled = along > CELL_SPREAD * (2.0 * radius).powi(2);
    (is_flat && is_filled).then(|| plane(&moments)).flatten()
}

/// Standard deviation of the heights above a plane of the points about the foot of point `i`, metres: over a disc that is a little smaller, so
/// that the ball does not cut off what is high.
fn across(points: &Points, i: usize, frame: &Frame, radius: f64) -> Option<f64> {
    let [x, y, _] = frame.local(points.positions[i]);
    let corner = radius * f64::hypot(1.0, DISC_WIDTH);
    let heights: Vec<f64> = within(points, i, frame.at([x, y]), corner)?
        .into_iter()
        .filter_map(|k| {
            let [u, v, height] = frame.local(points.positions[k as usize]);
            let inside = f64::hypot(u - x, v - y) <= DISC_WIDTH * radius && height.abs() <= radius;
            inside.then_some(height)
        })
        .collect();
    let n = heights.len() as f64;
    if n <= PLANE_PARAMETERS {
        return None;
    }
    let mean = heights.iter().sum::<f64>() / n;
    let squares: f64 = heights.iter().map(|h| (h - mean).powi(2)).sum();
    Some((squares / (n - PLANE_PARAMETERS)).sqrt())
}

/// Points in a ball that were not seen from the other side than point `i`, or some of them where there are many; `None` for fewer
/// than a disc needs.
fn within(points: &Points, i: usize, center: [f64; 3], radius: f64) -> Option<Vec<u32>> {
    let about = center.map(|c| c as f32);
    let square = (radius * radius) as f32;
    let mut blocks = Vec::new();
    points.blocks_where(|aabb| aabb.squared_distance(about) <= square, &mut blocks);
    let same_side = |k: &usize| {
        points
            .facing
            .as_ref()
            .is_none_or(|of| dot(of[*k].map(f64::from), of[i].map(f64::from)) >= 0.0)
    };
    let near = |k: &usize| {
        let p = points.positions[*k];
        (0..3).map(|a| (p[a] - about[a]).powi(2)).sum::<f32>() <= square
    };
    let found: Vec<u32> = blocks
        .iter()
        .step_by(blocks.len().div_ceil(DISC_BLOCKS).max(1))
        .flat_map(|&b| points.block(b as usize))
        .filter(|k| near(k) && same_side(k))
        .map(|k| k as u32)
        .collect();
    (found.len() >= DISC_POINTS).then_some(found)
}
