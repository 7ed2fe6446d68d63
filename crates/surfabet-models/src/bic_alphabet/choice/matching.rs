//! The word of every feature: that of least descriptor distance (III-C).

use surfabet_base::parallel;

use crate::bic_alphabet::features::{Descriptors, descriptor_distance};
use crate::bic_alphabet::words::BicWord;

/// The word of every feature, and the distance of their descriptors. Of words equally near the newest is taken, so that
/// a candidate always takes its own feature, and may replace a word with the same descriptor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::bic_alphabet) struct Matching {
    /// By feature; `u32::MAX` without a word.
    pub words: Vec<u32>,
    /// Squared distances in height steps; `u32::MAX` without a word.
    pub distances: Vec<u32>,
}

impl Matching {
    /// No feature has a word yet.
    pub fn none(features: usize) -> Self {
        Self { words: vec![u32::MAX; features], distances: vec![u32::MAX; features] }
    }

    /// Matches every feature with the words of an alphabet.
    pub fn new(descriptors: &Descriptors, words: &[BicWord], penalty: i32) -> Self {
        let nearest = |descriptor: &[i8]| {
            let all = (0..).zip(words).map(|(id, w)| {
                (descriptor_distance(descriptor, &w.descriptor, penalty), std::cmp::Reverse(id))
            });
            all.min().map_or((u32::MAX, u32::MAX), |(d, id)| (id.0, d))
        };
        let found = parallel::map_chunks(&descriptors.values, descriptors.pixels, nearest);
        let (words, distances) = found.into_iter().unzip();
        Self { words, distances }
    }

    /// Features whose word a candidate with these distances would replace.
    pub fn taken(&self, distances: &[u32], out: &mut Vec<u32>) {
        out.clear();
        let pairs = (0..).zip(distances.iter().zip(&self.distances));
        out.extend(pairs.filter(|(_, (new, old))| new <= old).map(|(f, _): (u32, _)| f));
    }

    /// Makes `word` the word of the features that it takes.
    pub fn assign(&mut self, word: u32, taken: &[u32], distances: &[u32]) {
        for &f in taken {
            self.words[f as usize] = word;
            self.distances[f as usize] = distances[f as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn word_by_word_is_the_same_as_all_at_once(
            values in prop::collection::vec(-3_i8..3, 4 * 30),
            chosen in prop::collection::vec(0_usize..30, 1..8),
        ) {
            let descriptors = Descriptors { pixels: 4, values, counts: vec![9; 30] };
            let words: Vec<BicWord> = chosen
                .iter()
                .map(|&c| descriptors.values[4 * c..4 * c + 4].to_vec())
                .map(|descriptor| BicWord { points: Vec::new(), descriptor })
                .collect();
            let mut grown = Matching::none(30);
            let (mut distances, mut taken) = (Vec::new(), Vec::new());
            for (id, word) in (0..).zip(&words) {
                descriptors.distances(&word.descriptor, 2, &mut distances);
                grown.taken(&distances, &mut taken);
                prop_assert!(taken.contains(&(chosen[id as usize] as u32)));
                grown.assign(id, &taken, &distances);
            }
            prop_assert_eq!(grown, Matching::new(&descriptors, &words, 2));
        }
    }
}
