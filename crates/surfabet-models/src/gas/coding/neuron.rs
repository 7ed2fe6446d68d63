//! Normal, sizes and colour of a neuron, each by its difference to the mean over the neighbours before it.

use surfabet_entropy::{Bit, Coder, SInt};
use surfabet_geom::octahedral;

use super::{Coded, MAX_CANDIDATES, Streams};
use crate::color::MAX_COLOR_CODE;
use crate::gas::model::{GasHeader, NORMAL_BITS, Neuron};

/// The adaptive models of a neuron's attributes.
pub(super) struct NeuronModels {
    /// By whether there are neighbours, and whether any has a normal.
    has_normal: [Bit; 3],
    /// Differences of each number of the code.
    normal: [SInt; 2],
    /// Differences of count, radius and thickness, each by whether there are neighbours.
    sizes: [SInt; 6],
    /// Differences of luma, by whether there are neighbours.
    luma: [SInt; 2],
    /// Differences of each chroma: without neighbours, then by whether the channel before differs by more than one.
    chroma: [SInt; 6],
}

impl NeuronModels {
    pub fn new() -> Self {
        Self {
            has_normal: [Bit::new(); 3],
            normal: [const { SInt::new() }; 2],
            sizes: [const { SInt::new() }; 6],
            luma: [const { SInt::new() }; 2],
            chroma: [const { SInt::new() }; 6],
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
        neuron.color = code_color(streams.colors, models, &before, wanted.color)?;
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

/// Codes of luma and both chromas.
fn code_color<C: Coder>(
    coder: &mut C,
    models: &mut NeuronModels,
    before: &[Neuron],
    wanted: [i16; 3],
) -> Result<[i16; 3], C::Error> {
    let predictable = !before.is_empty();
    let mut color = [0; 3];
    // The channel before differs from its prediction by more than one step.
    let mut differs = 0;
    for channel in 0..3 {
        let sum = before.iter().map(|b| i32::from(b.color[channel])).sum();
        let predicted = mean(sum, before.len());
        let model = match channel {
            0 => &mut models.luma[usize::from(predictable)],
            _ => &mut models.chroma[3 * (channel - 1) + if predictable { 1 + differs } else { 0 }],
        };
        let difference = coder.sint(model, i32::from(wanted[channel]) - predicted)?;
        let value = i64::from(predicted) + i64::from(difference);
        if value.abs() > i64::from(MAX_COLOR_CODE) {
            return Err(coder.corrupt(format!("a colour of code {value}")));
        }
        color[channel] = value as i16;
        differs = usize::from(difference.unsigned_abs() > 1);
    }
    Ok(color)
}
