//! Learning a gas from a cloud.

use surfabet_base::parallel;
use surfabet_geom::cells::cell_of;
use surfabet_geom::{PointCloud, Progress};

use super::constants::{CELL_TOLERANCES, MOST_CHOSEN, PATIENCE};
use super::describe::Observed;
use super::finish::finish;
use super::model::GasModel;
use super::network::{Graph, Signals, Stop, grow};
use super::options::{GasOptions, MAX_NEURONS};
use super::ordered::Ordered;
use crate::error::{Error, Result};
use crate::options::Options;
use crate::quality::Quality;
use crate::stages::Stages;
use crate::start::{Leave, Start, significant};

/// The stages and their shares of the progress: the time of each in per cent, on a Kinect frame.
pub(super) const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 5.0),
    ("growing", 40.0),
    ("polishing", 35.0),
    ("describing neurons", 15.0),
    ("measuring attributes", 5.0),
];

/// What a gas keeps beyond positions.
pub(super) const KEPT: [&str; 3] = ["colors", "intensities", "normals"];

/// Learns a gas from a cloud.
///
/// The result depends on cloud and options alone: neither on the search for winners nor on the number of threads.
///
/// # Errors
/// [`Error::InvalidParameter`] for options outside their domain and a position step too small for the scene,
/// [`Error::EmptyCloud`], [`Error::TooFewPlaces`] when all points are at one place, [`Error::Cancelled`] when the caller asks to stop.
pub fn learn(
    cloud: &PointCloud,
    options: &GasOptions,
    progress: &dyn Progress,
) -> Result<GasModel> {
    options.check()?;
    let mut stages = Stages::new(STAGES, progress);
    // Options that are not given follow from the data.
    let (quality, keep) = (options.quality, options.keep_outliers);
    let mut start = Start::of(cloud, quality, Leave::Outliers, keep, &mut stages)?;
    let options = &chosen_size(&mut start, options)?;
    let cloud: &PointCloud = &start.cloud;
    // Positions about the middle of the cloud.
    let (low, high) = cloud.bounds().ok_or(Error::EmptyCloud)?;
    let origin = std::array::from_fn(|a| (0.5 * (low[a] + high[a])).round());
    let positions = cloud.positions_about(origin);
    // Steps 1 to 10 for one signal after the other.
    let mut signals = Signals::new(&[(&positions, 1.0)], options.random_state);
    let first = signals.two_places().ok_or(Error::EmptyCloud)?;
    let pair = Graph { positions: first.to_vec(), edges: Vec::new() };
    let stop = stop(options, positions.len());
    // Meanwhile another thread orders the points.
    let (grown, ordered) = stages.run("growing", |progress| {
        let (grown, ordered) = rayon::join(
            || grow(&pair, signals, options, stop, progress),
            || Ordered::new(&positions),
        );
        Ok((grown?, ordered))
    })?;
    // The polish; colours, intensities, normals and sizes of the neurons, and everything rounded.
    let observed = Observed {
        points: &ordered,
        colors: cloud.colors(),
        intensities: cloud.intensities(),
        facing: cloud.facing(),
        weight: 1.0,
    };
    finish(grown, origin, &[observed], cloud.len() as u64, options, &start, stages)
}

/// When learning from `n_points` ends.
fn stop(options: &GasOptions, n_points: usize) -> Stop {
    let planned = match options.passes {
        Some(passes) => (passes * n_points as f64).ceil() as u64,
        None => options.n_neurons() as u64 * u64::from(options.patterns()),
    };
    Stop {
        n_neurons: options.n_neurons(),
        target_error: options.target_error,
        signals: planned,
        at_most: if options.passes.is_some() { planned } else { PATIENCE * planned },
    }
}

/// The options with the number of neurons in force: the one that was given, or one for each cell that holds points; in
/// both cases at most one for each place.
fn chosen_size(start: &mut Start<'_>, options: &GasOptions) -> Result<GasOptions> {
    let positions = start.cloud.positions();
    // Zero is one place, whatever its sign.
    let place = |i: usize| positions[i].map(|c| (c + 0.0).to_bits());
    // Of a number of neurons that is given only whether there are as many places matters, and the first points show that.
    let enough = options.n_neurons.unwrap_or(MAX_NEURONS).max(2);
    let mut looked_at = (enough.saturating_mul(2)).min(positions.len());
    let mut places = count_distinct(looked_at, place);
    while places < enough && looked_at < positions.len() {
        looked_at = (4 * looked_at).min(positions.len());
        places = count_distinct(looked_at, place);
    }
    if places < 2 {
        return Err(Error::TooFewPlaces { neurons: options.n_neurons.unwrap_or(2), places });
    }
    let tolerances = match options.quality {
        Quality::Small => CELL_TOLERANCES[0],
        Quality::Balanced => CELL_TOLERANCES[1],
        Quality::Fine => CELL_TOLERANCES[2],
    };
    let side = tolerances * start.survey.tolerance();
    let wanted = options.n_neurons.unwrap_or_else(|| {
        let cells = count_distinct(positions.len(), |i| {
            cell_of(positions[i], side as f32).map(|c| c as u32)
        });
        cells.min(MOST_CHOSEN)
    });
    let n_neurons = wanted.clamp(2, places.min(MAX_NEURONS));
    if options.n_neurons != Some(n_neurons) {
        let reason = if n_neurons == places {
            format!("the points are at {places} places")
        } else if n_neurons == MOST_CHOSEN {
            format!("more cells of {} m hold points", significant(side))
        } else {
            format!("as many cells of {} m hold points", significant(side))
        };
        start.note("n_neurons", n_neurons as f64, reason);
    }
    Ok(GasOptions { n_neurons: Some(n_neurons), ..options.clone() })
}

/// Number of different keys of `count` items.
fn count_distinct(count: usize, key: impl Fn(usize) -> [u32; 3] + Sync) -> usize {
    let joined = |i: usize| key(i).into_iter().fold(0, |all, k| all << 32 | u128::from(k));
    let mut keys: Vec<u128> = parallel::map_range(count, joined);
    parallel::sort_wide_keys(&mut keys);
    keys.dedup();
    keys.len()
}
