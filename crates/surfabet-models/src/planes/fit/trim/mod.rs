//! Trimming: planes become rectangles with supported tiles (section II-A, figures 2 and 3).

mod rectangle;
mod support;

use surfabet_geom::Moments;

use self::rectangle::turned;
pub(super) use self::rectangle::{bounds, to_principal};
pub(super) use self::support::count;
use self::support::{Scatter, in_cube, supported, tiled};
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::Tiles;
use crate::vector::{dot, minus};

/// Trims a plane to the patch that the points of `set` support, with tiles of side `grid_size` (G) or a power of two
/// more. `None` when no tile is supported.
pub(super) fn trim(points: &Points, frame: Frame, set: &[u32], grid_size: f64) -> Option<Patch> {
    if set.len() < 3 {
        return None;
    }
    let facing = facing(points, set);
    let seen = facing.map_or(0.0, |f| dot(f, frame.normal));
    let frame = if seen < 0.0 { frame.flipped() } else { frame };
    let mut local: Vec<[f64; 3]> =
        set.iter().map(|&i| frame.local(points.positions[i as usize])).collect();
    let frame = turned(frame, &mut local);
    let on_lines = points.line_spacing.is_some();
    let (mut tiles, counts) = tiled(&local, grid_size, on_lines);
    // Noise carries no points over the edges of tiles that are large beside it.
    let rims = !(on_lines && tiles.edge() > grid_size);
    let supported = supported(&tiles, &counts, rims);
    tiles.support(supported);
    supported_patch(points, frame, tiles, set, &local, grid_size)
}

/// As [`trim`], with the plane and the rectangle of `patch` as they are.
pub(super) fn trim_to(
    points: &Points,
    patch: &Patch,
    set: &[u32],
    grid_size: f64,
) -> Option<Patch> {
    if set.len() < 3 {
        return None;
    }
    let frame = patch.frame;
    let local: Vec<[f64; 3]> =
        set.iter().map(|&i| frame.local(points.positions[i as usize])).collect();
    let mut tiles = Tiles::new(patch.tiles.low(), patch.tiles.size(), grid_size);
    let counts = count(&tiles, &local, grid_size);
    let supported = supported(&tiles, &counts, false);
    tiles.support(supported);
    supported_patch(points, frame, tiles, set, &local, grid_size)
}

/// The patch of a plane, tiles and the points that support it; `None` when no tile is supported.
pub(super) fn supported_patch(
    points: &Points,
    frame: Frame,
    tiles: Tiles,
    set: &[u32],
    local: &[[f64; 3]],
    grid_size: f64,
) -> Option<Patch> {
    if tiles.n_supported() == 0 {
        return None;
    }
    let mut support = Vec::new();
    let mut scatter = Scatter::new(tiles.supported().len());
    for (&i, p) in set.iter().zip(local) {
        let tile = tiles.tile_at([p[0], p[1]]);
        if let Some(t) = tile.filter(|&t| tiles.supported()[t]) {
            scatter.add(t, f64::from(points.weights[i as usize]), p[2]);
            if in_cube(p, grid_size) {
                support.push(i);
            }
        }
    }
    let moments = points.moments_about(frame.center, set.iter().map(|&i| (i, 1.0)));
    let density = set.len() as f64 / tiles.area();
    Some(Patch {
        frame,
        tiles,
        density,
        standard_deviation: mean_square(&moments, &frame).sqrt(),
        support,
        whole: set.to_vec(),
        moments,
        facing: facing(points, set).unwrap_or_default(),
        noise: scatter.within(),
    })
}

/// Sum of the unit vectors to where points were seen from; `None` where that is unknown.
pub(super) fn facing(points: &Points, set: &[u32]) -> Option<[f64; 3]> {
    let facing = points.facing.as_ref()?;
    Some(set.iter().fold([0.0; 3], |sum, &i| {
        std::array::from_fn(|a| sum[a] + f64::from(facing[i as usize][a]))
    }))
}

/// Mean square distance of points from a plane, by their moments: `n^T C n + ((m - c) . n)^2` with their covariance `C`
/// and mean `m`, and the plane's normal `n` and center `c`.
pub(in crate::planes) fn mean_square(moments: &Moments, frame: &Frame) -> f64 {
    let n = frame.normal;
    let c = moments.covariance();
    let off = dot(minus(moments.mean(), frame.center), n);
    (0..3).map(|a| n[a] * dot(c[a], n)).sum::<f64>().max(0.0) + off * off
}
