//! Trimming: planes become rectangles with supported tiles (section II-A, figures 2 and 3).

mod rectangle;
mod support;

use surfabet_geom::Moments;

pub(super) use self::rectangle::to_principal;
use self::rectangle::turned;
pub(super) use self::support::count;
use self::support::{Scatter, in_cube, supported, tiled};
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::Tiles;
use crate::vector::{dot, minus};

/// Points as a plane sees them.
pub(super) struct Members {
    /// Coordinates in the plane, and height above it.
    pub local: Vec<[f64; 3]>,
    /// Sum of the coordinates in the plane.
    sum: [f64; 2],
    pub moments: Moments,
    /// Sum of the unit vectors to where they were seen from; `None` where that is unknown.
    pub facing: Option<[f64; 3]>,
}

impl Members {
    /// The points of `set`, which are read once.
    pub fn new(points: &Points, frame: &Frame, set: &[u32]) -> Self {
        let mut local = Vec::with_capacity(set.len());
        let mut sum = [0.0; 2];
        let mut facing = points.facing.as_ref().map(|_| [0.0; 3]);
        let moments = points.moments_about(
            frame.center,
            set.iter().map(|&i| {
                let [x, y, z] = frame.local(points.positions[i as usize]);
                local.push([x, y, z]);
                sum = [sum[0] + x, sum[1] + y];
                if let (Some(sum), Some(of)) = (&mut facing, &points.facing) {
                    (0..3).for_each(|a| sum[a] += f64::from(of[i as usize][a]));
                }
                (i, 1.0)
            }),
        );
        Self { local, sum, moments, facing }
    }

    /// As the same plane sees them from its other side.
    fn flip(&mut self) {
        self.local.iter_mut().for_each(|p| *p = [p[0], -p[1], -p[2]]);
        self.sum[1] = -self.sum[1];
    }
}

/// Trims a plane to the patch that the points of `set` support, with tiles of side `grid_size` (G) or a power of two
/// more. `None` when no tile is supported.
pub(super) fn trim(points: &Points, frame: Frame, set: &[u32], grid_size: f64) -> Option<Patch> {
    let (frame, tiles, members) = outlined(points, frame, set, grid_size)?;
    supported_patch(points, frame, tiles, set, &members, grid_size)
}

/// As [`trim`], for another E-step: of its points only their number and their sides, neither S^r nor how they spread.
pub(super) fn outline(points: &Points, frame: Frame, set: &[u32], grid_size: f64) -> Option<Patch> {
    let (frame, tiles, members) = outlined(points, frame, set, grid_size)?;
    (tiles.n_supported() > 0).then(|| Patch {
        density: set.len() as f64 / tiles.area(),
        whole: set.to_vec(),
        facing: members.facing.unwrap_or_default(),
        ..Patch::bare(frame, tiles)
    })
}

/// The frame along the rectangle of the points of `set` in a plane, its tiles, and the points as it sees them; `None` for too few.
fn outlined(
    points: &Points,
    mut frame: Frame,
    set: &[u32],
    grid_size: f64,
) -> Option<(Frame, Tiles, Members)> {
    if set.len() < 3 {
        return None;
    }
    let mut members = Members::new(points, &frame, set);
    if members.facing.is_some_and(|facing| dot(facing, frame.normal) < 0.0) {
        frame = frame.flipped();
        members.flip();
    }
    let (frame, bounds) = turned(frame, &mut members);
    let on_lines = points.line_spacing.is_some();
    let (mut tiles, counts) = tiled(&members.local, bounds, grid_size, on_lines);
    // Noise carries no points over the edges of tiles that are large beside it.
    let rims = !(on_lines && tiles.edge() > grid_size);
    let supported = supported(&tiles, &counts, rims);
    tiles.support(supported);
    Some((frame, tiles, members))
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
    let members = Members::new(points, &frame, set);
    let bounds = (patch.tiles.low(), patch.tiles.size());
    let (mut tiles, counts) =
        tiled(&members.local, bounds, grid_size, points.line_spacing.is_some());
    let supported = supported(&tiles, &counts, false);
    tiles.support(supported);
    supported_patch(points, frame, tiles, set, &members, grid_size)
}

/// The patch of a plane, tiles and the points that support it; `None` when no tile is supported.
pub(super) fn supported_patch(
    points: &Points,
    frame: Frame,
    tiles: Tiles,
    set: &[u32],
    members: &Members,
    grid_size: f64,
) -> Option<Patch> {
    if tiles.n_supported() == 0 {
        return None;
    }
    let mut support = Vec::with_capacity(set.len());
    let mut scatter = Scatter::new(tiles.supported().len());
    for (&i, p) in set.iter().zip(&members.local) {
        let tile = tiles.tile_at([p[0], p[1]]);
        if let Some(t) = tile.filter(|&t| tiles.supported()[t]) {
            scatter.add(t, f64::from(points.weights[i as usize]), p[2]);
            if in_cube(p, grid_size) {
                support.push(i);
            }
        }
    }
    let density = set.len() as f64 / tiles.area();
    Some(Patch {
        frame,
        tiles,
        density,
        standard_deviation: mean_square(&members.moments, &frame).sqrt(),
        support,
        whole: set.to_vec(),
        moments: members.moments,
        facing: members.facing.unwrap_or_default(),
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

#[cfg(test)]
mod tests {
    use surfabet_geom::PointCloud;

    use super::*;

    #[test]
    fn a_given_rectangle_is_covered_by_sparse_points() {
        // 40 x 30 points, 5 cm apart, and tiles from 3 cm on: each second one of those is empty.
        let lattice = (0..1200).map(|i| [(i % 40) as f32, (i / 40) as f32].map(|c| 0.05 * c));
        let positions: Vec<[f32; 3]> = lattice.map(|[x, y]| [x, y, 0.0]).collect();
        let points = Points::new(&PointCloud::from_positions(positions).0, None).unwrap();
        let center = [0.975, 0.725, 0.0];
        let middle = std::array::from_fn(|a| center[a] - points.origin[a]);
        let frame = Frame {
            u: [1.0, 0.0, 0.0],
            v: [0.0, 1.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            center: middle,
        };
        let tiles = Tiles::new([-1.0, -0.75], [2.0, 1.5], 0.03);
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let patch = trim_to(&points, &Patch::bare(frame, tiles), &all, 0.03).unwrap();
        assert_eq!(patch.n_supporting(), 1200);
        assert!(patch.tiles.area() > 0.9 * 2.0 * 1.5, "{}", patch.tiles.area());
        assert!(patch.tiles.area() <= 2.0 * 1.5 + 1e-9, "{}", patch.tiles.area());
    }
}
