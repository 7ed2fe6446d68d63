//! Learning a gas from a cloud.

use std::collections::HashSet;

use surfabet_geom::{PointCloud, Progress};

use super::constants::PATIENCE;
use super::describe::Observed;
use super::finish::finish;
use super::model::GasModel;
use super::network::{Graph, Signals, Stop, grow};
use super::options::GasOptions;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::report::lost;
use crate::stages::Stages;

/// The stages and their shares of the progress: the time of each in per cent, on a Kinect frame.
pub(super) const STAGES: &[(&str, f32)] = &[("growing", 90.0), ("describing neurons", 10.0)];

/// What a gas keeps beyond positions.
pub(super) const KEPT: [&str; 3] = ["colors", "intensities", "normals"];

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
    // Colours, intensities, normals and sizes of the neurons, and everything rounded.
    let observed = Observed {
        points: &positions,
        colors: cloud.colors(),
        intensities: cloud.intensities(),
        facing: cloud.facing(),
        weight: 1.0,
    };
    finish(grown, origin, &[observed], cloud.len() as u64, options, lost(cloud, &KEPT), stages)
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
