//! The cells of an octree in which points are flat.

use surfabet_base::parallel;
use surfabet_geom::morton::{self, MortonMap};
use surfabet_geom::{Moments, Progress};

use crate::error::Result;
use crate::planes::constants::{
    CELL_POINTS, CELL_SPREAD, FLAT_CELL_SIGMAS, LEAST_STEP_NOISE, STEP_DEVIATIONS,
};
use crate::planes::fit::merge::{PlanarSet, Rule};
use crate::planes::fit::trim::facing;
use crate::planes::patch::Frame;
use crate::planes::points::Points;

/// A flat cell.
pub(super) struct FlatCell {
    /// Its points, ascending.
    pub members: Vec<u32>,
    /// Lower corner and side in the smallest cells of the curve.
    low: [u64; 3],
    side: u64,
    /// Its points and their plane.
    pub part: PlanarSet,
}

impl FlatCell {
    fn new(points: &Points, members: Vec<u32>, level: u32, part: PlanarSet) -> Self {
        let cell = morton::decode(points.codes[members[0] as usize] >> (3 * level));
        Self { members, low: cell.map(|c| c << level), side: 1 << level, part }
    }

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
    rule: &Rule,
    progress: &dyn Progress,
) -> Result<Vec<FlatCell>> {
    let key = |i: u32| points.codes[i as usize] >> (3 * first);
    let cells: Vec<&[u32]> = ids.chunk_by(|&a, &b| key(a) == key(b)).collect();
    let found = parallel::try_map(&cells, |members| -> Result<Vec<FlatCell>> {
        progress.check()?;
        Ok(within(points, members, [first, last], rule))
    })?;
    Ok(found.into_iter().flatten().collect())
}

/// The largest flat cells within one of level `first`, down to level `last`. Points seen from either side of a cell's plane
/// are cells of their own. What is not flat is divided in eight.
fn within(points: &Points, all: &[u32], [first, last]: [u32; 2], rule: &Rule) -> Vec<FlatCell> {
    let mut found = Vec::new();
    let mut stack = vec![(all.to_vec(), first)];
    while let Some((members, level)) = stack.pop() {
        if members.len() < CELL_POINTS {
            continue;
        }
        let whole = Spanned::of(points, &members, level);
        let mut rest = Vec::new();
        for side in sides(points, &members, whole.as_ref()) {
            // Mostly all were seen from one side.
            let spanned = match side.len() {
                n if n == members.len() => whole.clone(),
                ..CELL_POINTS => None,
                _ => Spanned::of(points, &side, level),
            };
            match spanned.and_then(|spanned| flat_cell(points, &side, level, &spanned, rule)) {
                Some(part) => found.push(FlatCell::new(points, side, level, part)),
                None => rest.extend(side),
            }
        }
        if level > last {
            // Faster than the unstable one, as the points of each side are sorted.
            rest.sort();
            let key = |i: u32| points.codes[i as usize] >> (3 * (level - 1));
            let children = rest.chunk_by(|&a, &b| key(a) == key(b));
            stack.extend(children.map(|child| (child.to_vec(), level - 1)));
        }
    }
    found.sort_by_key(|cell| cell.members[0]);
    found
}

/// Points of a cell that fill more than a line of it.
#[derive(Clone)]
struct Spanned {
    moments: Moments,
    /// Their plane, and their standard deviation from it.
    frame: Frame,
    deviation: f64,
}

impl Spanned {
    fn of(points: &Points, members: &[u32], level: u32) -> Option<Self> {
        let moments = moments_of(points, members);
        let (frame, deviation) = spanned(&moments, points.side(level))?;
        Some(Self { moments, frame, deviation })
    }
}

/// The points of a cell by the side of its plane that they were seen from; all where that is unknown.
fn sides(points: &Points, members: &[u32], whole: Option<&Spanned>) -> Vec<Vec<u32>> {
    match whole {
        Some(whole) if points.facing.is_some() => points.sides(members, whole.frame.normal).into(),
        _ => vec![members.to_vec()],
    }
}

/// The points of a cell, or of one side of it, if they are flat up to the noise.
fn flat_cell(
    points: &Points,
    members: &[u32],
    level: u32,
    &Spanned { moments, frame, deviation }: &Spanned,
    rule: &Rule,
) -> Option<PlanarSet> {
    let facing = facing(points, members).unwrap_or_default();
    let part = PlanarSet { n: members.len(), moments, frame, facing, noise: deviation * deviation };
    let noise = rule.deviation * part.noise_factor(&frame, rule.incidence);
    let flat =
        deviation <= FLAT_CELL_SIGMAS * noise && !stepped(points, members, level, &frame, noise);
    flat.then_some(part)
}

/// True when the plane of a cell does not go through the points of its eighths: a step or a bend that is less than the noise
/// shows in the means of some dozen points.
///
/// With `n_c` points of mean height `m_c` above the plane in eighth `c`, of `k`, and the variance `s^2` of the heights about
/// these means, `sum n_c m_c^2 / s^2` is distributed as chi squared with less than `k` degrees of freedom where the cell is
/// flat.
fn stepped(points: &Points, members: &[u32], level: u32, frame: &Frame, noise: f64) -> bool {
    let Some(below) = level.checked_sub(1) else { return false };
    let key = |i: u32| points.codes[i as usize] >> (3 * below);
    let (mut k, mut between, mut within) = (0.0, 0.0, 0.0);
    for eighth in members.chunk_by(|&a, &b| key(a) == key(b)) {
        let height = |&i: &u32| frame.local(points.positions[i as usize])[2];
        let n = eighth.len() as f64;
        let mean = eighth.iter().map(height).sum::<f64>() / n;
        k += 1.0;
        between += n * mean * mean;
        within += eighth.iter().map(|i| (height(i) - mean).powi(2)).sum::<f64>();
    }
    let freedom = members.len() as f64 - k;
    if freedom < 1.0 {
        return false;
    }
    let variance = (within / freedom).max((LEAST_STEP_NOISE * noise).powi(2));
    between > variance * (k + STEP_DEVIATIONS * f64::sqrt(2.0 * k))
}

/// Moments of some points.
pub(super) fn moments_of(points: &Points, members: &[u32]) -> Moments {
    let center = members.first().map_or([0.0; 3], |&i| points.positions[i as usize].map(f64::from));
    points.moments_about(center, members.iter().map(|&i| (i, 1.0)))
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
    parallel::gather(cells.len(), |i, found| {
        let before = found.len();
        let cell = &cells[i];
        let at = bucket(cell);
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
        found[before..].sort_unstable();
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use surfabet_geom::PointCloud;

    use super::*;

    /// Whether 4000 points over a square metre with even noise of a standard deviation of 1 cm, of which those beyond
    /// `x = 0.5` are `step` higher, count as a step.
    fn is_step(step: f64, seed: u64) -> bool {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let half = 0.01 * f64::sqrt(3.0);
        let positions = (0..4000).map(|_| {
            let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
            let z = rng.random_range(-half..half) + if x > 0.5 { step } else { 0.0 };
            [x, y, z].map(|c| c as f32)
        });
        let points = Points::new(&PointCloud::from_positions(positions.collect()).0, None).unwrap();
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let (frame, _) = spanned(&moments_of(&points, &all), 1.0).unwrap();
        stepped(&points, &all, morton::BITS, &frame, 0.01)
    }

    /// A tilted plane is an eighth of the step off in the mean of either half: 4000 / 64 squared standard deviations in all.
    #[test]
    fn steps_in_the_noise_are_told_from_planes() {
        assert!((0..20).all(|seed| !is_step(0.0, seed)));
        assert!((0..20).all(|seed| is_step(0.01, seed)));
    }
}
