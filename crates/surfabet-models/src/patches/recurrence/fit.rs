//! What is won where a motion gives the surface of some patches once more: bits of the patches there, less the bits that the
//! difference in error is worth.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::seen::Seen;
use super::surface::SurfacePixels;
use crate::error::Result;
use crate::patches::constants::{
    ERROR_SHARE, FAR_BITS, FIRST_SAMPLES, LEAST_DESCRIBED, LEAST_PROBED, PROBED_PIXELS,
};
use crate::patches::instances::Motion;
use crate::patches::instances::order::place_in_order;

/// What is known of the patches that may be left out.
pub(super) struct Prices<'a> {
    pub surface: &'a SurfacePixels<'a>,
    pub seen: &'a Seen<'a>,
    /// Bits of each patch, with its attributes.
    pub bits: Vec<f32>,
    /// Place of each patch in the order of sources.
    pub order: Vec<f32>,
    /// Squared pixels of a sample that a bit is worth.
    pub lambda: f32,
    /// Samples of a pixel.
    pub density: f32,
    /// Distance of a sample from the surface from which on it asks for a point beside the patches, pixels.
    pub tolerance: f32,
}

/// A patch that need not be coded where some others are given again.
#[derive(Debug, Clone)]
pub(super) struct RepeatedPatch {
    pub leaf: u32,
    /// Bits that are won.
    pub gain: f32,
    /// The patches that are given again.
    pub sources: Vec<u32>,
}

/// A patch with what describes its samples.
struct Described<'a> {
    leaf: u32,
    samples: &'a [u32],
    /// How many samples each of them stands for.
    each: f32,
    /// Where the samples have come from.
    positions: Vec<[f32; 3]>,
    /// What is won of the geometry, bits.
    gain: f32,
    /// Sources with the number of samples that each describes.
    sources: BTreeMap<u32, u32>,
}

impl<'a> Prices<'a> {
    pub fn new(
        surface: &'a SurfacePixels<'a>,
        seen: &'a Seen<'a>,
        bits: Vec<f32>,
        [lambda, density, tolerance]: [f32; 3],
    ) -> Self {
        let middle = |leaf: usize| {
            let pixels = surface.pixels_of(leaf);
            surface.middles[(pixels.start + pixels.end) / 2]
        };
        let order = (0..surface.leaves.len()).map(|leaf| place_in_order(middle(leaf)));
        Self { surface, seen, bits, order: order.collect(), lambda, density, tolerance }
    }

    /// The patches that need not be coded with a motion, by growing numbers. Only sources that are `allowed` are given again.
    pub fn fits(
        &self,
        motion: &Motion,
        allowed: impl Fn(u32) -> bool + Sync,
        progress: &dyn Progress,
    ) -> Result<Vec<RepeatedPatch>> {
        progress.check()?;
        let described: Vec<Described<'_>> =
            parallel::gather(self.surface.leaves.len(), |leaf, all| {
                all.extend(self.described(leaf as u32, motion));
            });
        let samples: Vec<u32> = described.iter().flat_map(|d| d.samples.iter().copied()).collect();
        let positions: Vec<[f32; 3]> =
            described.iter().flat_map(|d| d.positions.iter().copied()).collect();
        let costs = self.seen.attribute_costs(&samples, &positions, progress)?;
        let mut from = 0;
        let mut found = Vec::new();
        // Samples that each source describes.
        let mut counts: BTreeMap<u32, u32> = BTreeMap::new();
        for mut of in described {
            let to = from + of.samples.len();
            of.gain -= ERROR_SHARE * of.each * costs[from..to].iter().sum::<f32>();
            from = to;
            let n = of.sources.values().sum::<u32>() as f32;
            of.sources.retain(|_, count| *count as f32 >= LEAST_DESCRIBED * n);
            if of.gain > 0.0 && !of.sources.is_empty() {
                of.sources.iter().for_each(|(&s, n)| *counts.entry(s).or_default() += n);
                found.push(of);
            }
        }
        let sources: Vec<(u32, u32)> = counts.into_iter().collect();
        let costs = parallel::map(&sources, |&(source, n)| match allowed(source) {
            true => (source, self.cost_of_decoded(source as usize, motion) / n as f32),
            false => (source, f32::INFINITY),
        });
        let costs: BTreeMap<u32, f32> = costs.into_iter().collect();
        let fits = parallel::map_owned(found, |of| {
            let shared = of.sources.iter().map(|(source, &n)| costs[source] * n as f32);
            let gain = of.gain - shared.sum::<f32>() + self.cost_of_own(of.leaf as usize, motion);
            let sources = of.sources.into_keys().collect();
            (gain > 0.0).then_some(RepeatedPatch { leaf: of.leaf, gain, sources })
        });
        Ok(fits.into_iter().flatten().collect())
    }

    /// What other patches make of the samples of one, moved by a motion; `None` where this is hopeless.
    fn described(&self, leaf: u32, motion: &Motion) -> Option<Described<'_>> {
        let Self { surface, seen, .. } = self;
        let pixels = surface.pixels_of(leaf as usize);
        let step = pixels.len().div_ceil(PROBED_PIXELS).max(1);
        let probes = pixels.clone().step_by(step);
        let n = probes.len();
        let near = probes.filter(|&i| surface.may_be_near(motion.source_of(surface.middles[i])));
        if near.count() * PROBED_PIXELS < n * LEAST_PROBED {
            return None;
        }
        let (samples, each) = &seen.of_leaves[leaf as usize];
        if samples.is_empty() {
            return self.described_hole(leaf, motion);
        }
        let bits = self.bits[leaf as usize];
        let more = |i: u32| {
            let nearest = surface.nearest(motion.source_of(seen.positions[i as usize]));
            let is_far = surface.is_far(nearest, self.tolerance) && !seen.own_far[i as usize];
            let point = if is_far { FAR_BITS * self.lambda } else { 0.0 };
            (nearest, surface.cost(nearest) - seen.own_costs[i as usize] + point)
        };
        let step = samples.len().div_ceil(FIRST_SAMPLES);
        let first = samples.iter().step_by(step);
        let weight = each * samples.len() as f32 / first.len() as f32;
        if weight * first.map(|&i| more(i).1).sum::<f32>() > 4.0 * bits * self.lambda {
            return None;
        }
        let mut sources = BTreeMap::new();
        let mut sum = 0.0;
        for &i in samples {
            let (nearest, more) = more(i);
            sum += more;
            if let Some(nearest) = nearest {
                *sources.entry(surface.owners[nearest.pixel]).or_default() += 1;
            }
        }
        let gain = bits - ERROR_SHARE * each * sum / self.lambda;
        let source = |&i: &u32| motion.source_of(seen.positions[i as usize]);
        let positions = samples.iter().map(source).collect();
        (gain > 0.0).then_some(Described { leaf, samples, each: *each, positions, gain, sources })
    }

    /// The same of a patch that no sample is nearest to: its own surface is to be described.
    fn described_hole(&self, leaf: u32, motion: &Motion) -> Option<Described<'_>> {
        let surface = self.surface;
        let mut sources = BTreeMap::new();
        let mut sum = 0.0;
        for i in surface.pixels_of(leaf as usize) {
            let nearest = surface.nearest(motion.source_of(surface.middles[i]));
            sum += surface.cost(nearest);
            if let Some(nearest) = nearest {
                *sources.entry(surface.owners[nearest.pixel]).or_default() += 1;
            }
        }
        let gain = self.bits[leaf as usize] - ERROR_SHARE * self.density * sum / self.lambda;
        let none =
            Described { leaf, samples: &[], each: 0.0, positions: Vec::new(), gain, sources };
        (gain > 0.0).then_some(none)
    }

    /// What it costs, bits, that a patch is decoded once more where a motion takes it.
    fn cost_of_decoded(&self, leaf: usize, motion: &Motion) -> f32 {
        self.cost_of_pixels(leaf, |p| motion.of_position(p))
    }

    /// What it would cost, bits, were a patch decoded where a motion takes it from. As much is won where it is left out: what
    /// is given in its place and the patch itself are off the same truth.
    fn cost_of_own(&self, leaf: usize, motion: &Motion) -> f32 {
        self.cost_of_pixels(leaf, |p| motion.source_of(p))
    }

    /// What it costs, bits, that the pixels of a patch are decoded at other positions.
    fn cost_of_pixels(&self, leaf: usize, moved: impl Fn([f32; 3]) -> [f32; 3]) -> f32 {
        let surface = self.surface;
        let half = surface.leaves[leaf].patch.half_thickness();
        let of_pixel = |i: usize| {
            let nearest = surface.nearest(moved(surface.middles[i]));
            surface.cost_of_decoded(nearest, half)
        };
        let sum = surface.pixels_of(leaf).map(of_pixel).sum::<f32>();
        ERROR_SHARE * sum * self.density / self.lambda
    }
}
