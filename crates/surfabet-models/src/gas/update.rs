//! Updating a gas with another scan of the same world.

use std::collections::HashSet;

use surfabet_geom::cells::wide_cell_of;
use surfabet_geom::{PointCloud, Progress};

use super::constants::{MOST_RECALLED, PATIENCE, SETTLING};
use super::decode::tangents;
use super::describe::Observed;
use super::finish::finish;
use super::learn::STAGES;
use super::model::GasModel;
use super::network::{Graph, Signals, Stop, grow};
use super::options::{GasOptions, MAX_NEURONS};
use super::ordered::Ordered;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::spread::across;
use crate::stages::Stages;
use crate::start::{Leave, Start};

/// Golden angle, radians: turns by it fill a disc evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Points that represent the scans that a model was learned from.
struct Recalled {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// The neuron of each.
    neurons: Vec<u32>,
}

impl GasModel {
    /// Adds another scan of the same world to the map: a larger gas, which still holds this one's scene.
    ///
    /// Signals are drawn from `cloud` and from points spread over this model's discs, which represent its own scans, in
    /// proportion to the numbers of points: so nothing is lost where the new scan does not reach, and both are
    /// averaged where it does. `n_neurons` is the number of neurons afterwards; `None` gives the space that both
    /// occupy as many per volume as this model has.
    ///
    /// Of `options`, `n_neurons`, `passes` and `position_step` are ignored.
    ///
    /// # Errors
    /// As [`learn`](super::learn()); [`Error::InvalidParameter`] for fewer neurons than there are.
    pub fn update(
        &self,
        cloud: &PointCloud,
        n_neurons: Option<usize>,
        options: &GasOptions,
        progress: &dyn Progress,
    ) -> Result<GasModel> {
        let mut stages = Stages::new(STAGES, progress);
        let (quality, keep) = (options.quality, options.keep_outliers);
        let start = Start::of(cloud, quality, Leave::Outliers, keep, &mut stages)?;
        let cloud: &PointCloud = &start.cloud;
        let origin = self.origin();
        let positions = cloud.positions_about(origin);
        let recalled = self.recall(MOST_RECALLED);
        let n = self.updated_size(n_neurons, &positions, &recalled.positions)?;
        let options = GasOptions { n_neurons: Some(n), passes: None, ..options.clone() };
        options.check()?;
        // Steps 2 to 10 for one signal after the other, from the neurons that there are.
        let old = self.n_points() as f64;
        let sets = [(&recalled.positions[..], old), (&positions[..], positions.len() as f64)];
        let signals = Signals::new(&sets, options.random_state);
        let graph = Graph { positions: self.positions(), edges: self.edges.clone() };
        let planned = (n - self.len()) as u64 * u64::from(options.patterns()) + SETTLING * n as u64;
        let stop = Stop {
            n_neurons: n,
            target_error: options.target_error,
            signals: planned,
            at_most: PATIENCE * planned,
        };
        let grown =
            stages.run("growing", |progress| grow(&graph, signals, &options, stop, progress))?;
        // The polish; colours, intensities, normals and sizes of the neurons, and everything rounded.
        let ordered = [Ordered::new(&recalled.positions), Ordered::new(&positions)];
        let colors: Option<Vec<[u8; 3]>> = self
            .colors()
            .map(|colors| recalled.neurons.iter().map(|&i| colors[i as usize]).collect());
        let intensities: Option<Vec<f32>> = self
            .intensities()
            .map(|values| recalled.neurons.iter().map(|&i| values[i as usize]).collect());
        let observed = [
            Observed {
                points: &ordered[0],
                colors: colors.as_deref(),
                intensities: intensities.as_deref(),
                facing: Some(recalled.normals),
                weight: old / recalled.positions.len() as f64,
            },
            Observed {
                points: &ordered[1],
                colors: cloud.colors(),
                intensities: cloud.intensities(),
                facing: cloud.facing(),
                weight: 1.0,
            },
        ];
        let n_points = self.n_points().saturating_add(cloud.len() as u64);
        // The origin and the position step stay: neurons that did not move keep their positions.
        let options = GasOptions { position_step: Some(self.position_step()), ..options };
        finish(grown, origin, &observed, n_points, &options, &start, stages)
    }

    /// Number of neurons after an update: the one asked for, or this model's times the number of cubes of two mean
    /// edges' length that hold points of this model or new ones, over the number that hold points of this model.
    fn updated_size(
        &self,
        n_neurons: Option<usize>,
        positions: &[[f32; 3]],
        recalled: &[[f32; 3]],
    ) -> Result<usize> {
        if let Some(n) = n_neurons {
            if n < self.len() || n > MAX_NEURONS {
                return Err(Error::invalid(
                    "n_neurons",
                    n,
                    "at least the number of neurons that the model has, at most 67108864",
                ));
            }
            return Ok(n);
        }
        let lengths = self.edges.iter().map(|&edge| self.edge_length(edge));
        let size = (2.0 * lengths.sum::<f64>() / self.edges.len() as f64).max(self.position_step());
        let cell = |p: &[f32; 3]| wide_cell_of(p.map(f64::from), size);
        let mut cells: HashSet<[i64; 3]> = recalled.iter().map(cell).collect();
        let before = cells.len().max(1) as f64;
        cells.extend(positions.iter().map(cell));
        let n = self.len() as f64 * cells.len() as f64 / before;
        Ok((n.round() as usize).clamp(self.len(), MAX_NEURONS))
    }

    /// About `most` points spread as the input was: for each neuron in proportion to its number of points, at least
    /// one, over its disc and across it.
    fn recall(&self, most: f64) -> Recalled {
        let total: f64 = (0..self.len()).map(|i| self.count(i)).sum();
        let share = (most / total).min(1.0);
        let mut recalled =
            Recalled { positions: Vec::new(), normals: Vec::new(), neurons: Vec::new() };
        for i in (0..self.len()).filter(|&i| self.neurons[i].count > 0) {
            let n = (share * self.count(i)).round().max(1.0);
            let normal = self.normal(i).map(f64::from);
            let [u, v] = tangents(normal);
            let center = self.position(i).map(f64::from);
            let flat = normal != [0.0; 3];
            for k in 0..n as usize {
                let at = k as f64 + 0.5;
                let radius = if flat { self.radius(i) * (at / n).sqrt() } else { 0.0 };
                let (sin, cos) = (at * GOLDEN_ANGLE).sin_cos();
                let depth = across(self.thickness(i), k);
                let p =
                    |c: usize| center[c] + radius * (cos * u[c] + sin * v[c]) + depth * normal[c];
                recalled.positions.push([p(0), p(1), p(2)].map(|c| c as f32));
                recalled.normals.push(self.normal(i));
                recalled.neurons.push(i as u32);
            }
        }
        recalled
    }
}
