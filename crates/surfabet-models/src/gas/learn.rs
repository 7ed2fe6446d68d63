//! Learning a gas from a cloud.

use std::collections::HashSet;

use surfabet_geom::cells::wide_cell_of;
use surfabet_geom::{PointCloud, Progress};

use super::constants::PATIENCE;
use super::describe::Observed;
use super::finish::finish;
use super::model::GasModel;
use super::network::{Graph, Signals, Stop, grow};
use super::options::GasOptions;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::report::{Report, lost};
<<<<<<< HEAD
use crate::vector::distance;
=======
use crate::stages::Stages;
>>>>>>> core

/// The stages and their shares of the progress: the time of each in per cent, on a Kinect frame.
pub(super) const STAGES: &[(&str, f32)] = &[("growing", 90.0), ("describing neurons", 10.0)];

/// What a gas keeps beyond positions.
pub(super) const KEPT: [&str; 2] = ["colors", "normals"];

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
    // Positions about the middle of the cloud.
    let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
    let origin = std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round());
    let positions = cloud.positions_about(origin);
    check_places(&positions, options.n_neurons)?;
    // Steps 1 to 10 for one signal after the other.
    let mut signals = Signals::new(&[(&positions, 1.0)], options.random_state);
    let first = signals.two_places().ok_or(Error::EmptyCloud)?;
    let start = Graph { positions: first.to_vec(), edges: Vec::new() };
    let mut stages = Stages::new(STAGES, progress);
    let grown = stages.run("growing", |progress| {
        grow(&start, signals, options, stop(options, positions.len()), progress)
    })?;
    // Colours, normals and sizes of the neurons, and everything rounded.
    let observed = Observed {
        points: &positions,
        colors: cloud.colors(),
        facing: cloud.facing(),
        weight: 1.0,
    };
    let report = Report { not_kept: lost(cloud, &KEPT), ..Report::default() };
    finish(grown, origin, &[observed], cloud.len() as u64, options, report, stages)
}

/// When learning from `n_points` ends.
fn stop(options: &GasOptions, n_points: usize) -> Stop {
    let planned = match options.passes {
        Some(passes) => (passes * n_points as f64).ceil() as u64,
        None => options.n_neurons as u64 * u64::from(options.patterns),
    };
    Stop {
        n_neurons: options.n_neurons,
        target_error: options.target_error,
        signals: planned,
        at_most: if options.passes.is_some() { planned } else { PATIENCE * planned },
    }
<<<<<<< HEAD

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
=======
>>>>>>> core
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
<<<<<<< HEAD

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
=======
>>>>>>> core
