//! Candidates: words that may occur somewhere, with what each would explain.
//!
//! | file | step |
//! |---|---|
//! | `planes` | planes at every cell, rounded to integers, with what the surface about them looks like |
//! | `descriptor` | the surface about a pose as an image of heights |
//! | `clusters` | words from the descriptors, and the words nearest to a descriptor |
//! | `mod` | those words in place of the planes |
//! | `coverage` | the points that an occurrence explains, and its outliers |

mod clusters;
mod coverage;
mod descriptor;
mod planes;

use rayon::prelude::*;
use surfabet_geom::Progress;

pub(super) use self::clusters::{cluster_words, nearest_words};
pub(super) use self::coverage::{Coverage, WordSamples, sample_grid};
pub(super) use self::descriptor::Descriptor;
pub(super) use self::planes::{CandidatePlane, find_planes};
use super::constants::{PLANE_DISTANCE, WORDS_PER_PLACE};
use super::placement::{Placement, WordPose};
use super::scene::{Cells, LatticeScene, LocalPoint, local_points};
use super::word::Word;
use crate::error::Result;
<<<<<<< HEAD
use crate::scans::{Upright, upright_frame};
use crate::vector::{self, squared_distance};
=======
>>>>>>> core

/// An occurrence that may be chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    pub placement: Placement,
    /// The pose that the placement stands for.
    pub pose: WordPose,
    pub coverage: Coverage,
}

/// The words whose descriptors are nearest to those of `planes`, in their places; all of one scale. The plane itself is
/// not among them, and none is tried where the surface is a plane.
pub(super) fn place_words(
    scene: &LatticeScene,
    cells: &Cells,
    planes: &[CandidatePlane],
    words: &[Word],
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>> {
    let descriptors: Vec<Descriptor> = words.iter().map(Descriptor::of_word).collect();
    let placed: Vec<Vec<Candidate>> = planes
        .par_iter()
        .map_init(
            || (Vec::new(), Vec::<LocalPoint>::new(), WordSamples::new(words)),
            |(around, points, samples), plane| {
                progress.check()?;
                if plane.descriptor.distance(&descriptors[0]) < PLANE_DISTANCE {
                    return Ok(Vec::new());
                }
                let mut fitting = nearest_words(&plane.descriptor, &descriptors, WORDS_PER_PLACE);
                fitting.retain(|&word| word != 0);
                if fitting.is_empty() {
                    return Ok(Vec::new());
                }
                let Candidate { placement, pose, .. } = plane.candidate;
                cells.touched(placement.cell, &pose, around);
                local_points(scene, &pose, around, points);
                let with_word = |word: usize| Candidate {
                    placement: Placement { word: word as u16, ..placement },
                    pose,
                    coverage: samples.coverage(word, &pose, spacing, points),
                };
                Ok(fitting.into_iter().map(with_word).collect())
            },
        )
        .collect::<Result<_>>()?;
    Ok(placed.into_iter().flatten().collect())
}
<<<<<<< HEAD

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
=======
>>>>>>> core
