//! What to learn, checked before anything is computed.

use crate::error::{Error, Result};

/// Largest seed-independent bound of the network: ids and counts stay well within 32 bits.
pub const MAX_NEURONS: usize = 1 << 26;

/// How the winner and the second winner of a signal are found. Both give the same network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Search {
    /// A k-d tree of small leaves that follows the neurons.
    #[default]
    Indexed,
    /// The distances to all neurons, vectorised: to compare with.
    BruteForce,
}

/// Parameters of [`learn`](super::learn), with the paper's symbols. Rates and ages are by default those of B.
/// Fritzke's later report and demonstration (*Some Competitive Learning Methods*, 1997), with which neurons jitter
/// less than with those of 1995 (0.2, 0.006, 50 and a decay of 0.005).
#[derive(Debug, Clone, PartialEq)]
pub struct GasOptions {
    /// Number of neurons at which the network stops growing.
    pub n_neurons: usize,
    /// Signals per inserted neuron (lambda, the paper's patterns).
    pub patterns: u32,
    /// Share of the way to the signal that the winner moves (epsilon_w, also epsilon_b).
    pub epsilon_w: f64,
    /// Share of the way to the signal that the winner's neighbours move (epsilon_n).
    pub epsilon_n: f64,
    /// Factor of the errors of the two neurons that a new one is put between (alpha).
    pub alpha: f64,
    /// Share of every error that is forgotten with each signal (beta, 1 - d).
    pub beta: f64,
    /// Age above which an edge is removed (a_max).
    pub max_age: u32,
    /// Mean distance of signals to their winners, metres, at which the network stops growing before `n_neurons`.
    pub target_error: Option<f64>,
    /// Number of signals as a multiple of the number of points, in place of `patterns` for each of `n_neurons`:
    /// learning ends there, whether or not the network has grown up.
    pub passes: Option<f64>,
    /// Rounding of positions, metres, taken to the next power of two below; a sixteenth of the mean edge if `None`.
    pub position_step: Option<f64>,
    /// How winners are found.
    pub search: Search,
    /// Seed of the signals.
    pub random_state: u64,
}

impl Default for GasOptions {
    fn default() -> Self {
        Self {
            n_neurons: 10_000,
            patterns: 300,
            epsilon_w: 0.05,
            epsilon_n: 0.0006,
            alpha: 0.5,
            beta: 0.0005,
            max_age: 88,
            target_error: None,
            passes: None,
            position_step: None,
            search: Search::Indexed,
            random_state: 0,
        }
    }
}

impl GasOptions {
    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        if !(2..=MAX_NEURONS).contains(&self.n_neurons) {
            return Err(Error::invalid("n_neurons", self.n_neurons, "2 to 67108864"));
        }
        if self.patterns == 0 {
            return Err(Error::invalid("patterns", self.patterns, "at least 1"));
        }
        if self.max_age == 0 || self.max_age > 1 << 30 {
            return Err(Error::invalid("max_age", self.max_age, "1 to 1073741824"));
        }
        let open = |v: f64| v > 0.0 && v < 1.0;
        if !(self.epsilon_w > 0.0 && self.epsilon_w <= 1.0) {
            return Err(Error::invalid("epsilon_w", self.epsilon_w, "above 0, at most 1"));
        }
        if !(0.0..=1.0).contains(&self.epsilon_n) {
            return Err(Error::invalid("epsilon_n", self.epsilon_n, "0 to 1"));
        }
        if !open(self.alpha) {
            return Err(Error::invalid("alpha", self.alpha, "between 0 and 1"));
        }
        if !(0.0..=0.5).contains(&self.beta) {
            return Err(Error::invalid("beta", self.beta, "0 to 0.5"));
        }
        for (name, value) in
            [("target_error", self.target_error), ("position_step", self.position_step)]
        {
            if let Some(value) = value
                && !(value > 0.0 && value.is_finite())
            {
                return Err(Error::invalid(name, value, "a positive number of metres"));
            }
        }
        if let Some(passes) = self.passes
            && !(passes > 0.0 && passes <= 1e6)
        {
            return Err(Error::invalid("passes", passes, "above 0, at most 1000000"));
        }
        Ok(())
    }
}
