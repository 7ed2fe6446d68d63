//! Candidates: at every cell of every scale the planes that pass through it, as poses of integers.

pub(super) mod clusters;
pub(super) mod coverage;
pub(super) mod descriptor;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use surfabet_geom::Progress;

use crate::alphabet::candidates::clusters::nearest_words;
use crate::alphabet::candidates::coverage::{Coverage, Rasters};
use crate::alphabet::candidates::descriptor::{HOLE, Patch};
use crate::alphabet::lattice::{MAX_SLOPE, UNITS, cell_center, offset_step, sigma, slope_steps};
use crate::alphabet::placement::{Placement, Stand};
use crate::alphabet::scene::local_points::{NearPoint, near};
use crate::alphabet::scene::{Cells, Data};
use crate::alphabet::word::Word;
use crate::error::Result;
use crate::scans::{Upright, upright_frame};
use crate::vector::{self, squared_distance};

/// Planes sought per cell.
const PLANES: usize = 3;

/// Rounds of fitting a plane to the points near to it.
const ROUNDS: usize = 3;

/// Points within this many sigmas of a plane are on it.
const ON_PLANE: f64 = 1.0;

/// Points about a cell that planes are fitted to, at most.
const FITTED: usize = 2048;

/// Samples per side of a word, at most.
const MAX_SIDE: f64 = 128.0;

/// Squared distance of a look to the plane's up to which it is one.
const PLANE: f32 = 1.5 * HOLE;

/// Words tried at a place: those whose looks are nearest to what is there.
pub(in crate::alphabet) const NEAREST: usize = 3;

/// A word that might stand somewhere.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct Candidate {
    pub placement: Placement,
    pub stand: Stand,
    pub coverage: Coverage,
}

/// A candidate plane, and what the surface about it looks like.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct Plane {
    pub candidate: Candidate,
    pub look: Patch,
}

/// Buffers for the points about a place.
#[derive(Default)]
struct Buffers {
    some: Vec<u32>,
    around: Vec<u32>,
    near: Vec<NearPoint>,
}

/// The planes at all cells of a scale.
pub(in crate::alphabet) fn planes(
    data: &Data,
    cells: &Cells,
    scale: u32,
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Vec<Plane>> {
    let plane = [Word::plane()];
    let found: Vec<Vec<Plane>> = (0..cells.len())
        .into_par_iter()
        .with_min_len(16)
        .map_init(
            || (Buffers::default(), Rasters::new(&plane)),
            |(buffers, rasters), k| {
                progress.check()?;
                let (cell, inside) = cells.get(k);
                cells.some_around(cell, FITTED, &mut buffers.some);
                Ok(in_cell(data, cells, cell, scale, spacing, inside, buffers, rasters))
            },
        )
        .collect::<Result<_>>()?;
    let mut all: Vec<Plane> = found.into_iter().flatten().collect();
    all.sort_by_key(|p| p.candidate.placement);
    all.dedup_by_key(|p| p.candidate.placement);
    Ok(all)
}

/// The words nearest to what each of `planes` looks like, in its place; all of one scale.
pub(in crate::alphabet) fn with_words(
    data: &Data,
    cells: &Cells,
    planes: &[Plane],
    words: &[Word],
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>> {
    let known: Vec<Patch> = words.iter().map(Patch::of_word).collect();
    let placed: Vec<Vec<Candidate>> = planes
        .par_iter()
        .map_init(
            || (Buffers::default(), Rasters::new(words)),
            |(buffers, rasters), plane| {
                progress.check()?;
                let Candidate { placement, stand, .. } = plane.candidate;
                let mut fitting = nearest_words(&plane.look, &known, NEAREST);
                fitting.retain(|&word| word != 0);
                // Where all is plane, words with holes are of no use.
                if plane.look.distance(&known[0]) < PLANE {
                    fitting.clear();
                }
                if !fitting.is_empty() {
                    let scale = u32::from(placement.scale);
                    cells.touched(placement.cell, &stand, scale, &mut buffers.around);
                    near(data, &stand, &buffers.around, &mut buffers.near);
                }
                let near = &buffers.near;
                let place = |word: usize| Candidate {
                    placement: Placement { word: word as u16, ..placement },
                    stand,
                    coverage: rasters.coverage(word, &stand, spacing, near),
                };
                Ok(fitting.into_iter().map(place).collect())
            },
        )
        .collect::<Result<_>>()?;
    Ok(placed.into_iter().flatten().collect())
}

#[allow(clippy::too_many_arguments)]
fn in_cell(
    data: &Data,
    cells: &Cells,
    cell: [i32; 3],
    scale: u32,
    spacing: f64,
    inside: &[u32],
    buffers: &mut Buffers,
    rasters: &mut Rasters<'_>,
) -> Vec<Plane> {
    let Buffers { some, around, near: close } = buffers;
    let middle = cell_center(cell, scale);
    let center = middle.map(|c| c as f64);
    let radius = (UNITS << scale) as f64;
    let mut open: Vec<u32> = inside.to_vec();
    let mut found: Vec<Plane> = Vec::new();
    for _ in 0..PLANES {
        let known = open.iter().filter(|&&i| data.normals[i as usize] != [0.0; 3]);
        let Some(&seed) = known.min_by(|&&i, &&j| {
            let off = |i: u32| squared_distance(data.points[i as usize].map(f64::from), center);
            off(i).total_cmp(&off(j)).then(i.cmp(&j))
        }) else {
            break;
        };
        let view = data.view.get(seed as usize).copied().unwrap_or(0);
        let sensor = data.sensor(view);
        let level = data.rule.level(middle, sensor);
        open.retain(|&i| i != seed);
        // Too coarse for the surface to show, or too fine to be said in one word.
        if radius < 0.5 * sigma(level) || 2.0 * radius > MAX_SIDE * sigma(level) {
            continue;
        }
        let Some(placement) = fitted(data, cell, scale, level, view, seed, some) else {
            continue;
        };
        let stand = placement.stand(level, sensor);
        open.retain(|&i| {
            let [.., h] = stand.local(data.points[i as usize].map(f64::from));
            h.abs() > ON_PLANE * f64::from(data.sigma[i as usize])
        });
        if found.iter().any(|p| p.candidate.placement == placement) {
            continue;
        }
        cells.touched(cell, &stand, scale, around);
        near(data, &stand, around, close);
        let coverage = rasters.coverage(0, &stand, spacing, close);
        if !coverage.points.is_empty() {
            let look = Patch::of(&stand, close);
            found.push(Plane { candidate: Candidate { placement, stand, coverage }, look });
        }
    }
    found
}

/// The plane about `seed`, fitted to the points near to it within the word's square, and quantised.
fn fitted(
    data: &Data,
    cell: [i32; 3],
    scale: u32,
    level: u32,
    view: u16,
    seed: u32,
    around: &[u32],
) -> Option<Placement> {
    let center = cell_center(cell, scale).map(|c| c as f64);
    let radius = (UNITS << scale) as f64;
    let mut normal = data.normals[seed as usize].map(f64::from);
    let p = data.points[seed as usize].map(f64::from);
    let mut offset: f64 = (0..3).map(|a| normal[a] * (p[a] - center[a])).sum();
    for round in 0..ROUNDS {
        let rows = upright_frame(normal, Upright::WorldX, [0.0; 3]);
        let tolerance = if round == 0 { 1.5 } else { ON_PLANE };
        let mut m = Matrix3::zeros();
        let mut b = Vector3::zeros();
        for &i in around {
            let q = data.points[i as usize].map(f64::from);
            let d: [f64; 3] = std::array::from_fn(|a| q[a] - center[a]);
            let [u, v, h] = rows.map(|r| r[0] * d[0] + r[1] * d[1] + r[2] * d[2]);
            let h = h - offset;
            let s = f64::from(data.sigma[i as usize]);
            if u.abs() <= radius && v.abs() <= radius && h.abs() <= tolerance * s {
                let x = Vector3::new(1.0, u / radius, v / radius);
                let w = 1.0 / (s * s);
                m += x * x.transpose() * w;
                b += x * (h * w);
            }
        }
        // A touch of ridge: few points leave the tilt as it was.
        let ridge = 1e-3 * m[(0, 0)];
        m[(1, 1)] += ridge;
        m[(2, 2)] += ridge;
        let x = m.try_inverse()? * b;
        let tilted: [f64; 3] =
            std::array::from_fn(|a| rows[2][a] - (x[1] * rows[0][a] + x[2] * rows[1][a]) / radius);
        let length = vector::length(tilted);
        // The plane through the same point at the cell's middle.
        offset = (offset + x[0]) / length;
        normal = tilted.map(|c| c / length);
    }
    let placement = quantised(normal, offset, cell, scale, level, view)?;
    // The point of the plane nearest to the cell's middle must lie in reach of it.
    (offset.abs() <= radius).then_some(placement)
}

fn quantised(
    normal: [f64; 3],
    offset: f64,
    cell: [i32; 3],
    scale: u32,
    level: u32,
    view: u16,
) -> Option<Placement> {
    let axis =
        (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()).then(b.cmp(&a)))?;
    let steps = f64::from(slope_steps(scale, level));
    let slope = |k: usize| {
        let s = (normal[(axis + k) % 3] / normal[axis] * steps).round();
        s.clamp(-f64::from(MAX_SLOPE), f64::from(MAX_SLOPE)) as i16
    };
    // The integer normal points along the positive axis.
    let offset = offset * normal[axis].signum();
    Some(Placement {
        scale: scale as u8,
        cell,
        axis: axis as u8,
        slopes: [slope(1), slope(2)],
        offset: (offset / offset_step(level) as f64).round() as i32,
        word: 0,
        view,
    })
}
