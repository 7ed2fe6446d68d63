//! The whole way from a cloud to a gas, and from a gas and another cloud to a larger gas.

use std::collections::HashSet;

use surfabet_geom::cells::wide_cell_of;
use surfabet_geom::{PointCloud, Progress};

use super::adjacency::Adjacency;
use super::describe::statistics::{Observed, describe};
use super::model::{GasHeader, GasModel, MAX_COORDINATE, MAX_EXPONENT};
use super::network::growth::{Grown, Stop, grow};
use super::network::signals::Signals;
use super::network::{Graph, Network};
use super::options::{GasOptions, MAX_NEURONS, Search};
use super::winners::index::{BruteForce, Index, Winners};
use crate::error::{Error, Result};
use crate::options::Options;
use crate::report::{Report, lost};
use crate::vector::distance;

/// Position steps per mean edge, by default: rounding adds a thousandth to the squared error.
const STEPS_PER_EDGE: f64 = 16.0;

/// Signals beyond the plan after which a network that does not reach its size is taken as it is.
const PATIENCE: u64 = 2;

/// Points of an old scan that are recalled for an update, at most.
const MOST_RECALLED: f64 = 2e6;

/// Signals per neuron of a network that has been updated, so that old neurons make room for new ones.
const SETTLING: u64 = 30;

/// What a gas keeps beyond positions.
const KEPT: [&str; 2] = ["colors", "normals"];

/// Learns a gas from a cloud.
///
/// The result depends on cloud and options alone: neither on the search for winners nor on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain, [`Error::EmptyCloud`], [`Error::TooFewPlaces`]
/// when the points are at fewer places than there are to be neurons, [`Error::TooLarge`] when the scene does not
/// fit the position step, [`Error::Cancelled`] when the caller asks to stop.
pub fn learn(
    cloud: &PointCloud,
    options: &GasOptions,
    progress: &dyn Progress,
) -> Result<GasModel> {
    options.check()?;
    let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
    let origin = std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round());
    let positions = cloud.positions_about(origin);
    check_places(&positions, options.n_neurons)?;
    let mut report = Report::default();
    let mut signals = Signals::new(&[(&positions, 1.0)], options.random_state);
    // There are two places at least, as was checked.
    let start = signals.two_places().ok_or(Error::EmptyCloud)?;
    let planned = match options.passes {
        Some(passes) => (passes * positions.len() as f64).ceil() as u64,
        None => options.n_neurons as u64 * u64::from(options.patterns),
    };
    let stop = Stop {
        n_neurons: options.n_neurons,
        target_error: options.target_error,
        signals: planned,
        at_most: if options.passes.is_some() { planned } else { PATIENCE * planned },
    };
    let grown = report.time("growing", || run(&start, &[], signals, options, stop, progress))?;
    let observed = Observed {
        points: &positions,
        colors: cloud.colors(),
        facing: cloud.facing(),
        weight: 1.0,
    };
    report.not_kept = lost(cloud, &KEPT);
    finish(grown, origin, &[observed], cloud.len() as u64, options, report, progress)
}

impl GasModel {
    /// Adds another scan of the same world to the map: a larger gas, which still knows this one's scene.
    ///
    /// Signals are drawn from `cloud` and from what this model recalls of its own scans, points spread over its
    /// discs, in proportion to the numbers of points: so nothing is forgotten where the new scan does not reach,
    /// and both are averaged where it does. `n_neurons` is the number of neurons afterwards; `None` gives the space
    /// that both occupy as many per volume as this model has.
    ///
    /// Of `options`, `n_neurons`, `passes` and `position_step` are not looked at.
    ///
    /// # Errors
    /// As [`learn`]; [`Error::InvalidParameter`] for fewer neurons than there are.
    pub fn update(
        &self,
        cloud: &PointCloud,
        n_neurons: Option<usize>,
        options: &GasOptions,
        progress: &dyn Progress,
    ) -> Result<GasModel> {
        let origin = self.origin();
        let positions = cloud.positions_about(origin);
        let (recalled, normals, of) = self.recall(MOST_RECALLED);
        let n = match n_neurons {
            Some(n) if n < self.len() || n > MAX_NEURONS => {
                return Err(Error::invalid(
                    "n_neurons",
                    n,
                    "at least the number of neurons that the model has, at most 67108864",
                ));
            }
            Some(n) => n,
            None => self.grown_with(&positions, &recalled),
        };
        let options = GasOptions { n_neurons: n, passes: None, ..options.clone() };
        options.check()?;
        if cloud.is_empty() {
            return Err(Error::EmptyCloud);
        }
        let mut report = Report::default();
        let old = self.n_points() as f64;
        let sets = [(&recalled[..], old), (&positions[..], positions.len() as f64)];
        let signals = Signals::new(&sets, options.random_state);
        let planned = (n - self.len()) as u64 * u64::from(options.patterns) + SETTLING * n as u64;
        let stop = Stop {
            n_neurons: n,
            target_error: options.target_error,
            signals: planned,
            at_most: PATIENCE * planned,
        };
        let start = self.positions();
        let grown = report
            .time("growing", || run(&start, &self.edges, signals, &options, stop, progress))?;
        let own = self.colors();
        let colors: Option<Vec<[u8; 3]>> =
            own.map(|colors| of.iter().map(|&i| colors[i as usize]).collect());
        let observed = [
            Observed {
                points: &recalled,
                colors: colors.as_deref(),
                facing: Some(normals),
                weight: old / recalled.len() as f64,
            },
            Observed {
                points: &positions,
                colors: cloud.colors(),
                facing: cloud.facing(),
                weight: 1.0,
            },
        ];
        report.not_kept = lost(cloud, &KEPT);
        let n_points = self.n_points().saturating_add(cloud.len() as u64);
        // The origin stays, and so do the steps: positions of neurons that nothing pulled stay as they are.
        let options = GasOptions { position_step: Some(self.position_step()), ..options };
        finish(grown, origin, &observed, n_points, &options, report, progress)
    }

    /// Neurons for this model's space together with that of `positions`, as many per occupied cube of two edges'
    /// length as now.
    fn grown_with(&self, positions: &[[f32; 3]], recalled: &[[f32; 3]]) -> usize {
        let lengths = self
            .edges
            .iter()
            .map(|&[a, b]| [a, b].map(|i| self.position(i as usize).map(f64::from)))
            .map(|[p, q]| distance(p, q));
        let size = (2.0 * lengths.sum::<f64>() / self.edges.len() as f64).max(self.position_step());
        let cell = |p: &[f32; 3]| wide_cell_of(p.map(f64::from), size);
        let mut cells: HashSet<[i64; 3]> = recalled.iter().map(cell).collect();
        let before = cells.len().max(1) as f64;
        cells.extend(positions.iter().map(cell));
        let n = self.len() as f64 * cells.len() as f64 / before;
        (n.round() as usize).clamp(self.len(), MAX_NEURONS)
    }
}

/// Refuses more neurons than points have places.
fn check_places(positions: &[[f32; 3]], neurons: usize) -> Result<()> {
    let mut places = HashSet::new();
    for p in positions {
        // Zero is one place, whatever its sign.
        places.insert(p.map(|c| (c + 0.0).to_bits()));
        if places.len() >= neurons {
            return Ok(());
        }
    }
    Err(Error::TooFewPlaces { neurons, places: places.len() })
}

fn run(
    start: &[[f32; 3]],
    edges: &[[u32; 2]],
    signals: Signals<'_>,
    options: &GasOptions,
    stop: Stop,
    progress: &dyn Progress,
) -> Result<Grown> {
    fn with<W: Winners>(
        winners: W,
        start: &[[f32; 3]],
        edges: &[[u32; 2]],
        signals: Signals<'_>,
        options: &GasOptions,
        stop: Stop,
        progress: &dyn Progress,
    ) -> Result<Grown> {
        let mut network = Network::new(winners, options.into(), start);
        network.join(edges);
        grow(network, signals, options.patterns, stop, progress)
    }
    match options.search {
        Search::Indexed => with(Index::new(), start, edges, signals, options, stop, progress),
        Search::BruteForce => {
            with(BruteForce::default(), start, edges, signals, options, stop, progress)
        }
    }
}

/// Rounds a grown network and describes its neurons.
fn finish(
    grown: Grown,
    origin: [f64; 3],
    observed: &[Observed<'_>],
    n_points: u64,
    options: &GasOptions,
    mut report: Report,
    progress: &dyn Progress,
) -> Result<GasModel> {
    progress.update("describing neurons", 0.0);
    let Graph { positions, edges } = grown.graph;
    let exponent = exponent(&positions, &edges, options)?;
    let step = f64::from(exponent).exp2();
    let rounded: Vec<[i32; 3]> =
        positions.iter().map(|p| p.map(|c| (f64::from(c) / step).round() as i32)).collect();
    let exact: Vec<[f32; 3]> =
        rounded.iter().map(|p| p.map(|c| (f64::from(c) * step) as f32)).collect();
    let adjacency = Adjacency::new(exact.len(), &edges);
    let statistics =
        report.time("describing neurons", || describe(&exact, &adjacency, observed, progress))?;
    report.figures.extend([
        ("points", n_points as f64),
        ("signals", grown.signals as f64),
        ("neurons", exact.len() as f64),
        ("edges", edges.len() as f64),
        ("mean error", statistics.mean_distance),
    ]);
    report.iterations = grown.signals as usize;
    report.objectives.push(("mean distance of signals".into(), grown.trace));
    report.stop_reason = grown.stop_reason;
    let header = GasHeader {
        n_points,
        origin,
        exponent,
        color_step: statistics.colors.is_some().then_some(options.color_step),
        mean_error: statistics.mean_distance,
        n_neurons: exact.len() as u64,
        n_edges: edges.len() as u64,
    };
    GasModel::new(header, &rounded, &edges, &statistics, report)
}

/// The position step as a power of two.
fn exponent(positions: &[[f32; 3]], edges: &[[u32; 2]], options: &GasOptions) -> Result<i32> {
    let extent = positions.iter().flatten().fold(0.0_f32, |m, c| m.max(c.abs()));
    let lengths = edges.iter().map(|e| {
        let [p, q] = e.map(|i| positions[i as usize].map(f64::from));
        distance(p, q)
    });
    let mean = lengths.sum::<f64>() / edges.len() as f64;
    let step = options.position_step.unwrap_or(mean / STEPS_PER_EDGE);
    // Neurons all at one place have no length to go by.
    let wanted = if step > 0.0 { step.log2().floor() } else { -f64::from(MAX_EXPONENT) };
    let limit = f64::from(MAX_EXPONENT);
    let mut exponent = wanted.clamp(-limit, limit) as i32;
    let fits = |exponent: i32| {
        f64::from(extent) <= f64::from(exponent).exp2() * (f64::from(MAX_COORDINATE) - 1.0)
    };
    if options.position_step.is_none() {
        // Nothing was asked for: as fine as positions can be.
        while !fits(exponent) && exponent < MAX_EXPONENT {
            exponent += 1;
        }
    }
    if !fits(exponent) {
        let step = f64::from(exponent).exp2();
        return Err(Error::TooLarge {
            extent: f64::from(extent),
            limit: step * f64::from(MAX_COORDINATE),
            resolution: step,
        });
    }
    Ok(exponent)
}
