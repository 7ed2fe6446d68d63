//! What the scan shows at each patch, and what it costs to describe it by other patches than its own.

use surfabet_base::parallel;
use surfabet_geom::{CloudParts, Column, Progress};

use super::surface::SurfacePixels;
use crate::error::Result;
use crate::patches::attributes::chosen::ChosenAttributes;
use crate::patches::attributes::{AttributeContent, INTENSITIES};
use crate::patches::constants::{COMPARED_SAMPLES, LABEL_BITS};
use crate::patches::decode::Sampler;
use crate::patches::model::{Attributes, Lattice};
use crate::patches::options::PatchesOptions;
use crate::patches::samples::SidedSamples;

/// The samples of a scan with what their own patches make of them.
pub(super) struct Seen<'a> {
    /// Positions, pixels.
    pub positions: Vec<[f32; 3]>,
    /// Numbers of samples of each patch, and how many each of them stands for.
    pub of_leaves: Vec<(Vec<u32>, f32)>,
    /// Squared pixels that its own patch costs each sample.
    pub own_costs: Vec<f32>,
    /// Whether its own patch is further than the tolerance from each sample.
    pub own_far: Vec<bool>,
    attributes: SeenAttributes<'a>,
}

/// Attributes of samples.
struct SeenAttributes<'a> {
    sampler: Sampler<'a>,
    /// Mean colours of the points of each sample, where colour is kept.
    colors: Option<Vec<[f32; 3]>>,
    /// What is decoded of the attributes at each sample.
    own: CloudParts,
    /// Bits per squared grey level of a sample.
    color_bits: f32,
    /// For intensities, then the others by name: what a squared difference or another label of a sample costs, bits.
    others: Vec<(&'a str, Price)>,
}

/// What a difference costs, bits.
#[derive(Clone, Copy)]
enum Price {
    Squared(f32),
    Other(f32),
}

impl<'a> Seen<'a> {
    pub fn new(
        samples: &SidedSamples<'_>,
        lattice: &Lattice,
        surface: &SurfacePixels<'_>,
        (attributes, chosen): (&'a Attributes, &ChosenAttributes<'_>),
        (options, tolerance): (&PatchesOptions, f32),
        progress: &dyn Progress,
    ) -> Result<Self> {
        let pixel = lattice.pixel_size as f32;
        let step = (samples.all.len() / (COMPARED_SAMPLES * surface.leaves.len()).max(1)).max(1);
        let measured: Vec<u32> = (0..samples.all.len() as u32).step_by(step).collect();
        let owners = parallel::map(&measured, |&i| {
            let nearest = surface.nearest(samples.all[i as usize].position.map(|c| c / pixel));
            nearest.map(|n| (i, surface.owners[n.pixel]))
        });
        progress.check()?;
        let mut all_of_leaves = vec![Vec::new(); surface.leaves.len()];
        for (i, owner) in owners.into_iter().flatten() {
            all_of_leaves[owner as usize].push(i);
        }
        // Only some of each patch are measured, and numbered anew.
        let mut kept: Vec<u32> = Vec::new();
        let mut of_leaves = Vec::with_capacity(all_of_leaves.len());
        for all in all_of_leaves {
            let from = kept.len() as u32;
            let every = all.len().div_ceil(COMPARED_SAMPLES).max(1);
            kept.extend(all.iter().step_by(every));
            let numbers: Vec<u32> = (from..kept.len() as u32).collect();
            let each = (step * all.len()) as f32 / numbers.len().max(1) as f32;
            of_leaves.push((numbers, each));
        }
        let position = |&i: &u32| samples.all[i as usize].position.map(|c| c / pixel);
        let positions: Vec<[f32; 3]> = kept.iter().map(position).collect();
        let own = parallel::map(&positions, |&p| {
            let nearest = surface.nearest(p);
            (surface.cost(nearest), surface.is_far(nearest, tolerance))
        });
        let (own_costs, own_far) = own.into_iter().unzip();
        let per_cell = samples.all.len() as f32 / attributes.cells.len().max(1) as f32;
        let sampler = Sampler::new(attributes);
        let own = sampler.at(&positions, progress)?;
        let colors = chosen.colors.filter(|_| attributes.color.is_some()).map(|colors| {
            let means = samples.means(|i| colors[i].map(f64::from));
            kept.iter().map(|&i| means[i as usize].unwrap_or_default()).collect()
        });
        let lambda = options.color_rate as f32 * (options.color_step as f32).powi(2);
        let others = attributes.others.iter().map(|field| {
            let price = match field.header().content {
                AttributeContent::Scalar(scale) => {
                    let lambda = options.attribute_rate as f32 * (scale.step as f32).powi(2);
                    Price::Squared(1.0 / (per_cell * lambda.max(f32::MIN_POSITIVE)))
                }
                AttributeContent::Labels(_) => Price::Other(LABEL_BITS / per_cell),
            };
            (field.name.as_str(), price)
        });
        let attributes = SeenAttributes {
            colors,
            own,
            color_bits: 1.0 / (per_cell * lambda),
            others: others.collect(),
            sampler,
        };
        Ok(Self { positions, of_leaves, own_costs, own_far, attributes })
    }

    /// What it costs, bits, more than with their own patches that some samples have the attributes at other positions
    /// (pixels).
    pub fn attribute_costs(
        &self,
        samples: &[u32],
        positions: &[[f32; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<f32>> {
        let of = &self.attributes;
        let given = of.sampler.at(positions, progress)?;
        let mut costs = vec![0.0; samples.len()];
        if let (Some(seen), Some(own), Some(given)) = (&of.colors, &of.own.colors, &given.colors) {
            for ((cost, &i), given) in costs.iter_mut().zip(samples).zip(given) {
                let i = i as usize;
                let error = |color: [u8; 3]| -> f32 {
                    (0..3).map(|c| (f32::from(color[c]) - seen[i][c]).powi(2)).sum()
                };
                *cost += of.color_bits * (error(*given) - error(own[i]));
            }
        }
        for &(name, price) in &of.others {
            let [own, given] = [&of.own, &given].map(|parts| number_of(parts, name));
            for (k, (cost, &i)) in costs.iter_mut().zip(samples).enumerate() {
                let (own, given) = (own(i as usize), given(k));
                *cost += match price {
                    Price::Squared(bits) => bits * (own - given).powi(2) as f32,
                    Price::Other(bits) if own != given => bits,
                    Price::Other(_) => 0.0,
                };
            }
        }
        Ok(costs)
    }
}

/// The values of an attribute of a cloud as numbers.
fn number_of<'a>(parts: &'a CloudParts, name: &str) -> Box<dyn Fn(usize) -> f64 + 'a> {
    if name == INTENSITIES
        && let Some(values) = &parts.intensities
    {
        return Box::new(|i| f64::from(values[i]));
    }
    let column: Option<&Column> =
        parts.extra.iter().find(|(other, _)| other == name).map(|(_, column)| column);
    match column {
        Some(column) => Box::new(|i| column.number(i)),
        None => Box::new(|_| 0.0),
    }
}
