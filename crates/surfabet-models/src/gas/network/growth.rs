//! Growth of a network from signal to signal, until there is enough of it.

use surfabet_geom::Progress;

use crate::error::Result;
use crate::gas::network::signals::Signals;
use crate::gas::network::{Graph, Network, Rates};
use crate::gas::options::GasOptions;
use crate::gas::winners::index::Winners;

/// Signals drawn at once: some milliseconds of work.
const BATCH: usize = 4096;

/// Points of the trace of mean distances.
const TRACE: u64 = 64;

/// When learning ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stop {
    /// Neurons at which growth ends.
    pub n_neurons: usize,
    /// Mean distance of signals to winners at which growth ends.
    pub target_error: Option<f64>,
    /// Signals after which a grown network is done.
    pub signals: u64,
    /// Signals after which any network is.
    pub at_most: u64,
}

/// A grown network, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grown {
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

/// Sums distances over a run of signals.
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

    fn take(&mut self) -> f64 {
        let mean = self.sum / self.count as f64;
        *self = Self::default();
        mean
    }
}

/// Presents signals to `network` until it is done.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(crate) fn grow<W: Winners>(
    mut network: Network<W>,
    mut signals: Signals<'_>,
    patterns: u32,
    stop: Stop,
    progress: &dyn Progress,
) -> Result<Grown> {
    let mut batch = vec![[0.0; 3]; BATCH];
    let (mut presented, mut since) = (0_u64, 0);
    let (mut now, mut traced, mut trace) = (Mean::default(), Mean::default(), Vec::new());
    let per_trace = (stop.signals / TRACE).max(1);
    let mut good_enough = false;
    loop {
        progress.check()?;
        progress.update("growing", (presented as f64 / stop.signals as f64).min(1.0) as f32);
        signals.draw(&mut batch);
        for &signal in &batch {
            let squared_distance = network.present(signal);
            presented += 1;
            since += 1;
            now.add(squared_distance);
            traced.add(squared_distance);
            if traced.count == per_trace {
                trace.push(traced.take());
            }
            if since == patterns {
                since = 0;
                if !good_enough && network.len() < stop.n_neurons {
                    network.insert();
                }
            }
            network.decay();
            // Over so many signals that the network has hardly grown on the way, yet most neurons have won.
            if now.count >= (2 * network.len() as u64).max(BATCH as u64) {
                let mean = now.take();
                good_enough |= stop.target_error.is_some_and(|target| mean <= target);
            }
            let full = network.len() >= stop.n_neurons;
            let done = full && presented >= stop.signals;
            if done || presented >= stop.at_most || (good_enough && stop.at_most > stop.signals) {
                let stop_reason = if good_enough {
                    "mean distance reached"
                } else if full {
                    "number of neurons reached"
                } else {
                    "number of signals reached"
                };
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
