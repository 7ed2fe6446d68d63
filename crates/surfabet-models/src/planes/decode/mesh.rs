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
            for [[x0, y0], [x1, y1]] in rectangles {
                let first = mesh.vertices.len() as u32;
                for corner in [[x0, y0], [x1, y0], [x1, y1], [x0, y1]] {
                    mesh.vertices.push(self.world(patch.frame.at(patch.tiles.corner(corner))));
                }
                mesh.triangles.push([first, first + 1, first + 2]);
                mesh.triangles.push([first, first + 2, first + 3]);
                mesh.patches.extend([i as u32; 2]);
            }
        }
        mesh
    }
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
