//! Growth of a network from signal to signal, until it is large or exact enough.

use surfabet_geom::Progress;

use super::signals::Signals;
use super::{Graph, Network, Rates};
use crate::error::Result;
use crate::gas::constants::{SIGNALS_PER_BATCH, SIGNALS_PER_NEURON_OF_MEAN, TRACE_LENGTH};
use crate::gas::options::{GasOptions, Search};
use crate::gas::winners::{BruteForce, Index, Winners};

/// When learning ends.
#[derive(Debug, Clone, Copy)]
pub(in crate::gas) struct Stop {
    /// Neurons at which growth ends.
    pub n_neurons: usize,
    /// Mean distance of signals to winners at which growth ends, metres.
    pub target_error: Option<f64>,
    /// Signals after which a network of that size is done.
    pub signals: u64,
    /// Signals after which any network is.
    pub at_most: u64,
}

/// A grown network, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::gas) struct Grown {
    pub graph: Graph,
    pub signals: u64,
    /// Mean distance of signals to winners over equal runs of signals, metres.
    pub trace: Vec<f64>,
    pub stop_reason: &'static str,
}

impl From<&GasOptions> for Rates {
    fn from(options: &GasOptions) -> Self {
        Self {
            epsilon_w: options.epsilon_w as f32,
            epsilon_n: options.epsilon_n as f32,
            alpha: options.alpha,
            beta: options.beta(),
            max_age: options.max_age,
        }
    }
}

/// Grows a network from neurons at the positions and with the edges of `start`, with the search that the options name.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(in crate::gas) fn grow(
    start: &Graph,
    signals: Signals<'_>,
    options: &GasOptions,
    stop: Stop,
    progress: &dyn Progress,
) -> Result<Grown> {
    fn with<W: Winners>(
        winners: W,
        start: &Graph,
        signals: Signals<'_>,
        options: &GasOptions,
        stop: Stop,
        progress: &dyn Progress,
    ) -> Result<Grown> {
        // Step 1.
        let mut network = Network::new(winners, options.into(), &start.positions);
        network.join(&start.edges);
        present_signals(network, signals, options.patterns(), stop, progress)
    }
    match options.search {
        Search::Indexed => with(Index::new(), start, signals, options, stop, progress),
        Search::BruteForce => with(BruteForce::default(), start, signals, options, stop, progress),
    }
}

/// Presents signals to `network` until it is done.
fn present_signals<W: Winners>(
    mut network: Network<W>,
    mut signals: Signals<'_>,
    patterns: u32,
    stop: Stop,
    progress: &dyn Progress,
) -> Result<Grown> {
    let mut batch = vec![[0.0; 3]; SIGNALS_PER_BATCH];
    let mut course = Course::new(stop);
    loop {
        progress.check()?;
        progress.update("growing", course.share());
        // Step 2.
        signals.draw(&mut batch);
        for &signal in &batch {
            // Steps 3 to 8.
            let squared_distance = network.present(signal);
            // Step 9.
            if course.add(squared_distance) == patterns {
                course.since_insertion = 0;
                if !course.is_exact && network.len() < stop.n_neurons {
                    network.insert();
                }
            }
            // Step 10.
            network.decay();
            course.measure(network.len());
            if let Some(stop_reason) = course.stop_reason(network.len()) {
                let Course { presented, trace, .. } = course;
                return Ok(Grown {
                    graph: network.graph(),
                    signals: presented,
                    trace,
                    stop_reason,
                });
            }
        }
    }
}

/// How far growth is.
struct Course {
    stop: Stop,
    presented: u64,
    /// Signals since the last insertion.
    since_insertion: u32,
    /// Over the last signals, compared with the target.
    recent: Mean,
    /// Over the signals of the next point of the trace.
    traced: Mean,
    trace: Vec<f64>,
    signals_per_trace: u64,
    /// The mean distance has reached the target.
    is_exact: bool,
}

impl Course {
    fn new(stop: Stop) -> Self {
        Self {
            stop,
            presented: 0,
            since_insertion: 0,
            recent: Mean::default(),
            traced: Mean::default(),
            trace: Vec::new(),
            signals_per_trace: (stop.signals / TRACE_LENGTH).max(1),
            is_exact: false,
        }
    }

    /// Share of the planned signals, for the progress.
    fn share(&self) -> f32 {
        (self.presented as f64 / self.stop.signals as f64).min(1.0) as f32
    }

    /// Counts a signal; gives the number since the last insertion.
    #[inline]
    fn add(&mut self, squared_distance: f32) -> u32 {
        self.presented += 1;
        self.since_insertion += 1;
        self.recent.add(squared_distance);
        self.traced.add(squared_distance);
        if self.traced.count == self.signals_per_trace {
            self.trace.push(self.traced.take());
        }
        self.since_insertion
    }

    /// Compares the mean distance with the target once there are enough signals.
    #[inline]
    fn measure(&mut self, n_neurons: usize) {
        let enough = SIGNALS_PER_NEURON_OF_MEAN * n_neurons as u64;
        if self.recent.count >= enough.max(SIGNALS_PER_BATCH as u64) {
            let mean = self.recent.take();
            self.is_exact |= self.stop.target_error.is_some_and(|target| mean <= target);
        }
    }

    /// Why learning ends now, if it does.
    #[inline]
    fn stop_reason(&self, n_neurons: usize) -> Option<&'static str> {
        let Stop { signals, at_most, .. } = self.stop;
        let is_full = n_neurons >= self.stop.n_neurons;
        let is_done = is_full && self.presented >= signals;
        if !is_done && self.presented < at_most && !(self.is_exact && at_most > signals) {
            return None;
        }
        Some(if self.is_exact {
            "mean distance reached"
        } else if is_full {
            "number of neurons reached"
        } else {
            "number of signals reached"
        })
    }
}

/// Mean distance over a run of signals.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, squared_distance: f32) {
        self.sum += f64::from(squared_distance.sqrt());
        self.count += 1;
    }

    /// The mean so far; starts anew.
    fn take(&mut self) -> f64 {
        let mean = self.sum / self.count as f64;
        *self = Self::default();
        mean
    }
}
