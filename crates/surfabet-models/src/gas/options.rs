//! What to learn.

use super::constants::{BETA_PER_NEURON, PATTERNS, PATTERNS_BEFORE_POLISH, PUBLISHED_BETA};
use crate::options::{Range, choices, options};
use crate::quality::Quality;

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
choices!(Search { Indexed = "indexed", BruteForce = "brute-force" });

options! {
    /// Options of [`learn`](super::learn), with the paper's symbols; defaults are those of Fritzke (1995).
    pub struct GasOptions {
        /// Small files or fine detail. Sets `n_neurons`, unless that is given, to about half as many for 'small' and three times as many for
        /// 'fine'.
        quality: Quality = Quality::Balanced;
        /// Number of neurons at which the network stops growing. More than the points have places are not made.
        n_neurons: Option<usize> = None, range = Range::from_to(2.0, MAX_NEURONS as f64),
            none = "one for each cell that holds points, its side twice the tolerance: two spacings, or three standard deviations of the noise";
        /// The method as printed, without what was added to it: 300 `patterns` and a `beta` of 0.005 where they are not
        /// given, and no `polish`.
        published: bool = false, another_scene = true;
        /// Signals per inserted neuron (lambda, the paper's patterns).
        patterns: Option<u32> = None, range = Range::count_from(1.0),
            none = "20, or 300 where no `polish` follows or growth ends by `target_error`", another_scene = true;
        /// Rounds of k-means over all points after growth (none of the published steps). Each moves every neuron to the mean
        /// of its points, those of the first half also neurons that are hardly needed to where errors are large; then
        /// edges are learned anew. With 0 the network stays as it has grown.
        polish: u32 = 10, range = Range::from_to(0.0, 10_000.0), another_scene = true;
        /// Share of the way to the signal that the winner moves (epsilon_w, also epsilon_b).
        epsilon_w: f64 = 0.2, range = Range::above_to(0.0, 1.0), another_scene = true;
        /// Share of the way to the signal that the winner's neighbours move (epsilon_n).
        epsilon_n: f64 = 0.006, range = Range::from_to(0.0, 1.0), another_scene = true;
        /// Factor of the errors of the two neurons that a new one is put between (alpha).
        alpha: f64 = 0.5, range = Range::between(0.0, 1.0), another_scene = true;
        /// Share of every error that is forgotten with each signal (beta, 1 - d). The published 0.005 is for 100
        /// neurons; with it a network of thousands remembers the errors of the last few hundred signals only, most
        /// neurons having had none of them.
        beta: Option<f64> = None, range = Range::from_to(0.0, 0.5),
            none = "0.5 divided by the number of neurons, the same memory per neuron for any number; 0.005 in the published \
                    method",
            another_scene = true;
        /// Age above which an edge is removed (a_max).
        max_age: u32 = 50, range = Range::from_to(1.0, 1_073_741_824.0), another_scene = true;
        /// Mean distance of signals to their winners at which the network stops growing before it has all its neurons.
        target_error: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "it grows until it has all its neurons", another_scene = true;
        /// Number of signals as a multiple of the number of points. Learning ends there, whether or not the network has
        /// all its neurons.
        passes: Option<f64> = None, range = Range::above_to(0.0, 1e6), none = "`patterns` signals per neuron";
        /// Rounding of positions, taken to the next power of two below.
        position_step: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "a sixteenth of the mean edge";
        /// Rounding of colours.
        color_step: u32 = 8, range = Range::from_to(1.0, 64.0), unit = "grey levels", another_scene = true;
        /// Rounding of the mean intensities of neurons, as a share of their standard deviation.
        attribute_step: f64 = 0.125, range = Range::from_to(0.001, 100.0), unit = "standard deviations",
            another_scene = true;
        /// How winners are found. 'brute-force' gives the same network, slowly.
        search: Search = Search::Indexed, another_scene = true;
        /// Keeps points that are far from all others. Otherwise they are left out, and counted in the report: the network
        /// would put many of its neurons between a few of them and the scene.
        keep_outliers: bool = false, another_scene = true;
        /// Seed of the signals.
        random_state: u64 = 0, range = Range::SEED, another_scene = true;
    }
}

impl GasOptions {
    /// The number of neurons in force. Learning chooses it before anything asks.
    pub fn n_neurons(&self) -> usize {
        self.n_neurons.unwrap_or(2)
    }

    /// Rounds of the polish in force.
    pub fn polish(&self) -> u32 {
        if self.published { 0 } else { self.polish }
    }

    /// The signals per neuron in force.
    pub fn patterns(&self) -> u32 {
        let is_short = self.polish() > 0 && self.target_error.is_none();
        self.patterns.unwrap_or(if is_short { PATTERNS_BEFORE_POLISH } else { PATTERNS })
    }

    /// The decay in force.
    pub fn beta(&self) -> f64 {
        let by_size = || (BETA_PER_NEURON / self.n_neurons() as f64).min(0.5);
        self.beta.unwrap_or_else(|| if self.published { PUBLISHED_BETA } else { by_size() })
    }
}
