//! Normal, sizes, colour and intensity of a neuron, each by its difference to the mean over the neighbours before it.

use surfabet_entropy::{Bit, Coder, SInt};
use surfabet_geom::octahedral;

use super::{Coded, MAX_CANDIDATES, Streams};
use crate::color::MAX_COLOR_CODE;
use crate::gas::model::{GasHeader, NORMAL_BITS, Neuron};
use crate::scalar::MAX_CODE;

/// The adaptive models of a neuron's attributes.
pub(super) struct NeuronModels {
    /// By whether there are neighbours, and whether any has a normal.
    has_normal: [Bit; 3],
    /// Differences of each number of the code.
    normal: [SInt; 2],
    /// Differences of count, radius and thickness, each by whether there are neighbours.
    sizes: [SInt; 6],
    color: ChannelModels<3>,
    intensity: ChannelModels<1>,
}

/// The adaptive models of N channels.
struct ChannelModels<const N: usize> {
    /// Differences of the first, by whether there are neighbours.
    first: [SInt; 2],
    /// Differences of each further one: without neighbours, then by whether the channel before differs by more than one.
    /// Those of the first are not used.
    further: [[SInt; 3]; N],
}

impl<const N: usize> ChannelModels<N> {
    fn new() -> Self {
        let further = [const { [const { SInt::new() }; 3] }; N];
        Self { first: [const { SInt::new() }; 2], further }
    }
}

impl NeuronModels {
    pub fn new() -> Self {
        Self {
            has_normal: [Bit::new(); 3],
            normal: [const { SInt::new() }; 2],
            sizes: [const { SInt::new() }; 6],
            color: ChannelModels::new(),
            intensity: ChannelModels::new(),
        }
    }
}

/// Codes everything of neuron `v` but its position.
pub(super) fn code_neuron<C: Coder>(
    streams: &mut Streams<'_, C>,
    models: &mut NeuronModels,
    coded: &mut Coded<'_>,
    header: &GasHeader,
    v: usize,
) -> Result<(), C::Error> {
    let known = coded.known[v].iter().take(MAX_CANDIDATES);
    let before: Vec<Neuron> = known.map(|&i| coded.neurons[i as usize]).collect();
    let wanted = coded.wanted(v);
    let mut neuron = Neuron { position: coded.neurons[v].position, ..Neuron::default() };
    neuron.normal = code_normal(streams.normals, models, &before, wanted.normal)?;
    [neuron.count, neuron.radius, neuron.thickness] =
        code_sizes(streams.sizes, models, &before, &wanted)?;
    if header.color_step.is_some() {
        let of = |n: &Neuron| n.color.map(i32::from);
        let (predicted, limit) = (Predicted::of(&before, of), i32::from(MAX_COLOR_CODE));
        let coder = &mut *streams.colors;
        let color =
            code_channels(coder, &mut models.color, &predicted, of(&wanted), limit, "colour")?;
        // Within the limit, which has 16 bits.
        neuron.color = color.map(|c| c as i16);
    }
    if header.intensity.is_some() {
        let of = |n: &Neuron| [n.intensity];
        let (predicted, coder) = (Predicted::of(&before, of), &mut *streams.intensities);
        let models = &mut models.intensity;
        [neuron.intensity] =
            code_channels(coder, models, &predicted, of(&wanted), MAX_CODE, "intensity")?;
    }
    coded.neurons[v] = neuron;
    Ok(())
}

/// Mean rounded to the nearest, of `count` values.
fn mean(sum: i32, count: usize) -> i32 {
    let count = count as i32;
    if count == 0 { 0 } else { (2 * sum + count).div_euclid(2 * count) }
}

fn code_normal<C: Coder>(
    coder: &mut C,
    models: &mut NeuronModels,
    before: &[Neuron],
    wanted: Option<[i8; 2]>,
) -> Result<Option<[i8; 2]>, C::Error> {
    let known: Vec<[i8; 2]> = before.iter().filter_map(|b| b.normal).collect();
    let context = if before.is_empty() { 0 } else { 1 + usize::from(!known.is_empty()) };
    if !coder.bit(&mut models.has_normal[context], wanted.is_some())? {
        return Ok(None);
    }
    let wanted = wanted.unwrap_or_default();
    let mut normal = [0; 2];
    for (axis, part) in normal.iter_mut().enumerate() {
        let predicted = mean(known.iter().map(|c| i32::from(c[axis])).sum(), known.len());
        let difference = i32::from(wanted[axis]) - predicted;
        let difference = coder.sint(&mut models.normal[axis], difference)?;
        let value = i64::from(predicted) + i64::from(difference);
        if value.abs() > i64::from(octahedral::half(NORMAL_BITS)) {
            return Err(coder.corrupt(format!("a normal of code {value}")));
        }
        *part = value as i8;
    }
    Ok(Some(normal))
}

/// Codes of count, radius and thickness.
fn code_sizes<C: Coder>(
    coder: &mut C,
    models: &mut NeuronModels,
    before: &[Neuron],
    wanted: &Neuron,
) -> Result<[u8; 3], C::Error> {
    let sizes_of = |n: &Neuron| [n.count, n.radius, n.thickness];
    let wanted = sizes_of(wanted);
    let mut sizes = [0; 3];
    for (i, size) in sizes.iter_mut().enumerate() {
        let sum = before.iter().map(|b| i32::from(sizes_of(b)[i])).sum();
        let predicted = mean(sum, before.len());
        let model = &mut models.sizes[2 * i + usize::from(!before.is_empty())];
        let difference = coder.sint(model, i32::from(wanted[i]) - predicted)?;
        let value = i64::from(predicted) + i64::from(difference);
        *size =
            u8::try_from(value).map_err(|_| coder.corrupt(format!("a size of code {value}")))?;
    }
    Ok(sizes)
}

/// Prediction of some channels from neighbours.
struct Predicted<const N: usize> {
    means: [i32; N],
    /// True with neighbours.
    is_known: bool,
}

impl<const N: usize> Predicted<N> {
    fn of(before: &[Neuron], channels: impl Fn(&Neuron) -> [i32; N]) -> Self {
        let sum = |c: usize| before.iter().map(|b| channels(b)[c]).sum();
        let means = std::array::from_fn(|c| mean(sum(c), before.len()));
        Self { means, is_known: !before.is_empty() }
    }
}

/// Codes of N channels, within `-limit..=limit`; `what` is their name in errors.
fn code_channels<C: Coder, const N: usize>(
    coder: &mut C,
    models: &mut ChannelModels<N>,
    predicted: &Predicted<N>,
    wanted: [i32; N],
    limit: i32,
    what: &str,
) -> Result<[i32; N], C::Error> {
    let mut codes = [0; N];
    // The channel before differs from its prediction by more than one step.
    let mut differs = 0;
    for (channel, code) in codes.iter_mut().enumerate() {
        let model = match channel {
            0 => &mut models.first[usize::from(predicted.is_known)],
            _ => &mut models.further[channel][if predicted.is_known { 1 + differs } else { 0 }],
        };
        let mean = predicted.means[channel];
        let difference = coder.sint(model, wanted[channel] - mean)?;
        let value = i64::from(mean) + i64::from(difference);
        if value.abs() > i64::from(limit) {
            return Err(coder.corrupt(format!("{what} of code {value}")));
        }
        *code = value as i32;
        differs = usize::from(difference.unsigned_abs() > 1);
    }
    Ok(codes)
}
