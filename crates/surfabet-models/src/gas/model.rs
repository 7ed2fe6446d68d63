//! The model in the integers that a file stores.

use surfabet_entropy::Coder;
use surfabet_geom::octahedral;

use super::adjacency::Adjacency;
use super::coding::{Parts, Streams, code_gas, traversal};
use super::describe::Statistics;
use super::finish::GasReport;
use crate::color::{self, rounded};
use crate::error::{Error, Result};
use crate::report::Beside;
use crate::scalar::ScalarScale;
use crate::size_code::{size_code, size_of_code};

/// Largest coordinate in position steps, so that positions are exact in single precision.
pub const MAX_COORDINATE: i32 = 1 << 23;

/// Bits of each of the two numbers of a normal: within 0.64 degrees.
pub const NORMAL_BITS: u32 = 8;

/// Largest power of two of a position step, and the smallest's negative.
pub const MAX_EXPONENT: i32 = 60;

/// A neuron as it is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Neuron {
    /// Position in steps from the model's origin.
    pub position: [i32; 3],
    /// Octahedral code of the normal, where there is one.
    pub normal: Option<[i8; 2]>,
    /// Code of the number of points nearest to it: none for 0, else `2^((code - 1) / 4)`.
    pub count: u8,
    /// Code of the radius of its disc: zero for 0, else `2^((code - 1) / 4)` eighths of a position step.
    pub radius: u8,
    /// Code of the standard deviation across its disc, as the radius.
    pub thickness: u8,
    /// Luma and two chromas in steps; zero without colour.
    pub color: [i16; 3],
    /// Intensity in steps; zero without.
    pub intensity: i32,
}

/// What the file holds before its streams.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GasHeader {
    /// Points of the clouds that the model was learned from.
    pub n_points: u64,
    /// World position of the model's zero, metres.
    pub origin: [f64; 3],
    /// Position step as a power of two, metres.
    pub exponent: i32,
    /// Rounding of colours, grey levels, where there are colours.
    pub color_step: Option<u32>,
    /// How intensities are stored, where there are any.
    pub intensity: Option<ScalarScale>,
    /// Mean distance of the input points to their nearest neurons, metres.
    pub mean_error: f64,
    /// Number of neurons.
    pub n_neurons: u64,
    /// Number of edges.
    pub n_edges: u64,
}

impl GasHeader {
    /// Checks that all numbers are in their domains.
    fn check(&self) -> Result<()> {
        let fail = |what: String| Err(Error::Inconsistent(what));
        if self.origin.iter().any(|c| !c.is_finite()) {
            return fail(format!("origin {:?} is not finite", self.origin));
        }
        if !(-MAX_EXPONENT..=MAX_EXPONENT).contains(&self.exponent) {
            return fail(format!("a position step of 2^{} m", self.exponent));
        }
        if self.color_step.is_some_and(|step| !(1..=64).contains(&step)) {
            return fail(format!("a colour step of {:?}, not 1 to 64", self.color_step));
        }
        if let Some(Err(what)) = self.intensity.map(|scale| scale.check()) {
            return fail(what);
        }
        if !(self.mean_error.is_finite() && self.mean_error >= 0.0) {
            return fail(format!("a mean error of {} m", self.mean_error));
        }
        if self.n_neurons < 2 || self.n_neurons > super::MAX_NEURONS as u64 {
            return fail(format!("{} neurons, not 2 to {}", self.n_neurons, super::MAX_NEURONS));
        }
        let n = self.n_neurons;
        if self.n_edges < n.div_ceil(2) || self.n_edges > n * (n - 1) / 2 {
            return fail(format!("{} edges between {n} neurons", self.n_edges));
        }
        Ok(())
    }
}

/// A cloud as a gas of neurons with a topology; immutable.
///
/// Neurons are numbered along the topology, breadth first, as in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct GasModel {
    pub(super) header: GasHeader,
    pub(super) neurons: Vec<Neuron>,
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) adjacency: Adjacency,
    report: Beside<GasReport>,
}

impl GasModel {
    /// Puts the learned parts together: `positions` in steps of 2^exponent metres about `origin`.
    pub(super) fn new(
        header: GasHeader,
        positions: &[[i32; 3]],
        edges: &[[u32; 2]],
        statistics: &Statistics,
        report: GasReport,
    ) -> Result<Self> {
        header.check()?;
        let unit = 0.125 * f64::from(header.exponent).exp2();
        let neurons: Vec<Neuron> = positions
            .iter()
            .enumerate()
            .map(|(i, &position)| {
                let normal = statistics.normals[i];
                let code = octahedral::encode(normal, NORMAL_BITS).map(|c| c as i8);
                Neuron {
                    position,
                    normal: (normal != [0.0; 3]).then_some(code),
                    count: size_code(statistics.counts[i]),
                    radius: size_code(statistics.radii[i] / unit),
                    thickness: size_code(statistics.thicknesses[i] / unit),
                    color: match (&statistics.colors, header.color_step) {
                        (Some(colors), Some(step)) => color::code(colors[i].map(f64::from), step),
                        _ => [0; 3],
                    },
                    intensity: match (&statistics.intensities, header.intensity) {
                        (Some(values), Some(scale)) => scale.code(f64::from(values[i])),
                        _ => 0,
                    },
                }
            })
            .collect();
        let (order, place) = traversal(&neurons, &Adjacency::new(neurons.len(), edges));
        let neurons: Vec<Neuron> = order.iter().map(|&i| neurons[i as usize]).collect();
        let mut edges: Vec<[u32; 2]> = edges
            .iter()
            .map(|e| {
                let [a, b] = e.map(|id| place[id as usize]);
                [a.min(b), a.max(b)]
            })
            .collect();
        edges.sort_unstable();
        let adjacency = Adjacency::new(neurons.len(), &edges);
        Ok(Self { header, neurons, edges, adjacency, report: Beside(report) })
    }

    /// What the file holds before its streams.
    pub fn header(&self) -> &GasHeader {
        &self.header
    }

    /// Writes the streams.
    ///
    /// # Errors
    /// Those of the coders.
    pub(super) fn write<C: Coder>(&self, streams: &mut Streams<'_, C>) -> Result<(), C::Error> {
        code_gas(streams, &self.header, Some((&self.neurons, &self.adjacency)))?;
        Ok(())
    }

    /// Reads the streams that [`GasModel::write`] wrote.
    ///
    /// # Errors
    /// Those of the coders, also for a header or content that no model has.
    pub(super) fn read<C: Coder>(
        header: &GasHeader,
        streams: &mut Streams<'_, C>,
    ) -> Result<Self, C::Error> {
        header.check().map_err(|e| streams.topology.corrupt(e.to_string()))?;
        let Parts { neurons, mut edges } = code_gas(streams, header, None)?;
        edges.sort_unstable();
        let adjacency = Adjacency::new(neurons.len(), &edges);
        let report = Beside::default();
        Ok(Self { header: header.clone(), neurons, edges, adjacency, report })
    }

    /// Number of neurons.
    pub fn len(&self) -> usize {
        self.neurons.len()
    }

    /// Never true: a gas has two neurons at least.
    pub fn is_empty(&self) -> bool {
        self.neurons.is_empty()
    }

    /// The neurons as they are stored.
    pub fn neurons(&self) -> &[Neuron] {
        &self.neurons
    }

    /// Pairs of joined neurons, the smaller number first, sorted.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// World position that the model computes about, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.header.origin
    }

    /// Points of the clouds that the model was learned from.
    pub fn n_points(&self) -> u64 {
        self.header.n_points
    }

    /// Mean distance of the input points to their nearest neurons when the model was learned, metres.
    pub fn mean_error(&self) -> f64 {
        self.header.mean_error
    }

    /// Position step, metres.
    pub fn position_step(&self) -> f64 {
        f64::from(self.header.exponent).exp2()
    }

    /// True when the neurons carry colours.
    pub fn has_color(&self) -> bool {
        self.header.color_step.is_some()
    }

    /// Position of a neuron about the model's origin, metres: exact.
    pub fn position(&self, i: usize) -> [f32; 3] {
        let step = self.position_step();
        self.neurons[i].position.map(|c| (f64::from(c) * step) as f32)
    }

    /// Positions of all neurons about the model's origin, metres.
    pub fn positions(&self) -> Vec<[f32; 3]> {
        (0..self.len()).map(|i| self.position(i)).collect()
    }

    /// Unit normal of a neuron; zero where unknown.
    pub fn normal(&self, i: usize) -> [f32; 3] {
        let code = self.neurons[i].normal;
        code.map_or([0.0; 3], |c| octahedral::decode(c.map(i32::from), NORMAL_BITS))
    }

    /// Colour of a neuron, 0..255, before it is rounded; grey without colours.
    pub(super) fn color(&self, i: usize) -> [f32; 3] {
        self.header
            .color_step
            .map_or([127.0; 3], |step| color::of_code(self.neurons[i].color, step))
    }

    /// Colours of all neurons, where they carry any.
    pub fn colors(&self) -> Option<Vec<[u8; 3]>> {
        self.has_color().then(|| (0..self.len()).map(|i| rounded(self.color(i))).collect())
    }

    /// True when the neurons carry intensities.
    pub fn has_intensity(&self) -> bool {
        self.header.intensity.is_some()
    }

    /// Mean intensity of the points of a neuron; 0 without intensities.
    pub(super) fn intensity(&self, i: usize) -> f32 {
        let code = f64::from(self.neurons[i].intensity);
        self.header.intensity.map_or(0.0, |scale| scale.value(code) as f32)
    }

    /// Mean intensities of all neurons, where they carry any.
    pub fn intensities(&self) -> Option<Vec<f32>> {
        self.has_intensity().then(|| (0..self.len()).map(|i| self.intensity(i)).collect())
    }

    /// Number of points nearest to a neuron, rounded to a quarter of a doubling.
    pub fn count(&self, i: usize) -> f64 {
        size_of_code(self.neurons[i].count)
    }

    /// Radius of the disc over which a neuron's points spread, metres.
    pub fn radius(&self, i: usize) -> f64 {
        0.125 * self.position_step() * size_of_code(self.neurons[i].radius)
    }

    /// Standard deviation of a neuron's points across its disc, metres.
    pub fn thickness(&self, i: usize) -> f64 {
        0.125 * self.position_step() * size_of_code(self.neurons[i].thickness)
    }

    pub(super) fn report_mut(&mut self) -> &mut GasReport {
        &mut self.report.0
    }

    /// How the model was learned; empty for a model read from a file.
    pub fn report(&self) -> &GasReport {
        &self.report.0
    }
}
