//! From a grown network to a model: positions rounded, neurons described.

use super::adjacency::Adjacency;
use super::constants::STEPS_PER_EDGE;
use super::describe::{Known, Observed, describe};
use super::distance;
use super::learn::KEPT;
use super::model::{GasHeader, GasModel, MAX_COORDINATE, MAX_EXPONENT};
use super::network::{Graph, Grown};
use super::options::GasOptions;
use super::ordered::Ordered;
use super::polish::polish;
use crate::attribute_error::measured;
use crate::contract::{DecodeOptions, SurfaceModel};
use crate::error::Result;
use crate::extent::too_small;
use crate::report::{AttributeFigures, Report, figures, lost};
use crate::scalar::ScalarScale;
use crate::stages::Stages;
use crate::start::Start;

/// The report of learning and of updating.
pub type GasReport = Report<Option<GasFigures>>;

figures! {
    /// What learning and updating count and measure.
    pub struct GasFigures {
        /// Points of all clouds.
        pub points: u64 = "points",
        /// Signals that were drawn.
        pub signals: u64 = "signals",
        /// Neurons of the model.
        pub neurons: usize = "neurons",
        /// Edges of the model.
        pub edges: usize = "edges",
        /// Mean distance of the points to the nearest neuron, metres.
        pub mean_error: f64 = "mean error",
    }
}

/// Polishes a grown network by the points of `observed`, rounds its positions, and describes its neurons, as the last of
/// `stages`.
pub(super) fn finish(
    grown: Grown,
    origin: [f64; 3],
    observed: &[Observed<'_>],
    n_points: u64,
    options: &GasOptions,
    start: &Start<'_>,
    mut stages: Stages<'_>,
) -> Result<GasModel> {
    let mut trace = Vec::new();
    let mut graph = grown.graph;
    let mut known = None;
    if options.polish() > 0 {
        let sets: Vec<(&Ordered, f64)> = observed.iter().map(|of| (of.points, of.weight)).collect();
        let polished = stages.run("polishing", |progress| {
            polish(graph.positions, &sets, options.polish(), options.max_age, progress)
        })?;
        known = Some((polished.nearby, polished.winners));
        (graph, trace) = (polished.graph, polished.trace);
    }
    let Graph { positions: exact, edges } = graph;
    let exponent = step_exponent(&exact, &edges, options)?;
    let (rounded, positions) = rounded(&exact, exponent);
    let adjacency = Adjacency::new(positions.len(), &edges);
    let statistics = stages.run("describing neurons", |progress| {
        let moved = largest_move(&exact, &positions);
        let known = known.map(|(nearby, winners)| Known { nearby, winners, moved });
        describe(&positions, &adjacency, observed, known, progress)
    })?;
    let intensities = statistics.intensities.as_ref().map(|values| {
        let values = values.iter().map(|&v| f64::from(v));
        ScalarScale::of("intensities", values, options.attribute_step)
    });
    let figures = GasFigures {
        points: n_points,
        signals: grown.signals,
        neurons: positions.len(),
        edges: edges.len(),
        mean_error: statistics.mean_distance,
    };
    let mut report = GasReport {
        figures: Some(figures),
        objectives: objectives(grown.trace, trace),
        iterations: grown.signals as usize,
        stop_reason: grown.stop_reason,
        not_kept: lost(&start.cloud, &KEPT),
        ..GasReport::default()
    };
    start.report(start.survey.tolerance(), &mut report);
    let header = GasHeader {
        n_points,
        origin,
        exponent,
        color_step: statistics.colors.is_some().then_some(options.color_step),
        intensity: intensities.transpose()?,
        mean_error: statistics.mean_distance,
        n_neurons: positions.len() as u64,
        n_edges: edges.len() as u64,
    };
    let mut model = GasModel::new(header, &rounded, &edges, &statistics, report)?;
    let present = [model.has_color(), model.has_intensity()];
    let attributes = AttributeFigures::of_last_streams(&model.price(), present);
    let options = DecodeOptions::default();
    let attributes = measured(&model, attributes, options, &start.cloud, &mut stages)?;
    let report = model.report_mut();
    (report.attributes, report.stages) = (attributes, stages.finish());
    Ok(model)
}

/// The largest distance of two positions that follow each other, metres.
fn largest_move(before: &[[f32; 3]], after: &[[f32; 3]]) -> f32 {
    before.iter().zip(after).map(|(p, q)| distance(*p, *q) as f32).fold(0.0, f32::max)
}

/// Positions in steps of `2^exponent`, and as they are decoded.
fn rounded(positions: &[[f32; 3]], exponent: i32) -> (Vec<[i32; 3]>, Vec<[f32; 3]>) {
    let step = f64::from(exponent).exp2();
    let rounded: Vec<[i32; 3]> =
        positions.iter().map(|p| p.map(|c| (f64::from(c) / step).round() as i32)).collect();
    let decoded = rounded.iter().map(|p| p.map(|c| (f64::from(c) * step) as f32)).collect();
    (rounded, decoded)
}

/// The mean distances while the network grew and while it was polished, for the report; a part that did not run has none.
fn objectives(growing: Vec<f64>, polishing: Vec<f64>) -> Vec<(String, Vec<f64>)> {
    [("mean distance of signals", growing), ("mean distance in the polish", polishing)]
        .into_iter()
        .filter(|(_, values)| !values.is_empty())
        .map(|(name, values)| (name.into(), values))
        .collect()
}

/// The position step as a power of two: the largest that is no larger than `position_step`, or, without one, no larger
/// than the mean edge over [`STEPS_PER_EDGE`] but large enough for all positions to fit.
fn step_exponent(positions: &[[f32; 3]], edges: &[[u32; 2]], options: &GasOptions) -> Result<i32> {
    let extent = positions.iter().flatten().fold(0.0_f32, |m, c| m.max(c.abs()));
    let lengths = edges.iter().map(|e| {
        let [p, q] = e.map(|i| positions[i as usize]);
        distance(p, q)
    });
    let mean = lengths.sum::<f64>() / edges.len() as f64;
    let step = options.position_step.unwrap_or(mean / STEPS_PER_EDGE);
    // Neurons all at one place have edges of no length.
    let wanted = if step > 0.0 { step.log2().floor() } else { -f64::from(MAX_EXPONENT) };
    let limit = f64::from(MAX_EXPONENT);
    let mut exponent = wanted.clamp(-limit, limit) as i32;
    let fits = |exponent: i32| {
        f64::from(extent) <= f64::from(exponent).exp2() * (f64::from(MAX_COORDINATE) - 1.0)
    };
    if options.position_step.is_none() {
        while !fits(exponent) && exponent < MAX_EXPONENT {
            exponent += 1;
        }
    }
    if !fits(exponent) {
        let extent = f64::from(extent);
        // A step is rounded down to a power of two.
        let least = (extent / (f64::from(MAX_COORDINATE) - 1.0)).log2().ceil().exp2();
        return Err(too_small("position_step", step, least, extent));
    }
    Ok(exponent)
}
