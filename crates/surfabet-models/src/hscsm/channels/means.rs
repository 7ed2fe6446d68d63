//! Means of each patch and channel, and learning from what remains without them.
//!
//! Means are rounded before they are removed, so that their rounding costs no accuracy: what it leaves is coded with the
//! rest.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::dictionary::{
    ChannelOptions, ChannelSignals, Coded, Learning, LevelDictionary, QuantizedDictionary,
    learn_channel,
};
use super::images::Images;
use crate::color::{to_rgb, to_ycocg};
use crate::error::Result;
use crate::hscsm::model::{Channel, Codes, Steps};
use crate::hscsm::options::HscsmOptions;

/// Patches whose means one thread takes off at a time.
const PATCHES_PER_TASK: usize = 64;

/// What is learned of the channels of a level.
#[derive(Clone, Copy)]
pub(in crate::hscsm) struct LevelTask<'a> {
    pub options: &'a HscsmOptions,
    pub level: u32,
    /// Pixels of a patch.
    pub area: usize,
    /// Planes of a colour image: three, or one of grey.
    pub planes: usize,
    pub steps: Steps,
    /// The dictionaries to code in; `None`: learn them.
    pub frozen: Option<&'a LevelDictionary>,
}

/// One channel of a level before it is coded: means, and images without them.
pub(in crate::hscsm) struct ChannelImages<'a> {
    n_features: usize,
    /// Patch after patch, means removed.
    values: Vec<f32>,
    /// 1 where a pixel is set, else 0.
    weights: Vec<f32>,
    means: Vec<i32>,
    tolerance: f32,
    code_step: f32,
    /// The dictionary to code in; `None`: learn one.
    frozen: Option<&'a QuantizedDictionary>,
}

impl ChannelImages<'_> {
    /// Number of patches.
    fn n_patches(&self) -> usize {
        self.values.len() / self.n_features
    }
}

/// Means of depth, and what remains without them.
pub(in crate::hscsm) fn depth_images<'a>(
    images: &Images,
    level: &LevelTask<'a>,
) -> ChannelImages<'a> {
    let LevelTask { options, area, steps, frozen, .. } = *level;
    let mut values = images.depth.clone();
    let mut means = vec![0; values.len() / area];
    if options.means_apart {
        let chunks = values.chunks_mut(PATCHES_PER_TASK * area);
        let masks = images.mask.chunks(PATCHES_PER_TASK * area);
        let tasks = chunks.zip(masks).zip(means.chunks_mut(PATCHES_PER_TASK));
        parallel::for_each(tasks, |_, ((values, masks), means)| {
            let patches = values.chunks_mut(area).zip(masks.chunks(area)).zip(means);
            for ((values, mask), stored) in patches {
                *stored = (masked_mean(values, mask) / steps.depth_mean).round() as i32;
                subtract(values, mask, (f64::from(*stored) * steps.depth_mean) as f32);
            }
        });
    }
    ChannelImages {
        n_features: area,
        values,
        weights: images.mask.iter().map(|&m| f32::from(m)).collect(),
        means,
        tolerance: options.depth_tolerance(level.level) as f32,
        code_step: steps.depth_code as f32,
        frozen: frozen.map(|f| &f.depth),
    }
}

/// Means of colours, of the planes red, green and blue or of the one plane of grey, and what remains without them.
pub(in crate::hscsm) fn color_images<'a>(
    colors: &[f32],
    images: &Images,
    level: &LevelTask<'a>,
) -> ChannelImages<'a> {
    let LevelTask { options, area, planes, steps, frozen, .. } = *level;
    let weight = |mask: &[u8]| mask.repeat(planes).into_iter().map(f32::from).collect::<Vec<f32>>();
    let weights = images.mask.chunks(area).flat_map(weight).collect();
    let mut values = colors.to_vec();
    let mut means = vec![0; values.len() / area];
    if options.means_apart {
        let chunks = values.chunks_mut(PATCHES_PER_TASK * planes * area);
        let masks = images.mask.chunks(PATCHES_PER_TASK * area);
        let tasks = chunks.zip(masks).zip(means.chunks_mut(PATCHES_PER_TASK * planes));
        parallel::for_each(tasks, |_, ((values, masks), means)| {
            let patches = values.chunks_mut(planes * area).zip(masks.chunks(area));
            for ((values, mask), means) in patches.zip(means.chunks_mut(planes)) {
                means.copy_from_slice(&subtract_color(values, mask, steps.color_mean));
            }
        });
    }
    ChannelImages {
        n_features: planes * area,
        values,
        weights,
        means,
        tolerance: options.color_tolerance(level.level) as f32,
        code_step: steps.color_code as f32,
        frozen: frozen.and_then(|f| f.color.as_ref()),
    }
}

/// Subtracts the rounded means of the planes, of luma, orange and green chroma or of grey, and returns them in steps.
fn subtract_color(values: &mut [f32], mask: &[u8], step: f64) -> Vec<i32> {
    let area = mask.len();
    let means: Vec<f32> = values.chunks(area).map(|v| masked_mean(v, mask) as f32).collect();
    let round = |c: f32| (f64::from(c) / step).round() as i32;
    let decoded = |c: i32| (f64::from(c) * step) as f32;
    let (stored, rounded) = match <[f32; 3]>::try_from(means.as_slice()) {
        Ok(rgb) => {
            let stored = to_ycocg(rgb).map(round);
            (stored.to_vec(), to_rgb(stored.map(decoded)).to_vec())
        }
        Err(_) => {
            let stored: Vec<i32> = means.into_iter().map(round).collect();
            let rounded = stored.iter().copied().map(decoded).collect();
            (stored, rounded)
        }
    };
    for (plane, mean) in values.chunks_mut(area).zip(rounded) {
        subtract(plane, mask, mean);
    }
    stored
}

/// Dictionary and codes of depth, of one level or of several with one dictionary.
pub(in crate::hscsm) fn learn_depth(
    levels: Vec<ChannelImages<'_>>,
    options: &HscsmOptions,
    progress: &dyn Progress,
) -> Result<(Vec<Channel>, Option<Learning>)> {
    let n_patches = levels.iter().map(ChannelImages::n_patches).sum();
    let channel = ChannelOptions {
        name: "learning depth",
        n_atoms: options.depth_atoms(n_patches),
        sparsity: options.depth_sparsity as usize,
        ..channel_options(options)
    };
    learn_together(levels, &channel, progress)
}

/// Dictionary and codes of colour, of one level or of several with one dictionary.
pub(in crate::hscsm) fn learn_color(
    levels: Vec<ChannelImages<'_>>,
    options: &HscsmOptions,
    progress: &dyn Progress,
) -> Result<(Vec<Channel>, Option<Learning>)> {
    let n_patches = levels.iter().map(ChannelImages::n_patches).sum();
    let channel = ChannelOptions {
        name: "learning colour",
        n_atoms: options.color_atoms(n_patches),
        sparsity: options.color_sparsity as usize,
        ..channel_options(options)
    };
    learn_together(levels, &channel, progress)
}

/// What both channels have in common.
fn channel_options<'a>(options: &HscsmOptions) -> ChannelOptions<'a> {
    ChannelOptions {
        name: "",
        frozen: None,
        n_atoms: 0,
        sparsity: 0,
        tolerance: 1.0,
        code_step: 1.0,
        iterations: options.iterations as usize,
        training_signals: options.max_training_signals,
        small_atoms: options.small_atoms,
        random_state: options.random_state,
    }
}

/// The channel of each level, with one dictionary for all: learned from what all have left without their means, in
/// tolerances of their level, so that all levels count alike.
fn learn_together<'a>(
    levels: Vec<ChannelImages<'a>>,
    options: &ChannelOptions<'a>,
    progress: &dyn Progress,
) -> Result<(Vec<Channel>, Option<Learning>)> {
    let Some(last) = levels.last() else { return Ok((Vec::new(), None)) };
    let n_features = last.n_features;
    // A level by itself stays in its unit.
    let alone = levels.len() == 1;
    let options = ChannelOptions {
        frozen: last.frozen,
        tolerance: if alone { last.tolerance } else { 1.0 },
        code_step: if alone { last.code_step } else { last.code_step / last.tolerance },
        ..options.clone()
    };
    let (mut values, mut weights, mut means) = (Vec::new(), Vec::new(), Vec::new());
    for level in levels {
        let scale = if alone { 1.0 } else { 1.0 / level.tolerance };
        values.extend(level.values.iter().map(|v| v * scale));
        weights.extend(level.weights);
        means.push((level.means, level.values.len() / n_features));
    }
    let signals = ChannelSignals::new(n_features, &values, &weights, options.tolerance);
    let Coded { dictionary, codes, learning } = learn_channel(&signals, &options, progress)?;
    let mut from = 0;
    let channels = means
        .into_iter()
        .map(|(means, n_patches)| {
            let codes = patches_of(&codes, from, n_patches);
            from += n_patches;
            Channel { dictionary: dictionary.clone(), means, codes }
        })
        .collect();
    Ok((channels, learning))
}

/// The codes of `count` patches, from the patch `from` on.
fn patches_of(codes: &Codes, from: usize, count: usize) -> Codes {
    let offsets = &codes.offsets[from..=from + count];
    let (low, high) = (offsets[0] as usize, offsets[count] as usize);
    Codes {
        offsets: offsets.iter().map(|o| o - offsets[0]).collect(),
        atoms: codes.atoms[low..high].to_vec(),
        coefficients: codes.coefficients[low..high].to_vec(),
    }
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
