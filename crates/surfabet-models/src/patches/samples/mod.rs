//! Points merged into samples of half a pixel in the frame of the lattice, each with the side it faces.

pub(in crate::patches) mod cells;

use rayon::prelude::*;
use surfabet_geom::{Moments, PointCloud, Progress};

use crate::error::Result;
use crate::patches::axes::Orientation;
use crate::patches::samples::cells::{Cells, cell_of, key};
use crate::sensor::{Sensor, to_sensor};
use crate::vector::dot;

/// Side of the cells that points are merged in, in pixels.
pub(in crate::patches) const SAMPLE_SIZE: f64 = 0.5;

/// Side of the cells that normals are fitted in, in pixels; each takes its 26 neighbours in.
const NORMAL_CELL: f32 = 2.0;

/// How much a neighbour's axis counts against the own normal when axes are chosen.
const NEIGHBOUR_PULL: f32 = 0.04;

/// How much the axis of a cell counts whose samples lie on a line, against 1 for a plane.
const LINE_TRUST: f32 = 0.2;

/// Rounds of choosing axes.
const ROUNDS: usize = 4;

/// A cell whose samples agree on the side to this share is on that side as a whole.
const AGREEMENT: f32 = 0.85;

/// A merged sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::patches) struct Sample {
    /// Position in the frame of the lattice, metres.
    pub position: [f32; 3],
    /// Mean colour, 0 to 255.
    pub color: [f32; 3],
    /// Sum of the weights of its points.
    pub weight: f32,
    /// Mean direction to the sensors; zero where unknown.
    view: [f32; 3],
}

/// Samples in the order of their cells.
pub(in crate::patches) struct Samples {
    pub samples: Vec<Sample>,
    /// Twice the axis that the surface is closest to being orthogonal to, plus one where it faces down that axis.
    pub sides: Vec<u8>,
    pub has_color: bool,
}

fn rotate(rows: &[[f32; 3]; 3], p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|a| rows[a][0] * p[0] + rows[a][1] * p[1] + rows[a][2] * p[2])
}

impl Samples {
    /// Merges the points of `cloud`.
    pub fn merge(
        cloud: &PointCloud,
        orientation: Orientation,
        resolution: f64,
        sensor: Sensor,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let to_world = orientation.rotation();
        let rows: [[f32; 3]; 3] =
            std::array::from_fn(|a| std::array::from_fn(|k| to_world[k][a] as f32));
        let cell = (SAMPLE_SIZE * resolution) as f32;
        let rotated: Vec<[f32; 3]> =
            cloud.positions().par_iter().map(|&p| rotate(&rows, p)).collect();
        progress.check()?;
        let cells = Cells::new(rotated.len(), |i| key(cell_of(rotated[i], cell)));
        progress.check()?;
        let samples: Vec<Sample> = (0..cells.len())
            .into_par_iter()
            .with_min_len(1 << 12)
            .map(|g| merge_cell(cloud, &rows, &rotated, sensor, cells.of(g)))
            .collect();
        progress.check()?;
        let sides = sides(&samples, NORMAL_CELL * resolution as f32, cloud.viewpoints().is_some());
        progress.check()?;
        Ok(Self { samples, sides, has_color: cloud.colors().is_some() })
    }
}

fn merge_cell(
    cloud: &PointCloud,
    rows: &[[f32; 3]; 3],
    rotated: &[[f32; 3]],
    sensor: Sensor,
    points: &[u32],
) -> Sample {
    let mut weights = 0.0_f64;
    let (mut position, mut color, mut view) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3]);
    for &i in points {
        let i = i as usize;
        let weight = f64::from(sensor.weight_of(cloud, i));
        weights += weight;
        (0..3).for_each(|a| position[a] += weight * f64::from(rotated[i][a]));
        if let Some(colors) = cloud.colors() {
            (0..3).for_each(|c| color[c] += weight * f64::from(colors[i][c]));
        }
        let direction = to_sensor(cloud, i);
        (0..3).for_each(|a| view[a] += weight * f64::from(direction[a]));
    }
    let mean = |sum: [f64; 3]| sum.map(|s| (s / weights) as f32);
    Sample {
        position: mean(position),
        color: mean(color),
        weight: weights as f32,
        view: rotate(rows, mean(view)),
    }
}

/// Sum of moments of a cell and its 26 neighbours.
fn neighbourhood(cells: &Cells, moments: &[Moments], cell: [i32; 3]) -> (Moments, Vec<u32>) {
    let mut sum = Moments::new();
    let mut around = Vec::with_capacity(27);
    for dx in -1..=1 {
        for dy in -1..=1 {
            for dz in -1..=1 {
                if let Some(g) = cells.find(key([cell[0] + dx, cell[1] + dy, cell[2] + dz])) {
                    sum.merge(&moments[g]);
                    around.push(g as u32);
                }
            }
        }
    }
    (sum, around)
}

fn sides(samples: &[Sample], cell: f32, has_views: bool) -> Vec<u8> {
    let cells = Cells::new(samples.len(), |i| key(cell_of(samples[i].position, cell)));
    let moments: Vec<Moments> = (0..cells.len())
        .into_par_iter()
        .map(|g| {
            let members = cells.of(g);
            let at = samples[members[0] as usize].position;
            Moments::about(at, members.iter().map(|&i| samples[i as usize].position))
        })
        .collect();
    let fitted: Vec<([f32; 3], f32, Vec<u32>)> = (0..cells.len())
        .into_par_iter()
        .map(|g| {
            let at = samples[cells.of(g)[0] as usize].position;
            let (sum, around) = neighbourhood(&cells, &moments, cell_of(at, cell));
            match sum.principal_axes() {
                Some(axes) if sum.weight() >= 5.0 && axes.variances[1] > 0.0 => {
                    let flat = 1.0 - (axes.variances[0] / axes.variances[1]).sqrt();
                    (axes.normal().map(|c| c as f32), flat as f32, around)
                }
                Some(axes) => {
                    // A line or less: any plane along it will do, so not one across it.
                    let along = axes.directions[2].map(|c| c.abs());
                    let across = (0..3).min_by(|&a, &b| along[a].total_cmp(&along[b])).unwrap_or(0);
                    let mut normal = [0.0; 3];
                    normal[across] = 1.0;
                    (normal, LINE_TRUST, around)
                }
                None => ([0.0; 3], 0.0, around),
            }
        })
        .collect();
    let fit = |g: usize, axis: usize| {
        let (normal, flat, _) = &fitted[g];
        normal[axis] * normal[axis] * flat
    };
    let best = |score: &dyn Fn(usize) -> f32| {
        (0..3).max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a))).map_or(0, |a| a as u8)
    };
    let mut axes: Vec<u8> =
        (0..cells.len()).into_par_iter().map(|g| best(&|a| fit(g, a))).collect();
    for _ in 0..ROUNDS {
        axes = (0..cells.len())
            .into_par_iter()
            .map(|g| {
                let mut votes = [0.0_f32; 3];
                for &near in &fitted[g].2 {
                    votes[axes[near as usize] as usize] += NEIGHBOUR_PULL;
                }
                best(&|a| fit(g, a) + votes[a])
            })
            .collect();
    }
    let mut sides = vec![0_u8; samples.len()];
    let per_cell: Vec<Vec<u8>> = (0..cells.len())
        .into_par_iter()
        .map(|g| {
            let axis = axes[g] as usize;
            let members = cells.of(g);
            let (mut normal, _, _) = fitted[g];
            if normal[axis] < 0.0 {
                normal = normal.map(|c| -c);
            }
            if normal[axis] == 0.0 {
                normal = [0.0; 3];
                normal[axis] = 1.0;
            }
            let down: Vec<bool> = members
                .iter()
                .map(|&i| has_views && dot(samples[i as usize].view, normal) < 0.0)
                .collect();
            let share = down.iter().filter(|d| **d).count() as f32 / down.len() as f32;
            let side = |d: bool| 2 * axes[g] + u8::from(d);
            down.into_iter()
                .map(|d| {
                    if share >= AGREEMENT {
                        side(true)
                    } else if share <= 1.0 - AGREEMENT {
                        side(false)
                    } else {
                        side(d)
                    }
                })
                .collect()
        })
        .collect();
    for (g, of) in per_cell.into_iter().enumerate() {
        for (&i, side) in cells.of(g).iter().zip(of) {
            sides[i as usize] = side;
        }
    }
    sides
}
