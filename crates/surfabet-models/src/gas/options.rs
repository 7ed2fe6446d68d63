//! What to learn, checked before anything is computed.

use crate::error::{Error, Result, positive};

/// Most neurons: ids and counts stay well within 32 bits.
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

/// Memory of errors by default, in signals per neuron: the published decay of 0.005 is for networks of 100 neurons.
const BETA_PER_NEURON: f64 = 0.5;

/// Parameters of [`learn`](super::learn), with the paper's symbols; by default those of Fritzke (1995).
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
    /// Share of every error that is forgotten with each signal (beta, 1 - d). `None` takes 0.5 / `n_neurons`: the
    /// published 0.005 for 100 neurons, and the same memory per neuron for more. With 0.005 a network of thousands
    /// remembers the errors of the last few hundred signals only, most neurons having had none of them.
    pub beta: Option<f64>,
    /// Age above which an edge is removed (a_max).
    pub max_age: u32,
    /// Mean distance of signals to their winners, metres, at which the network stops growing before `n_neurons`.
    pub target_error: Option<f64>,
    /// Number of signals as a multiple of the number of points, in place of `patterns` for each of `n_neurons`:
    /// learning ends there, whether or not the network has grown up.
    pub passes: Option<f64>,
    /// Rounding of positions, metres, taken to the next power of two below; a sixteenth of the mean edge if `None`.
    pub position_step: Option<f64>,
    /// Rounding of colours, grey levels (0..255).
    pub color_step: u32,
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
            epsilon_w: 0.2,
            epsilon_n: 0.006,
            alpha: 0.5,
            beta: None,
            max_age: 50,
            target_error: None,
            passes: None,
            position_step: None,
            color_step: 8,
            search: Search::Indexed,
            random_state: 0,
        }
    }
}

impl GasOptions {
    /// The decay in force.
    pub fn beta(&self) -> f64 {
        self.beta.unwrap_or_else(|| (BETA_PER_NEURON / self.n_neurons as f64).min(0.5))
    }

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
        if !(0.0..=0.5).contains(&self.beta()) {
            return Err(Error::invalid("beta", self.beta(), "0 to 0.5"));
        }
        if !(1..=64).contains(&self.color_step) {
            return Err(Error::invalid("color_step", self.color_step, "1 to 64"));
        }
        for (name, value) in
            [("target_error", self.target_error), ("position_step", self.position_step)]
        {
            if let Some(value) = value {
                positive(name, value, "a positive number of metres")?;
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
