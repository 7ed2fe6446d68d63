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
