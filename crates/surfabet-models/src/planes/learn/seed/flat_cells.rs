//! The cells of an octree in which points are flat.

use std::ops::Range;

use rayon::prelude::*;
use surfabet_geom::morton::{self, MortonMap};
use surfabet_geom::{Moments, Progress};

use crate::error::Result;
use crate::planes::constants::{CELL_POINTS, CELL_SPREAD, FLAT_CELL_SIGMAS};
use crate::planes::learn::merge::Part;
use crate::planes::learn::trim::facing;
use crate::planes::patch::Frame;
use crate::planes::points::Points;

/// A flat cell.
pub(super) struct FlatCell {
    /// Its points, as a range of those searched.
    pub range: Range<usize>,
    /// Lower corner and side in the smallest cells of the curve.
    low: [u64; 3],
    side: u64,
    /// Its points and their plane.
    pub part: Part,
}

impl FlatCell {
    /// True when the cells share a face, an edge or a corner.
    fn touches(&self, other: &Self) -> bool {
        (0..3).all(|a| {
            self.low[a] <= other.low[a] + other.side && other.low[a] <= self.low[a] + self.side
        })
    }
}

/// The largest flat cells of the points `ids`, ascending, from level `first` down to level `last`.
pub(super) fn flat_cells(
    points: &Points,
    ids: &[u32],
    [first, last]: [u32; 2],
    noise: f64,
    progress: &dyn Progress,
) -> Result<Vec<FlatCell>> {
    let key = |i: u32| points.codes[i as usize] >> (3 * first);
    let mut ranges = Vec::new();
    let mut start = 0;
    for cell in ids.chunk_by(|&a, &b| key(a) == key(b)) {
        ranges.push(start..start + cell.len());
        start += cell.len();
    }
    let found: Vec<Vec<FlatCell>> = ranges
        .into_par_iter()
        .map(|range| {
            progress.check()?;
            Ok(within(points, ids, range, [first, last], noise))
        })
        .collect::<Result<_>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// The largest flat cells within one of level `first`, down to level `last`. A cell that is not flat is divided in
/// eight.
fn within(
    points: &Points,
    ids: &[u32],
    range: Range<usize>,
    [first, last]: [u32; 2],
    noise: f64,
) -> Vec<FlatCell> {
    let mut found = Vec::new();
    let mut stack = vec![(range, first)];
    while let Some((range, level)) = stack.pop() {
        if range.len() < CELL_POINTS {
            continue;
        }
        let members = &ids[range.clone()];
        let center = points.positions[members[0] as usize].map(f64::from);
        let moments = points.moments_about(center, members.iter().map(|&i| (i, 1.0)));
        let side = points.side(level);
        if let Some((frame, deviation)) = spanned(&moments, side)
            && deviation <= FLAT_CELL_SIGMAS * noise
        {
            let cell = morton::decode(points.codes[members[0] as usize] >> (3 * level));
            found.push(FlatCell {
                range,
                low: cell.map(|c| c << level),
                side: 1 << level,
                part: Part {
                    moments,
                    frame,
                    facing: facing(points, members).unwrap_or_default(),
                    noise: deviation * deviation,
                },
            });
        } else if level > last {
            let mut start = range.start;
            let key = |i: u32| points.codes[i as usize] >> (3 * (level - 1));
            for child in members.chunk_by(|&a, &b| key(a) == key(b)) {
                stack.push((start..start + child.len(), level - 1));
                start += child.len();
            }
        }
    }
    found.sort_by_key(|s| s.range.start);
    found
}

/// The plane of points that fill more than a line of a cell of side `side`, and their standard deviation from it.
pub(super) fn spanned(moments: &Moments, side: f64) -> Option<(Frame, f64)> {
    let axes = moments.principal_axes()?;
    (axes.variances[1] > CELL_SPREAD * side * side)
        .then(|| (Frame::with_normal(moments.mean(), axes.normal()), axes.variances[0].sqrt()))
}

/// Pairs of cells that touch, the first before the second; no side is longer than `largest`.
pub(super) fn touching(cells: &[FlatCell], largest: u64) -> Vec<[u32; 2]> {
    let bucket = |cell: &FlatCell| cell.low.map(|c| c / largest);
    let mut buckets: MortonMap<Vec<u32>> = MortonMap::default();
    for (i, cell) in cells.iter().enumerate() {
        buckets.entry(morton::encode(bucket(cell))).or_default().push(i as u32);
    }
    cells
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, cell)| {
            let at = bucket(cell);
            let mut found = Vec::new();
            for k in 0..27_u64 {
                let off = [k % 3, k / 3 % 3, k / 9];
                // Offsets are -1 to 1; no cell lies below zero.
                let Some(near) = (0..3).try_fold([0; 3], |mut c, a| {
                    c[a] = (at[a] + off[a]).checked_sub(1)?;
                    Some(c)
                }) else {
                    continue;
                };
                for &j in buckets.get(&morton::encode(near)).into_iter().flatten() {
                    if i < j as usize && cell.touches(&cells[j as usize]) {
                        found.push([i as u32, j]);
                    }
                }
            }
            found.sort_unstable();
            found
        })
        .collect()
}
