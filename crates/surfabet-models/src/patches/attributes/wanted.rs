//! When learning: the values that cells should have, so that what is decoded at the samples comes near to theirs.

use super::targets::Targets;
use crate::patches::constants::{AGAIN_DAMPING, AGAIN_LENGTH};

/// Values of the samples, which those of the cells are to come near to when they are blended.
pub(in crate::patches) struct Wanted<'a, const N: usize> {
    targets: &'a Targets<'a>,
    of_samples: Vec<Option<[f32; N]>>,
}

impl<'a, const N: usize> Wanted<'a, N> {
    /// Of samples with these values.
    pub(super) fn new(targets: &'a Targets<'a>, of_samples: Vec<Option<[f32; N]>>) -> Self {
        Self { targets, of_samples }
    }

    /// The values that are to be coded at first.
    ///
    /// A mean over each cell, blended with its neighbours, would be smoother than the samples are. So what the blend `A` of
    /// the means `t` misses of the samples `y` is added to the cells that each was blended from:
    /// `t + (A' 1)^-1 A' (y - A t)`, with the quotient by cell, one step of back projection.
    pub(super) fn at_first(&self) -> Vec<[f32; N]> {
        let means = self.targets.means(&self.of_samples);
        if self.targets.is_unblended() { means } else { self.nearer(means, 1.0, 0.0) }
    }

    /// The values that are to be coded once it is known what is `decoded`: these and a longer step of back projection from them. So what
    /// rounding one cell misses its neighbours make up for, and a cell without samples is to stay what it costs least to be.
    /// `None` where nothing is blended.
    pub(super) fn again(&self, decoded: &[[f32; N]]) -> Option<Vec<[f32; N]>> {
        let again = || self.nearer(decoded.to_vec(), AGAIN_LENGTH, AGAIN_DAMPING);
        (!self.targets.is_unblended()).then(again)
    }

    /// A step of back projection, of so many times the length; cells of few samples go less far with some `damping`.
    fn nearer(&self, mut values: Vec<[f32; N]>, length: f32, damping: f32) -> Vec<[f32; N]> {
        let missed = self.targets.missed(&values, &self.of_samples);
        for (value, (sum, weight)) in values.iter_mut().zip(missed) {
            if weight > 0.0 {
                (0..N).for_each(|c| value[c] += length * sum[c] / (weight + damping));
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use surfabet_base::Silent;
    use surfabet_geom::{PointCloud, Survey};

    use super::*;
    use crate::patches::attributes::cells::cell_key;
    use crate::patches::model::Lattice;
    use crate::patches::samples::{SidedSamples, Weights};
    use crate::sensor::Sensor;

    /// Position of sample i along a line of cells of one metre, with two samples in each.
    fn place(i: usize) -> f32 {
        0.5 * i as f32 + 0.25
    }

    /// Values that are wanted again where the cells of the line have those of `decoded` and the samples `values`.
    fn again(values: &[f32], decoded: &[[f32; 1]]) -> Vec<[f32; 1]> {
        let positions = (0..values.len()).map(|i| [place(i), 0.5, 0.5]).collect();
        let (cloud, _) = PointCloud::from_positions(positions);
        let lattice = Lattice { pixel_size: 1.0, levels: 1, ..Lattice::default() };
        let weights = Weights::of(Sensor::Constant);
        let samples =
            SidedSamples::merge(&cloud, &lattice, weights, &Survey::default(), &Silent).unwrap();
        let first = cloud.positions()[0][0].floor() as i32;
        let cells: Vec<u64> =
            (0..decoded.len() as i32).map(|x| cell_key([first + x, 0, 0])).collect();
        let targets = Targets::new(&samples, &cells, None, 1.0);
        targets.wanted(|i| [f64::from(values[i])]).again(decoded).unwrap()
    }

    /// Sum of the squares that values of samples differ by from linear interpolation between the middles of the cells.
    fn missed(values: &[f32], cells: &[[f32; 1]]) -> f32 {
        let last = cells.len() as f32 - 1.0;
        let blend = |x: f32| {
            let from_first = (x - 0.5).clamp(0.0, last);
            let (low, high) = (from_first.floor(), from_first.ceil());
            let [a, b] = [low, high].map(|c| cells[c as usize][0]);
            a + (from_first - low) * (b - a)
        };
        values.iter().enumerate().map(|(i, v)| (v - blend(place(i))).powi(2)).sum()
    }

    proptest! {
        /// Of A with rows that sum to one `A' A` is at most the diagonal of `A' 1`, so that steps of less than twice the length
        /// of one of back projection come nearer.
        #[test]
        fn what_is_wanted_again_comes_nearer_to_the_samples(
            cells in prop::collection::vec((0.0_f32..255.0, 0.0_f32..255.0, 0.0_f32..255.0), 2..12),
        ) {
            let values: Vec<f32> = cells.iter().flat_map(|&(a, b, _)| [a, b]).collect();
            let decoded: Vec<[f32; 1]> = cells.iter().map(|&(.., c)| [c]).collect();
            let nearer = again(&values, &decoded);
            let [before, after] = [&decoded, &nearer].map(|cells| missed(&values, cells));
            prop_assert!(after <= before * 1.0001 + 0.01, "{before} {after}");
        }
    }

    #[test]
    fn cells_that_blend_to_the_samples_stay() {
        let cells: Vec<[f32; 1]> = [10.0, 30.0, 20.0, 90.0, 90.0].map(|c| [c]).to_vec();
        let values = [10.0, 15.0, 25.0, 27.5, 22.5, 37.5, 72.5, 90.0, 90.0, 90.0];
        assert!(missed(&values, &cells) < 1e-6);
        for (wanted, cell) in again(&values, &cells).iter().zip(&cells) {
            assert!((wanted[0] - cell[0]).abs() < 1e-4, "{wanted:?} {cell:?}");
        }
    }
}
