//! The price of points beside the patches, for the samples that no patch is near enough to.

use super::misfit::Slab;
use crate::patches::constants::{
    DECODED_WEIGHT, DECODED_WEIGHT_WITHIN_TOLERANCE, EXTRA_CELL, POINT_BITS, POINT_REACH,
    SAMPLE_SIZE,
};

/// What it costs to leave samples out where points will stand for them.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) struct PointPrice {
    /// Samples further than this from the decoded slab need a point, finest pixels.
    reach: f32,
    /// Bits of the points of a sample.
    per_sample: f32,
    /// How much the depth of decoded points that is off counts against that of input points.
    pub decoded_weight: f32,
}

impl PointPrice {
    /// For points that keep a bound on the error, with finest pixels of `pixel_size`, both metres.
    pub fn of_bound(bound: f64, pixel_size: f64) -> Self {
        let bound = bound / pixel_size;
        // On a surface, a cell of points that is larger than those of the samples holds several of these.
        let points_per_sample = (SAMPLE_SIZE / (EXTRA_CELL * bound)).powi(2).min(1.0);
        Self {
            reach: (POINT_REACH * bound) as f32,
            per_sample: (POINT_BITS * points_per_sample) as f32,
            decoded_weight: DECODED_WEIGHT,
        }
    }

    /// The same for points that bring the input within a tolerance, which is less than a pixel: what is left to choose then is
    /// how far decoded points are from the input.
    pub fn of_tolerance(tolerance: f64, pixel_size: f64) -> Self {
        let decoded_weight = DECODED_WEIGHT_WITHIN_TOLERANCE;
        Self { decoded_weight, ..Self::of_bound(tolerance, pixel_size) }
    }

    /// The same with this share of the bits.
    pub fn scaled(self, share: f64) -> Self {
        Self { per_sample: (f64::from(self.per_sample) * share) as f32, ..self }
    }

    /// Bits of the points that stand for `n` samples.
    pub fn bits(&self, n: f32) -> f32 {
        self.per_sample * n
    }

    /// True for a run whose samples need points: `distance` pixels lie between the middles of its pixel and of the nearest one
    /// that is decoded, of which half a pixel is decoded too.
    pub fn is_beyond(&self, distance: f32) -> bool {
        distance > self.reach + 0.5
    }

    /// Bits of the points for the part of a run of `n` samples that is not reached by what is decoded.
    pub(super) fn bits_beyond(&self, run: Slab, n: f32, decoded: Slab) -> f32 {
        self.bits(n * share_beyond(run, decoded.depth, decoded.half + self.reach))
    }
}

/// Share of a run, spread evenly over its thickness, that is further than `reach` from `depth`.
fn share_beyond(run: Slab, depth: f32, reach: f32) -> f32 {
    let off = (run.depth - depth).abs();
    let above = off + run.half - reach;
    let below = run.half - off - reach;
    let length = 2.0 * run.half;
    (above.max(0.0) + below.max(0.0)).min(length) / length
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slab(depth: f32, half: f32) -> Slab {
        Slab { depth, half }
    }

    proptest! {
        #[test]
        fn the_share_beyond_is_that_of_evenly_spread_points(
            depth in -4.0_f32..4.0, half in 0.25_f32..3.0, of in -4.0_f32..4.0, reach in 0.1_f32..3.0,
        ) {
            let n = 4000;
            let at = |i: i32| depth - half + 2.0 * half * (i as f32 + 0.5) / n as f32;
            let beyond = (0..n).filter(|&i| (at(i) - of).abs() > reach).count() as f32 / n as f32;
            let share = share_beyond(slab(depth, half), of, reach);
            prop_assert!((share - beyond).abs() < 1e-3, "{share} {beyond}");
        }
    }

    #[test]
    fn what_is_reached_costs_nothing_and_what_is_not_all_of_its_points() {
        let price = PointPrice::of_bound(0.05, 0.1);
        let bits = |decoded| price.bits_beyond(slab(0.0, 0.25), 8.0, decoded);
        assert_eq!(bits(slab(0.2, 0.25)), 0.0);
        assert_eq!(bits(slab(2.0, 0.25)), price.bits(8.0));
    }

    #[test]
    fn a_large_cell_stands_for_many_samples() {
        let price = |bound: f64| PointPrice::of_bound(bound, 0.1).bits(1.0);
        // Cells of the samples are half a pixel wide; those of points 1.15 bounds: 0.115 m are 2.3 of the former.
        assert_eq!(price(0.01), POINT_BITS as f32);
        assert!((price(0.1) - POINT_BITS as f32 / 2.3_f32.powi(2)).abs() < 1e-4);
    }
}
