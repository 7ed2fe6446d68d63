//! Counting across a patch in strips, and cutting it between them.

use crate::planes::patch::Patch;
use crate::planes::points::Points;

const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Rotations by 0, 45, 90 and 135 degrees.
pub(in crate::planes::fit) const DIRECTIONS: [[f64; 2]; 4] =
    [[1.0, 0.0], [DIAGONAL, DIAGONAL], [0.0, 1.0], [-DIAGONAL, DIAGONAL]];

/// Strips across the rectangle of a patch, as wide as a tile.
pub(in crate::planes::fit) struct Bins {
    direction: [f64; 2],
    low: f64,
    /// Side of a tile, metres.
    pub width: f64,
    /// Number of bins.
    pub n: usize,
    /// Half the length along the direction, and of the part over which strips have their full length.
    reach: f64,
    flat: f64,
}

impl Bins {
    /// Bins along `direction` over the patch's rectangle; `None` for fewer than three.
    pub fn new(patch: &Patch, direction: [f64; 2]) -> Option<Self> {
        let tiles = &patch.tiles;
        let [low, size] = [tiles.low(), tiles.size()];
        let half = [0.5 * size[0] * direction[0].abs(), 0.5 * size[1] * direction[1].abs()];
        let middle = along(direction, std::array::from_fn(|a| low[a] + 0.5 * size[a]));
        let reach = half[0] + half[1];
        let width = tiles.edge();
        let n = (2.0 * reach / width).ceil().max(1.0) as usize;
        let flat = (half[0] - half[1]).abs();
        (n >= 3).then_some(Self { direction, low: middle - reach, width, n, reach, flat })
    }

    /// The bin of a position in the plane of the patch.
    pub fn of(&self, p: [f64; 2]) -> usize {
        self.part_of(p, 1)
    }

    /// The part of a bin of a position in the plane of the patch, where each bin has this number of parts.
    pub fn part_of(&self, p: [f64; 2], parts: usize) -> usize {
        let off = along(self.direction, p) - self.low;
        let part = (off * parts as f64 / self.width).max(0.0) as usize;
        part.min(self.n * parts - 1)
    }

    /// Coordinate along the direction at which a bin starts.
    pub fn edge(&self, bin: usize) -> f64 {
        self.edge_at(bin as f64)
    }

    /// Coordinate along the direction so many widths from the start of the first bin.
    pub fn edge_at(&self, widths: f64) -> f64 {
        self.low + self.width * widths
    }

    /// Length of the line across the rectangle in the middle of a bin, as a share of the longest.
    pub fn share(&self, bin: usize) -> f64 {
        self.share_at(bin as f64)
    }

    /// As [`Bins::share`], of a bin that starts so many widths from the first.
    pub fn share_at(&self, start: f64) -> f64 {
        let off = (self.width * (start + 0.5) - self.reach).abs();
        if off <= self.flat { 1.0 } else { (self.reach - off) / (self.reach - self.flat) }
    }
}

/// Where to cut: along which direction, and at which coordinate of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::planes::fit) struct Cut {
    pub direction: [f64; 2],
    pub at: f64,
}

impl Cut {
    /// The points on either side, `None` where one of both has fewer than `least`.
    pub fn sides(self, set: &[u32], local: &[[f64; 2]], least: usize) -> Option<[Vec<u32>; 2]> {
        let mut sides = [Vec::new(), Vec::new()];
        for (&i, p) in set.iter().zip(local) {
            sides[usize::from(along(self.direction, *p) >= self.at)].push(i);
        }
        sides.iter().all(|side| side.len() >= least).then_some(sides)
    }
}

/// Coordinates of points in the plane of a patch.
pub(in crate::planes::fit) fn flat(points: &Points, patch: &Patch, set: &[u32]) -> Vec<[f64; 2]> {
    let local = |i: u32| patch.frame.local(points.positions[i as usize]);
    set.iter().map(|&i| local(i)).map(|[x, y, _]| [x, y]).collect()
}

/// Coordinate of a position along a direction.
fn along(direction: [f64; 2], p: [f64; 2]) -> f64 {
    direction[0] * p[0] + direction[1] * p[1]
}
