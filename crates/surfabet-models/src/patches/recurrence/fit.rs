//! What is won where a motion gives the surface of some patches once more: bits of the patches there, less the bits that the
//! difference in error is worth.

use std::collections::BTreeMap;

use surfabet_base::parallel;
use surfabet_geom::Progress;
use surfabet_geom::cells::{cell_of, key, of_key};
use surfabet_geom::morton::MortonMap;

use super::seen::Seen;
use super::surface::SurfacePixels;
use crate::error::Result;
use crate::patches::constants::{
    ERROR_SHARE, FAR_BITS, FIRST_SAMPLES, LEAST_DESCRIBED, LEAST_PROBED, OWN_MARGIN, PROBED_PIXELS,
    REGION, SPREAD_SHARE,
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
    /// The region of each patch.
    regions: Vec<u64>,
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
        let order = order.collect();
        let region = |leaf| key(cell_of(middle(leaf), REGION));
        let regions = (0..surface.leaves.len()).map(region).collect();
        Self { surface, seen, bits, order, regions, lambda, density, tolerance }
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
            of.sources.iter().for_each(|(&s, n)| *counts.entry(s).or_default() += n);
            found.push(of);
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
            RepeatedPatch { leaf: of.leaf, gain, sources }
        });
        Ok(self.agreed(fits))
    }

    /// The patches about which most of the others around are won too.
    fn agreed(&self, fits: Vec<RepeatedPatch>) -> Vec<RepeatedPatch> {
        let mut votes: Vec<f32> = self.bits.iter().map(|bits| -bits).collect();
        for of in &fits {
            let bits = self.bits[of.leaf as usize];
            votes[of.leaf as usize] = of.gain.clamp(-bits, bits);
        }
        let mut sums: MortonMap<[f32; 2]> = MortonMap::default();
        for ((&place, &vote), &bits) in self.regions.iter().zip(&votes).zip(&self.bits) {
            let of_region = sums.entry(place).or_default();
            of_region[0] += vote;
            of_region[1] += bits;
        }
        let share = |place: u64| {
            let around = surfabet_geom::cells::around(of_key(place));
            let [votes, bits] = around
                .filter_map(|cell| sums.get(&key(cell)))
                .fold([0.0, 0.0], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
            votes / bits.max(f32::MIN_POSITIVE)
        };
        let shares: MortonMap<f32> = sums.keys().map(|&place| (place, share(place))).collect();
        let agreed = fits.into_iter().filter_map(|of| {
            let bits = self.bits[of.leaf as usize];
            let own = votes[of.leaf as usize] / bits - OWN_MARGIN;
            let share = shares[&self.regions[of.leaf as usize]].max(own);
            (share > 0.0).then_some(RepeatedPatch { gain: share * bits, ..of })
        });
        agreed.collect()
    }

    /// Lets patches go with a motion that most of the surface around them goes with: by chance one is described that is not there in
    /// the copy before, but its samples are.
    pub fn spread(&self, of_leaves: &mut [u16]) {
        let mut sums: MortonMap<BTreeMap<u16, f32>> = MortonMap::default();
        for ((&place, &of), &bits) in self.regions.iter().zip(&*of_leaves).zip(&self.bits) {
            *sums.entry(place).or_default().entry(of).or_default() += bits;
        }
        let most = |place: u64| {
            let mut around: BTreeMap<u16, f32> = BTreeMap::new();
            let near = surfabet_geom::cells::around(of_key(place));
            for (&of, bits) in near.filter_map(|cell| sums.get(&key(cell))).flatten() {
                *around.entry(of).or_default() += bits;
            }
            let all: f32 = around.values().sum();
            let most = around.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            most.filter(|(_, bits)| *bits >= SPREAD_SHARE * all).map_or(0, |(of, _)| of)
        };
        let most: MortonMap<u16> = sums.keys().map(|&place| (place, most(place))).collect();
        for (of, place) in of_leaves.iter_mut().zip(&self.regions).filter(|(of, _)| **of == 0) {
            *of = most[place];
        }
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
        Some(Described { leaf, samples, each: *each, positions, gain, sources })
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
        Some(Described { leaf, samples: &[], each: 0.0, positions: Vec::new(), gain, sources })
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
