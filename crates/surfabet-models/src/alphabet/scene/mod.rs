//! The scene as the words are fitted to it: thinned, in units of the lattice, and by cells.
//!
//! | file | what it holds |
//! |---|---|
//! | `thinning` | which points are kept |
//! | `mod` | the kept points in units |
//! | `cells` | the points by the cells of one scale |
//! | `normals` | their normals |
//! | `local_points` | the points about a pose, in the frame of the word |

mod cells;
mod local_points;
mod normals;
mod thinning;

use surfabet_base::parallel;

use self::cells::KEY_BITS;
pub(super) use self::cells::{Cells, Rows};
pub(super) use self::local_points::{LocalPoint, descriptor_reach, local_points, whole_numbers};
use self::normals::PointNormals;
pub(super) use self::thinning::Thinned;
use super::lattice::{MAX_CELL, SigmaRule, UNITS};
use crate::error::{Error, Result};
use crate::extent::too_small;
use crate::scans::Scene;

/// A scene in units of the lattice, positions from its corner.
pub(super) struct LatticeScene {
    /// Corner of the lattice in world coordinates, metres.
    pub origin: [f64; 3],
    /// Smallest radius of a word, metres.
    pub radius: f64,
    pub points: Vec<[f32; 3]>,
    /// Deviation allowed at each point.
    pub sigma: Vec<f32>,
    /// How many points of the scan each counts for.
    pub weights: Vec<u16>,
    /// Whether the scene is so large that it was thinned further than to half a sigma.
    pub is_coarse: bool,
    pub normals: PointNormals,
    /// Which sensor saw each point; empty when none is known.
    pub views: Vec<u16>,
    /// Where the sensors stood, ascending.
    pub sensors: Vec<[i64; 3]>,
    /// Sigma as a function of position.
    pub rule: SigmaRule,
}

impl LatticeScene {
    /// # Errors
    /// [`Error::InvalidParameter`] for a radius too small for the scene to fit the lattice, and beyond 65535 sensors.
    pub fn new(scene: &Scene, thinning: Thinned, radius: f64) -> Result<Self> {
        let unit = radius / UNITS as f64;
        let low: [f32; 3] = std::array::from_fn(|a| {
            scene.positions.iter().map(|p| p[a]).fold(f32::INFINITY, f32::min)
        });
        let origin: [f64; 3] = std::array::from_fn(|a| scene.origin[a] + f64::from(low[a]));
        let points: Vec<[f32; 3]> = parallel::map(&scene.positions, |p| {
            std::array::from_fn(|a| ((f64::from(p[a]) - f64::from(low[a])) / unit) as f32)
        });
        let extent = points.iter().flatten().fold(0.0, |m: f32, &c| m.max(c));
        let cells = MAX_CELL.min(1 << KEY_BITS) - 4;
        let extent = f64::from(extent) * unit;
        let least = extent / f64::from(cells);
        if radius < least {
            return Err(too_small("radius", radius, least, extent));
        }
        let to_units = |v: [f32; 3]| -> [i64; 3] {
            std::array::from_fn(|a| ((f64::from(v[a]) - f64::from(low[a])) / unit).round() as i64)
        };
        let mut sensors: Vec<[i64; 3]> = parallel::map(&scene.viewpoints, |&v| to_units(v));
        let seen_from = sensors.clone();
        sensors.sort_unstable();
        sensors.dedup();
        if sensors.len() > usize::from(u16::MAX) {
            return Err(Error::invalid(
                "number of sensor positions",
                sensors.len(),
                "at most 65535; learn parts of the cloud by themselves",
            ));
        }
        let index = |s: &[i64; 3]| sensors.binary_search(s).unwrap_or_default() as u16;
        let views = parallel::map(&seen_from, index);
        let rule = sigma_rule(scene, !sensors.is_empty(), unit);
        let sigma = scene.sigma.iter().map(|s| (f64::from(*s) / unit) as f32).collect();
        let Thinned { weights, is_coarse, .. } = thinning;
        let normals = PointNormals::new(scene.positions.clone())?;
        Ok(Self {
            origin,
            radius,
            points,
            sigma,
            weights,
            is_coarse,
            normals,
            views,
            sensors,
            rule,
        })
    }

    /// Where the sensor of a view stood.
    pub fn sensor(&self, view: u16) -> Option<[i64; 3]> {
        self.sensors.get(usize::from(view)).copied()
    }
}

/// Sigma as a function of position (eq. 13): `sigma_scale * hypot(tan(alpha / 2) * range, noise)`, or the median over
/// the points where the file cannot compute ranges.
fn sigma_rule(scene: &Scene, knows_sensors: bool, unit: f64) -> SigmaRule {
    let deviation = scene.deviation;
    match deviation.angular_resolution {
        Some(alpha) if knows_sensors => {
            let noise = deviation.sigma_scale * deviation.noise.unwrap_or(0.0);
            SigmaRule::new(deviation.sigma_scale * (0.5 * alpha).tan(), noise, unit)
        }
        _ => SigmaRule::new(0.0, scene.median_sigma(), unit),
    }
}
