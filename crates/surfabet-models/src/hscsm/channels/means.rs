//! Means of each patch and channel, and learning from what remains without them.
//!
//! Means are rounded before they are removed, so that their rounding costs no accuracy: what it leaves is coded with the
//! rest.

use rayon::prelude::*;
use surfabet_geom::Progress;

use super::dictionary::{
    ChannelOptions, ChannelSignals, Coded, Learning, LevelDictionary, learn_channel,
};
use super::images::Images;
use crate::color::{to_rgb, to_ycocg};
use crate::error::Result;
use crate::hscsm::model::{Channel, Steps};
use crate::hscsm::options::HscsmOptions;

/// What is learned of the channels of a level.
#[derive(Clone, Copy)]
pub(in crate::hscsm) struct LevelTask<'a> {
    pub options: &'a HscsmOptions,
    pub level: u32,
    /// Pixels of a patch.
    pub area: usize,
    pub steps: Steps,
    /// The dictionaries to code in; `None`: learn them.
    pub frozen: Option<&'a LevelDictionary>,
}

/// Means, dictionary and codes of depth.
pub(in crate::hscsm) fn learn_depth(
    images: &Images,
    level: &LevelTask<'_>,
    progress: &dyn Progress,
) -> Result<(Channel, Option<Learning>)> {
    let LevelTask { options, area, steps, frozen, .. } = *level;
    let weights: Vec<f32> = images.mask.iter().map(|&m| f32::from(m)).collect();
    let mut rest = images.depth.clone();
    let means = (rest.par_chunks_mut(area).zip(images.mask.par_chunks(area)))
        .map(|(values, mask)| {
            let mean = masked_mean(values, mask) / steps.depth_mean;
            let stored = mean.round() as i32;
            subtract(values, mask, (f64::from(stored) * steps.depth_mean) as f32);
            stored
        })
        .collect();
    let channel = ChannelOptions {
        name: "learning depth",
        frozen: frozen.map(|f| &f.depth),
        n_atoms: options.depth_atoms as usize,
        sparsity: options.depth_sparsity as usize,
        tolerance: options.depth_tolerance(level.level) as f32,
        code_step: steps.depth_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    learn_residuals(area, &rest, &weights, &channel, means, progress)
}

/// Means, dictionary and codes of colours, of the planes red, green and blue.
pub(in crate::hscsm) fn learn_color(
    colors: &[f32],
    images: &Images,
    level: &LevelTask<'_>,
    progress: &dyn Progress,
) -> Result<(Channel, Option<Learning>)> {
    let LevelTask { options, area, steps, frozen, .. } = *level;
    let weights: Vec<f32> = images
        .mask
        .chunks(area)
        .flat_map(|mask| mask.iter().chain(mask).chain(mask))
        .map(|&m| f32::from(m))
        .collect();
    let mut rest = colors.to_vec();
    let means: Vec<[i32; 3]> = (rest.par_chunks_mut(3 * area).zip(images.mask.par_chunks(area)))
        .map(|(values, mask)| {
            let rgb: [f32; 3] = std::array::from_fn(|c| {
                masked_mean(&values[c * area..(c + 1) * area], mask) as f32
            });
            let stored = to_ycocg(rgb).map(|c| (f64::from(c) / steps.color_mean).round() as i32);
            let decoded = stored.map(|c| (f64::from(c) * steps.color_mean) as f32);
            for (c, mean) in to_rgb(decoded).into_iter().enumerate() {
                subtract(&mut values[c * area..(c + 1) * area], mask, mean);
            }
            stored
        })
        .collect();
    let channel = ChannelOptions {
        name: "learning colour",
        frozen: frozen.and_then(|f| f.color.as_ref()),
        n_atoms: options.color_atoms as usize,
        sparsity: options.color_sparsity as usize,
        tolerance: options.color_tolerance(level.level) as f32,
        code_step: steps.color_code as f32,
        iterations: options.iterations as usize,
        random_state: options.random_state,
    };
    learn_residuals(3 * area, &rest, &weights, &channel, means.into_flattened(), progress)
}

/// The channel with these means: dictionary and codes of `values`, patch after patch, from which they are removed.
fn learn_residuals(
    n_features: usize,
    values: &[f32],
    weights: &[f32],
    options: &ChannelOptions<'_>,
    means: Vec<i32>,
    progress: &dyn Progress,
) -> Result<(Channel, Option<Learning>)> {
    let signals = ChannelSignals::new(n_features, values, weights, options.tolerance);
    let Coded { dictionary, codes, learning } = learn_channel(&signals, options, progress)?;
    Ok((Channel { dictionary, means, codes }, learning))
}

/// Mean of the set pixels.
fn masked_mean(values: &[f32], mask: &[u8]) -> f64 {
    let set = mask.iter().filter(|&&m| m != 0).count();
    let sum: f64 =
        values.iter().zip(mask).filter(|(_, m)| **m != 0).map(|(v, _)| f64::from(*v)).sum();
    sum / set.max(1) as f64
}

/// Subtracts `mean` from the set pixels.
fn subtract(values: &mut [f32], mask: &[u8], mean: f32) {
    for (value, _) in values.iter_mut().zip(mask).filter(|(_, m)| **m != 0) {
        *value -= mean;
    }
}
