//! Polygons around the supported tiles, and the tiles as triangles.

use std::collections::BTreeMap;

use crate::planes::model::PlaneModel;
use crate::planes::tiles::Tiles;

/// Triangles of a model: corners in the world, metres, three corners per triangle, the patch of each triangle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlaneMesh {
    /// Corners in the world, metres.
    pub vertices: Vec<[f64; 3]>,
    /// Corners of each triangle, anticlockwise seen from where the normal points.
    pub triangles: Vec<[u32; 3]>,
    /// The patch that each triangle belongs to.
    pub patches: Vec<u32>,
}

impl PlaneModel {
    /// Closed polygons around the supported area of a patch, corners in the world, metres; the last corner is not the
    /// first again. Seen from where the normal points, outlines run anticlockwise and holes clockwise.
    pub fn polygons(&self, patch: usize) -> Vec<Vec<[f64; 3]>> {
        let patch = &self.patches()[patch];
        rings(&patch.tiles)
            .into_iter()
            .map(|ring| {
                ring.into_iter()
                    .map(|corner| self.world(patch.frame.at(at(&patch.tiles, corner))))
                    .collect()
            })
            .collect()
    }

    /// All patches as triangles: rectangles of supported tiles, two triangles each.
    pub fn mesh(&self) -> PlaneMesh {
        let mut mesh = PlaneMesh::default();
        for (i, patch) in self.patches().iter().enumerate() {
            for [[x0, y0], [x1, y1]] in rectangles(&patch.tiles) {
                let first = mesh.vertices.len() as u32;
                let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
                let corners = corners.map(|c| self.world(patch.frame.at(at(&patch.tiles, c))));
                mesh.vertices.extend(corners);
                mesh.triangles.push([first, first + 1, first + 2]);
                mesh.triangles.push([first, first + 2, first + 3]);
                mesh.patches.extend([i as u32; 2]);
            }
        }
        mesh
    }

    fn world(&self, p: [f64; 3]) -> [f64; 3] {
        let origin = self.origin();
        std::array::from_fn(|a| origin[a] + p[a])
    }
}

/// Position of a corner of the tiles in the plane; the far sides are where the rectangle ends.
fn at(tiles: &Tiles, corner: [usize; 2]) -> [f64; 2] {
    let [low, size] = [tiles.low(), tiles.size()];
    std::array::from_fn(|a| low[a] + (tiles.edge() * corner[a] as f64).min(size[a]))
}

/// Corners of the polygons around supported tiles. Tiles that touch at a corner only are not joined there.
fn rings(tiles: &Tiles) -> Vec<Vec<[usize; 2]>> {
    let [nx, ny] = tiles.shape();
    let on = |x: usize, y: usize| x < nx && y < ny && tiles.supported()[y * nx + x];
    // Sides with a supported tile to their left and none to their right, by the corner where they start.
    let mut sides: BTreeMap<[usize; 2], Vec<[usize; 2]>> = BTreeMap::new();
    let mut add = |from, to| sides.entry(from).or_default().push(to);
    for y in 0..ny {
        for x in (0..nx).filter(|&x| on(x, y)) {
            // Below zero wraps to beyond the last, where no tile is.
            if !on(x, y.wrapping_sub(1)) {
                add([x, y], [x + 1, y]);
            }
            if !on(x + 1, y) {
                add([x + 1, y], [x + 1, y + 1]);
            }
            if !on(x, y + 1) {
                add([x + 1, y + 1], [x, y + 1]);
            }
            if !on(x.wrapping_sub(1), y) {
                add([x, y + 1], [x, y]);
            }
        }
    }
    let mut rings = Vec::new();
    while let Some((&start, _)) = sides.first_key_value() {
        let mut ring: Vec<[usize; 2]> = Vec::new();
        let mut corner = start;
        let mut heading = None;
        // Every side is taken once, and every corner is left as often as it is reached.
        while let Some(next) = take(&mut sides, corner, heading) {
            let turned = direction(corner, next);
            if heading != Some(turned) {
                ring.push(corner);
            }
            heading = Some(turned);
            corner = next;
            if corner == start {
                break;
            }
        }
        // The first corner is none if the ring goes straight through it.
        if ring.len() > 1 && heading == Some(direction(ring[0], ring[1])) {
            ring.remove(0);
        }
        rings.push(ring);
    }
    rings
}

fn direction(from: [usize; 2], to: [usize; 2]) -> [i8; 2] {
    std::array::from_fn(|a| to[a].cmp(&from[a]) as i8)
}

/// Takes the side that starts at `corner`; of two the one that turns left, around the tile that the last side was of.
fn take(
    sides: &mut BTreeMap<[usize; 2], Vec<[usize; 2]>>,
    corner: [usize; 2],
    heading: Option<[i8; 2]>,
) -> Option<[usize; 2]> {
    let of = sides.get_mut(&corner)?;
    let left = heading.map(|[x, y]| [-y, x]);
    let pick = of.iter().position(|&to| Some(direction(corner, to)) == left).unwrap_or(0);
    let to = of.remove(pick);
    if of.is_empty() {
        sides.remove(&corner);
    }
    Some(to)
}

/// Supported tiles as few rectangles, from corner to corner: runs along the first axis, joined with equal ones of
/// the next rows.
fn rectangles(tiles: &Tiles) -> Vec<[[usize; 2]; 2]> {
    let [nx, _] = tiles.shape();
    let mut done = Vec::new();
    let mut open: Vec<[[usize; 2]; 2]> = Vec::new();
    for (y, row) in tiles.supported().chunks(nx).enumerate() {
        let mut next = Vec::new();
        let mut x = 0;
        for run in row.chunk_by(|a, b| a == b) {
            if run[0] {
                let span = [x, x + run.len()];
                let above = open.iter().position(|r| [r[0][0], r[1][0]] == span);
                let start = above.map_or(y, |k| open.swap_remove(k)[0][1]);
                next.push([[span[0], start], [span[1], y + 1]]);
            }
            x += run.len();
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    done.sort_unstable();
    done
}
