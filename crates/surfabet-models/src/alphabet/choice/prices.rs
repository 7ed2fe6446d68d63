//! What the parts of a description cost, in bits.

use surfabet_entropy::Price;

use crate::alphabet::candidates::{Candidate, Coverage};
use crate::alphabet::coding::{CodingParams, code_occurrences};
use crate::alphabet::constants::{
    FIRST_OCCURRENCE_BITS, FIRST_PLANE_BITS, FIRST_WORD_BITS, WORD_PRIOR,
};
use crate::alphabet::placement::Placement;

/// What explaining a point is worth and what occurrences cost, in bits.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::alphabet) struct Prices {
    /// A point that is explained.
    pub inlier: f32,
    /// A sample that explains no point.
    pub outlier: f32,
    /// An occurrence, per scale, without its word.
    pub occurrence: Vec<f32>,
    /// Which word it is, per word.
    pub word: Vec<f32>,
}

impl Prices {
    /// Prices before the coder has seen any occurrence.
    pub fn first(inlier: f32, outlier: f32, n_scales: usize, n_words: usize) -> Self {
        let mut word = vec![FIRST_WORD_BITS; n_words];
        word[0] = FIRST_PLANE_BITS;
        Self { inlier, outlier, occurrence: vec![FIRST_OCCURRENCE_BITS; n_scales], word }
    }

    /// `cost(c)`: what a candidate adds to the description whatever else is chosen.
    pub fn cost(&self, candidate: &Candidate) -> f32 {
        self.cost_with(&candidate.placement, candidate.coverage.outliers)
    }

    /// The same of an occurrence with so many outliers.
    fn cost_with(&self, p: &Placement, outliers: u32) -> f32 {
        self.occurrence[usize::from(p.scale)]
            + self.word[usize::from(p.word)]
            + self.outlier * outliers as f32
    }

    /// What a candidate saves when nothing else is chosen.
    pub fn gain_alone(&self, candidate: &Candidate) -> f32 {
        let Coverage { weight, outliers, .. } = candidate.coverage;
        self.gain(&candidate.placement, weight, outliers)
    }

    /// The same of an occurrence that explains points of this weight and has so many outliers.
    pub fn gain(&self, placement: &Placement, weight: u32, outliers: u32) -> f32 {
        self.inlier * weight as f32 - self.cost_with(placement, outliers)
    }

    /// Takes over what the coder spends on `chosen`:
    ///
    /// ```text
    /// word[w] = log2(n / (n_w + 1/2)), n_w of the n occurrences being of word w
    /// occurrence[s] = mean bits of the coder over the occurrences of scale s - mean of word[w] over all occurrences
    /// ```
    ///
    /// A scale without occurrences keeps its price. Gives the price of all occurrences.
    pub fn learn(&mut self, chosen: &[Candidate], params: &CodingParams) -> Price {
        let placements: Vec<Placement> = chosen.iter().map(|c| c.placement).collect();
        let mut taken = vec![(0.0, 0_u32); self.occurrence.len()];
        let mut before = 0.0;
        let mut price = Price::default();
        let mut mark = |price: &Price, p: &Placement| {
            let (bits, n) = &mut taken[usize::from(p.scale)];
            *bits += price.bits - before;
            *n += 1;
            before = price.bits;
        };
        let Ok(_) = code_occurrences(&mut price, params, &placements, usize::MAX, &mut mark);
        let all = placements.len().max(1) as f32;
        let of_word = |&n: &usize| (all / (n as f32 + WORD_PRIOR)).log2();
        self.word = word_counts(chosen, self.word.len()).iter().map(of_word).collect();
        let mean = placements.iter().map(|p| self.word[usize::from(p.word)]).sum::<f32>() / all;
        for (kept, (bits, n)) in self.occurrence.iter_mut().zip(taken) {
            if n > 0 {
                *kept = (bits / f64::from(n)) as f32 - mean;
            }
        }
        price
    }
}

/// How often each word occurs.
pub(super) fn word_counts(chosen: &[Candidate], n_words: usize) -> Vec<usize> {
    let mut counts = vec![0; n_words];
    chosen.iter().for_each(|c| counts[usize::from(c.placement.word)] += 1);
    counts
}
