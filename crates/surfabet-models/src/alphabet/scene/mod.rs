//! The scene in units, and its points by cells.

pub(super) mod local_points;
pub(super) mod thin;

use rayon::prelude::*;

use crate::alphabet::lattice::{MAX_CELL, SigmaRule, UNITS, cell_center, sigma};
use crate::alphabet::placement::Stand;
use crate::error::{Error, Result};
use crate::scans::Scene;

/// Bits of one coordinate of a cell's key.
const KEY_BITS: u32 = 21;

/// Cells around a cell that a word in it can reach, per direction.
const REACH: i64 = 2;

/// A scene, lengths in units from the corner of the lattice.
pub(in crate::alphabet) struct Data {
    /// Metres.
    pub origin: [f64; 3],
    radius: f64,
    pub points: Vec<[f32; 3]>,
    pub sigma: Vec<f32>,
    /// Unit normals, zero where unknown.
    pub normals: Vec<[f32; 3]>,
    /// Which sensor saw each point; empty when none is known.
    pub view: Vec<u16>,
    pub sensors: Vec<[i64; 3]>,
    pub rule: SigmaRule,
}

impl Data {
    /// # Errors
    /// [`Error::TooLarge`] when the scene does not fit the lattice, [`Error::InvalidParameter`] beyond 65536 sensors.
    pub fn new(scene: &Scene, normals: Vec<[f32; 3]>, radius: f64) -> Result<Self> {
        let unit = radius / UNITS as f64;
        let low: [f32; 3] = std::array::from_fn(|a| {
            scene.positions.iter().map(|p| p[a]).fold(f32::INFINITY, f32::min)
        });
        let origin: [f64; 3] = std::array::from_fn(|a| scene.origin[a] + f64::from(low[a]));
        let points: Vec<[f32; 3]> = scene
            .positions
            .par_iter()
            .map(|p| std::array::from_fn(|a| ((f64::from(p[a]) - f64::from(low[a])) / unit) as f32))
            .collect();
        let extent = points.iter().flatten().fold(0.0, |m: f32, &c| m.max(c));
        let cells = MAX_CELL.min(1 << KEY_BITS) - 4;
        let limit = f64::from(cells) * radius;
        if f64::from(extent) * unit > limit {
            let extent = f64::from(extent) * unit;
            return Err(Error::TooLarge { extent, limit, resolution: radius });
        }
        let to_units = |v: [f32; 3]| -> [i64; 3] {
            std::array::from_fn(|a| ((f64::from(v[a]) - f64::from(low[a])) / unit).round() as i64)
        };
        let mut sensors: Vec<[i64; 3]> =
            scene.viewpoints.par_iter().map(|&v| to_units(v)).collect();
        let seen_from = sensors.clone();
        sensors.par_sort_unstable();
        sensors.dedup();
        if sensors.len() > usize::from(u16::MAX) {
            return Err(Error::invalid("number of sensor positions", sensors.len(), "below 65536"));
        }
        let place = |s: &[i64; 3]| sensors.binary_search(s).unwrap_or_default() as u16;
        let view = seen_from.par_iter().map(place).collect();
        let deviation = scene.deviation;
        let noise = deviation.sigma_scale * deviation.noise.unwrap_or(0.0);
        let rule = match deviation.angular_resolution {
            Some(alpha) if !sensors.is_empty() => {
                SigmaRule::new(deviation.sigma_scale * (0.5 * alpha).tan(), noise, unit)
            }
            // Ranges without a sensor's place, or neither: one sigma for all.
            _ => SigmaRule::new(0.0, scene.median_sigma(), unit),
        };
        let sigma = scene.sigma.iter().map(|s| (f64::from(*s) / unit) as f32).collect();
        Ok(Self { origin, radius, points, sigma, normals, view, sensors, rule })
    }

    /// Smallest radius of a word, metres.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    pub fn sensor(&self, view: u16) -> Option<[i64; 3]> {
        self.sensors.get(usize::from(view)).copied()
    }
}

/// The points of a scene by the cells of one scale.
pub(in crate::alphabet) struct Cells {
    keys: Vec<u64>,
    starts: Vec<u32>,
    points: Vec<u32>,
}

fn key(cell: [i64; 3]) -> u64 {
    (cell[2] as u64) << (2 * KEY_BITS) | (cell[1] as u64) << KEY_BITS | cell[0] as u64
}

impl Cells {
    pub fn new(points: &[[f32; 3]], scale: u32) -> Self {
        let side = (UNITS << scale) as f32;
        let mut pairs: Vec<(u64, u32)> = points
            .par_iter()
            .enumerate()
            .map(|(i, p)| (key(p.map(|c| (c / side) as i64)), i as u32))
            .collect();
        pairs.par_sort_unstable();
        let mut keys = Vec::new();
        let mut starts = Vec::new();
        for (i, pair) in pairs.iter().enumerate() {
            if keys.last() != Some(&pair.0) {
                keys.push(pair.0);
                starts.push(i as u32);
            }
        }
        starts.push(pairs.len() as u32);
        Self { keys, starts, points: pairs.into_iter().map(|p| p.1).collect() }
    }

    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Coordinates and points of the k-th cell.
    pub fn get(&self, k: usize) -> ([i32; 3], &[u32]) {
        let mask = (1 << KEY_BITS) - 1;
        let cell = [0, 1, 2].map(|a| (self.keys[k] >> (a * KEY_BITS) & mask) as i32);
        (cell, &self.points[self.starts[k] as usize..self.starts[k + 1] as usize])
    }

    /// Calls `each` with the cells that a word in `cell` can reach, and their points.
    fn around(&self, cell: [i32; 3], mut each: impl FnMut([i32; 3], &[u32])) {
        let [x, y, z] = cell.map(i64::from);
        let first = (x - REACH).max(0);
        for z in (z - REACH).max(0)..=z + REACH {
            for y in (y - REACH).max(0)..=y + REACH {
                let from = self.keys.partition_point(|&k| k < key([first, y, z]));
                let last = key([x + REACH, y, z]);
                for k in (from..self.len()).take_while(|&k| self.keys[k] <= last) {
                    let (cell, points) = self.get(k);
                    each(cell, points);
                }
            }
        }
    }

    /// Puts at most about `most` of the points that a word in `cell` can reach into `found`, evenly chosen.
    pub fn some_around(&self, cell: [i32; 3], most: usize, found: &mut Vec<u32>) {
        found.clear();
        let mut n = 0;
        self.around(cell, |_, points| n += points.len());
        let step = n.div_ceil(most).max(1);
        let mut skip = 0;
        self.around(cell, |_, points| {
            found.extend(points.iter().skip(skip).step_by(step));
            // Where the next cell goes on: points since the last one taken.
            skip = if skip >= points.len() {
                skip - points.len()
            } else {
                (step - (points.len() - skip) % step) % step
            };
        });
    }

    /// Puts the points of the cells that a word at `stand` in `cell` touches into `found`.
    pub fn touched(&self, cell: [i32; 3], stand: &Stand, scale: u32, found: &mut Vec<u32>) {
        found.clear();
        // Half the diagonal of a cell, and as much as the deviation of its points.
        let margin = (0.75_f64).sqrt() * stand.radius + 2.0 * sigma(stand.level);
        self.around(cell, |cell, points| {
            let center = cell_center(cell, scale).map(|c| c as f64);
            let [right, up, height] = stand.local(center).map(f64::abs);
            if right.max(up) <= stand.radius + margin && height <= 0.5 * stand.radius + margin {
                found.extend_from_slice(points);
            }
        });
    }
}
