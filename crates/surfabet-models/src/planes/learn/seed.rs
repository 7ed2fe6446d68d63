//! Patches to start from: at random, or where the data are flat (sections II-B and III).

use std::ops::Range;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use surfabet_geom::morton::{self, MortonMap};
use surfabet_geom::{Moments, Progress};

use super::grid_size::PER_DEVIATION;
use super::m_step::plane;
use super::merge::{Part, Rule, agglomerate};
use super::trim::{facing, trim};
use crate::error::Result;
use crate::planes::patch::{Frame, Patch};
use crate::planes::points::Points;
use crate::planes::tiles::Tiles;

/// Sides of the cells that are looked at first and last, in standard deviations of the noise.
const LARGEST_CELL: f64 = 12.0;
const SMALLEST_CELL: f64 = 5.0;

/// Points that tell whether a cell is flat.
const PER_CELL: usize = 10;

/// A cell is flat up to this many standard deviations of the noise.
const FLAT: f64 = 1.5;

/// Variance along the second axis that a cell's points need, as a share of the squared side: a filled square has a
/// twelfth, a line of points none.
const SPANNING: f64 = 0.01;

/// The noise is read where cells are flat to this share of their side; in smaller ones noise is all there is.
const FLATNESS: f64 = 0.1;

/// Tiles along each side of a patch that is placed at random.
const RANDOM_TILES: f64 = 8.0;

/// `n` squares at points of the cloud, of half its extent, turned at random.
pub(in crate::planes) fn random(points: &Points, n: usize, random_state: u64) -> Vec<Patch> {
    let mut rng = ChaCha8Rng::seed_from_u64(random_state);
    let side = 0.5 * points.extent().max(points.cell);
    (0..n)
        .map(|_| {
            let center = points.positions[rng.random_range(0..points.len())].map(f64::from);
            let frame = Frame::with_normal(center, direction(&mut rng));
            let mut tiles = Tiles::new([-0.5 * side; 2], [side; 2], side / RANDOM_TILES);
            tiles.support(vec![true; tiles.supported().len()]);
            Patch::bare(frame, tiles)
        })
        .collect()
}

/// A unit vector, all directions alike.
fn direction(rng: &mut impl Rng) -> [f64; 3] {
    let z: f64 = rng.random_range(-1.0..=1.0);
    let angle = rng.random_range(0.0..std::f64::consts::TAU);
    let r = (1.0 - z * z).sqrt();
    [r * angle.cos(), r * angle.sin(), z]
}

/// Standard deviation of the points across the surface, metres: the median over the points, in the smallest cells in
/// which at least half of them are on something flat. `None` when that is so on no scale.
pub(super) fn noise(points: &Points) -> Option<f64> {
    let mut level = points.level_with(PER_CELL);
    let mut cells: Vec<(u64, Moments)> = points
        .cells(level)
        .map(|c| (points.codes[c.start] >> (3 * level), points.moments(c)))
        .collect();
    while level < morton::BITS && cells.len() > 1 {
        let side = points.side(level);
        let mut deviations: Vec<(f64, f64)> = cells
            .iter()
            .map(|(_, m)| (spanned(m, side).map_or(f64::INFINITY, |d| d.1), m.weight()))
            .collect();
        let middle = weighted_median(&mut deviations);
        if middle <= FLATNESS * side {
            return Some(middle);
        }
        cells = cells
            .chunk_by(|a, b| a.0 >> 3 == b.0 >> 3)
            .map(|children| {
                let mut sum = Moments::new();
                children.iter().for_each(|c| sum.merge(&c.1));
                (children[0].0 >> 3, sum)
            })
            .collect();
        level += 1;
    }
    None
}

/// The plane of points that fill more than a line of a cell, and their standard deviation from it.
fn spanned(moments: &Moments, side: f64) -> Option<(Frame, f64)> {
    let axes = moments.principal_axes()?;
    (axes.variances[1] > SPANNING * side * side)
        .then(|| (Frame::with_normal(moments.mean(), axes.normal()), axes.variances[0].sqrt()))
}

/// The value that half of the weight does not exceed.
fn weighted_median(values: &mut [(f64, f64)]) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut seen = 0.0;
    for &(value, weight) in values.iter() {
        seen += weight;
        if seen >= half {
            return value;
        }
    }
    f64::INFINITY
}

/// A flat cell.
struct Seed {
    /// Consecutive members of the points looked at.
    range: Range<usize>,
    /// Lower corner and side in the smallest cells of the curve.
    low: [u64; 3],
    side: u64,
    part: Part,
}

impl Seed {
    fn touches(&self, other: &Self) -> bool {
        (0..3).all(|a| {
            self.low[a] <= other.low[a] + other.side && other.low[a] <= self.low[a] + self.side
        })
    }
}

/// Patches where the points `ids`, ascending, are flat: cells of an octree up to the noise that the grid size stands
/// for, joined with their neighbours where both are in one plane. Those with fewer than `min_points` are left out.
pub(super) fn from_data(
    points: &Points,
    ids: &[u32],
    grid_size: f64,
    tolerance: f64,
    min_points: usize,
    progress: &dyn Progress,
) -> Result<Vec<Patch>> {
    let noise = grid_size / PER_DEVIATION;
    let level_of =
        |side: f64| (side / points.cell).log2().ceil().clamp(0.0, f64::from(morton::BITS)) as u32;
    let first = level_of((LARGEST_CELL * noise).max(6.0 * points.spacing));
    let last = level_of((SMALLEST_CELL * noise).max(3.0 * points.spacing)).min(first);
    let key = |i: u32, level: u32| points.codes[i as usize] >> (3 * level);
    let mut ranges = Vec::new();
    let mut start = 0;
    for cell in ids.chunk_by(|&a, &b| key(a, first) == key(b, first)) {
        ranges.push(start..start + cell.len());
        start += cell.len();
    }
    let seeds: Vec<Vec<Seed>> = ranges
        .into_par_iter()
        .map(|range| {
            progress.check()?;
            Ok(flat_cells(points, ids, range, first, last, noise))
        })
        .collect::<Result<_>>()?;
    let seeds: Vec<Seed> = seeds.into_iter().flatten().collect();
    let pairs = touching(&seeds, 1 << first);
    let parts = seeds.iter().map(|s| s.part.clone()).collect();
    let rule = Rule { distance: grid_size, deviation: noise, tolerance };
    let into = agglomerate(parts, &pairs, &rule, progress)?;
    let mut groups: Vec<Vec<u32>> = vec![Vec::new(); seeds.len()];
    for (seed, to) in seeds.iter().zip(into) {
        groups[to as usize].extend(&ids[seed.range.clone()]);
    }
    Ok(groups
        .into_par_iter()
        .filter(|set| set.len() >= min_points)
        .filter_map(|mut set| {
            set.sort_unstable();
            let center = points.positions[set[0] as usize].map(f64::from);
            let moments = points.moments_about(center, set.iter().map(|&i| (i, 1.0)));
            trim(points, plane(&moments)?, &set, grid_size)
        })
        .collect())
}

/// The largest flat cells within one of level `first`, down to level `last`.
fn flat_cells(
    points: &Points,
    ids: &[u32],
    range: Range<usize>,
    first: u32,
    last: u32,
    noise: f64,
) -> Vec<Seed> {
    let mut seeds = Vec::new();
    let mut stack = vec![(range, first)];
    while let Some((range, level)) = stack.pop() {
        if range.len() < PER_CELL {
            continue;
        }
        let members = &ids[range.clone()];
        let center = points.positions[members[0] as usize].map(f64::from);
        let moments = points.moments_about(center, members.iter().map(|&i| (i, 1.0)));
        let side = points.side(level);
        if let Some((frame, deviation)) = spanned(&moments, side)
            && deviation <= FLAT * noise
        {
            let cell = morton::decode(points.codes[members[0] as usize] >> (3 * level));
            seeds.push(Seed {
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
    seeds.sort_by_key(|s| s.range.start);
    seeds
}

/// Pairs of seeds whose cells touch, the first before the second; none is larger than `largest`.
fn touching(seeds: &[Seed], largest: u64) -> Vec<[u32; 2]> {
    let cell = |seed: &Seed| seed.low.map(|c| c / largest);
    let mut of: MortonMap<Vec<u32>> = MortonMap::default();
    for (i, seed) in seeds.iter().enumerate() {
        of.entry(morton::encode(cell(seed))).or_default().push(i as u32);
    }
    seeds
        .par_iter()
        .enumerate()
        .flat_map_iter(|(i, seed)| {
            let at = cell(seed);
            let mut found = Vec::new();
            for k in 0..27_u64 {
                let off = [k % 3, k / 3 % 3, k / 9];
                // One is taken off again; no cell lies below zero.
                let Some(cell) = (0..3).try_fold([0; 3], |mut c, a| {
                    c[a] = (at[a] + off[a]).checked_sub(1)?;
                    Some(c)
                }) else {
                    continue;
                };
                for &j in of.get(&morton::encode(cell)).into_iter().flatten() {
                    if i < j as usize && seed.touches(&seeds[j as usize]) {
                        found.push([i as u32, j]);
                    }
                }
            }
            found.sort_unstable();
            found
        })
        .collect()
}
