//! Raw samples of a model's occurrences.

use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_models::alphabet::{AlphabetModel, Occurrence};
use surfabet_models::alphabet::{PIXELS, Word};
use surfabet_models::{Error, Result};

use crate::constants::{MAX_SAMPLES, RAW_SPACING};

/// A sample of one occurrence.
#[derive(Clone, Copy)]
pub(super) struct RawSample {
    /// The cube that the sample is in, and the axis that its normal is nearest to.
    pub cube: ([i32; 3], u8),
    /// Metres from the corner of the lattice.
    pub point: [f64; 3],
    pub normal: [f64; 3],
    pub occurrence: u32,
}

impl RawSample {
    fn new(point: [f64; 3], normal: [f64; 3], occurrence: u32, spacing: f64) -> Self {
        let cube = point.map(|c| (c / spacing).floor() as i32);
        let axis = (0..3).fold(0, |m, a| if normal[a].abs() > normal[m].abs() { a } else { m });
        Self { cube: (cube, axis as u8), point, normal, occurrence }
    }
}

/// How many raw samples occurrences have at most, before any is taken.
pub(super) fn most_samples(occurrences: &[Occurrence], spacing: f64) -> f64 {
    occurrences.iter().map(|o| per_side(o.radius, spacing).powi(2)).sum()
}

fn per_side(radius: f64, spacing: f64) -> f64 {
    (2.0 * radius / (RAW_SPACING * spacing)).ceil().max(1.0)
}

/// Samples of all occurrences on grids a little finer than `spacing`.
///
/// # Errors
/// [`surfabet_models::Error::TooManyPoints`], [`surfabet_models::Error::Cancelled`].
pub(super) fn raw_samples(
    model: &AlphabetModel,
    occurrences: &[Occurrence],
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Vec<RawSample>> {
    let most = most_samples(occurrences, spacing);
    if most > MAX_SAMPLES as f64 {
        let (points, limit) = (most as u64, MAX_SAMPLES);
        return Err(Error::TooManyPoints { resolution: spacing, points, limit });
    }
    let origin = model.header().origin;
    let samples = parallel::try_map_range(occurrences.len(), |k| -> Result<Vec<RawSample>> {
        let o = &occurrences[k];
        progress.check()?;
        let word = &model.alphabet().words()[usize::from(o.word)];
        let n = per_side(o.radius, spacing) as u64;
        let at = |i: u64| (2 * i + 1) as f64 / n as f64 - 1.0;
        // Component `a` in the world of a vector in the frame of the word.
        let along = |v: [f64; 3], a: usize| (0..3).map(|k| o.rows[k][a] * v[k]).sum::<f64>();
        let mut samples = Vec::new();
        for i in 0..n * n {
            let [right, up] = [at(i % n), at(i / n)];
            let Some(height) = word.height(right, up) else { continue };
            let local = [right, up, height].map(|c| c * o.radius);
            let point = std::array::from_fn(|a| o.center[a] - origin[a] + along(local, a));
            let [x, y] = slopes(word, right, up);
            let length = (x * x + y * y + 1.0).sqrt();
            let normal = std::array::from_fn(|a| along([-x, -y, 1.0], a) / length);
            samples.push(RawSample::new(point, normal, k as u32, spacing));
        }
        Ok(samples)
    })?;
    Ok(samples.concat())
}

/// Slopes of a word's height to the right and up: differences over one pixel, or less at the rim; 0 beside a hole.
fn slopes(word: &Word, right: f64, up: f64) -> [f64; 2] {
    if word.is_flat() {
        return [0.0; 2];
    }
    let pixel = 2.0 / PIXELS as f64;
    let slope = |dx: f64, dy: f64| {
        let ahead = word.height((right + dx).min(1.0), (up + dy).min(1.0));
        let behind = word.height((right - dx).max(-1.0), (up - dy).max(-1.0));
        let run = ((right + dx).min(1.0) - (right - dx).max(-1.0))
            + ((up + dy).min(1.0) - (up - dy).max(-1.0));
        match (ahead, behind) {
            (Some(a), Some(b)) => (a - b) / run,
            _ => 0.0,
        }
    };
    [slope(0.5 * pixel, 0.0), slope(0.0, 0.5 * pixel)]
}
