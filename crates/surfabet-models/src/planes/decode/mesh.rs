//! The supported tiles as triangles.

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
    /// All patches as triangles: rectangles of supported tiles, two triangles each.
    pub fn mesh(&self) -> PlaneMesh {
        let mut mesh = PlaneMesh::default();
        for (i, patch) in self.patches().iter().enumerate() {
            let rectangles = rectangles(&patch.tiles);
            mesh.vertices.reserve(4 * rectangles.len());
            mesh.triangles.reserve(2 * rectangles.len());
            mesh.patches.resize(mesh.patches.len() + 2 * rectangles.len(), i as u32);
            for [low, high] in rectangles {
                let first = mesh.vertices.len() as u32;
                let [[x0, y0], [x1, y1]] = [low, high].map(|corner| patch.tiles.corner(corner));
                let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
                mesh.vertices.extend(corners.map(|corner| self.world(patch.frame.at(corner))));
                mesh.triangles
                    .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        mesh
    }
}

/// Supported tiles as few rectangles, from corner to corner: runs along the first axis, joined with equal ones of
/// the next rows.
fn rectangles(tiles: &Tiles) -> Vec<[[usize; 2]; 2]> {
    let [nx, _] = tiles.shape();
    let mut done: Vec<[[usize; 2]; 2]> = Vec::new();
    // Rectangles that the last row belongs to, by column, as numbers in `done`; and those of the row at hand.
    let (mut above, mut at_hand): (Vec<usize>, Vec<usize>) = Default::default();
    for (y, row) in tiles.supported().chunks(nx).enumerate() {
        let mut next_above = above.iter().copied().peekable();
        let mut end = 0;
        while let Some(start) = position(&row[end..], true).map(|n| end + n) {
            end = position(&row[start..], false).map_or(nx, |n| start + n);
            while next_above.next_if(|&r| done[r][0][0] < start).is_some() {}
            let same = next_above.next_if(|&r| [done[r][0][0], done[r][1][0]] == [start, end]);
            let rectangle = same.unwrap_or_else(|| {
                done.push([[start, y], [end, y]]);
                done.len() - 1
            });
            done[rectangle][1][1] = y + 1;
            at_hand.push(rectangle);
        }
        std::mem::swap(&mut above, &mut at_hand);
        at_hand.clear();
    }
    done.sort_unstable();
    done
}

/// The first tile of a row that is supported, or the first that is not.
fn position(row: &[bool], supported: bool) -> Option<usize> {
    row.iter().position(|&tile| tile == supported)
}
