//! Polygons around the supported tiles.

use std::collections::BTreeMap;

use crate::planes::model::PlaneModel;
use crate::planes::tiles::Tiles;

impl PlaneModel {
    /// Closed polygons around the supported area of a patch, corners in the world, metres; the last corner is not the
    /// first again. Seen from where the normal points, outlines run anticlockwise and holes clockwise.
    pub fn polygons(&self, patch: usize) -> Vec<Vec<[f64; 3]>> {
        let patch = &self.patches()[patch];
        rings(&patch.tiles)
            .into_iter()
            .map(|ring| {
                ring.into_iter()
                    .map(|corner| self.world(patch.frame.at(patch.tiles.corner(corner))))
                    .collect()
            })
            .collect()
    }
}

/// Corners of the polygons around supported tiles, in columns and rows. Tiles that touch at a corner only are not joined
/// there.
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
        // The start is no corner if the ring goes straight through it.
        if ring.len() > 1 && heading == Some(direction(ring[0], ring[1])) {
            ring.remove(0);
        }
        rings.push(ring);
    }
    rings
}

/// Direction of the side from a corner to the next: -1, 0 or 1 along each axis.
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
