//! Choosing occurrences: rounds of covers at the coder's own prices, words that do not pay dropped, occurrences refined.
//!
//! | file | step |
//! |---|---|
//! | `prices` | what the parts of a description cost |
//! | `cover` | the candidates that shorten the description most (III-D) |
//! | `mod` | the rounds |
//! | `refinement` | each occurrence replaced by the best of its variants |

mod cover;
mod prices;
mod refinement;

use surfabet_entropy::Price;
use surfabet_geom::Progress;

use self::cover::cover;
pub(super) use self::cover::{CoverCounts, add_best};
pub(super) use self::prices::Prices;
use self::prices::word_counts;
use super::candidates::{Candidate, sort_within_places};
use super::coding::{CodingParams, code_words};
use super::constants::{LEAST_SAVING, REFINEMENT_PASSES};
use super::placement::Placement;
use super::scene::{Cells, LatticeScene};
use super::word::Word;
use crate::error::Result;

/// The state of choosing: words and prices change from round to round.
pub(super) struct Choice<'a> {
    pub scene: &'a LatticeScene,
    /// The points of the scene by cells, per scale.
    pub cells: &'a [Cells],
    /// Distance of samples, in sigma.
    pub spacing: f64,
    pub params: CodingParams,
    pub words: Vec<Word>,
    /// Whether words stay as they are.
    pub frozen: bool,
    pub prices: Prices,
    /// Length of the description after every round, bits.
    pub lengths: Vec<f64>,
}

impl Choice<'_> {
    /// Rounds of covering: prices follow what the coder spends, and words that save less than their own bits are
    /// dropped. A last cover follows with the last prices.
    pub fn cover_rounds(
        &mut self,
        candidates: &mut Vec<Candidate>,
        rounds: u32,
        progress: &dyn Progress,
    ) -> Result<(Vec<Candidate>, CoverCounts)> {
        let all = (rounds as usize + 1 + REFINEMENT_PASSES) as f32;
        for round in 0..rounds {
            progress.check()?;
            progress.update("covering", round as f32 / all);
            let (mut chosen, counts) = self.covered(candidates, progress)?;
            self.learn_prices(&chosen, &counts);
            if !self.frozen {
                let paying = self.paying_words(candidates, &chosen, &counts);
                self.keep_words(&paying, candidates, &mut chosen);
            }
            if self.scene.is_coarse && self.saves_little() {
                break;
            }
        }
        self.covered(candidates, progress)
    }

    /// Passes of refining all occurrences, after which those that do not pay are removed, and words that do not occur.
    pub fn refine_rounds(
        &mut self,
        candidates: &mut Vec<Candidate>,
        mut chosen: Vec<Candidate>,
        mut counts: CoverCounts,
        progress: &dyn Progress,
    ) -> Result<Vec<Candidate>> {
        let mut variants = vec![None; chosen.len()];
        for _ in 0..REFINEMENT_PASSES {
            progress.check()?;
            self.refine(&mut chosen, &mut variants, &mut counts, progress)?;
            self.learn_prices(&chosen, &counts);
        }
        chosen.retain(|c| {
            let pays = self.worth(c, &counts) > 0.0;
            if !pays {
                counts.remove(&c.coverage.points);
            }
            pays
        });
        // Two occurrences a step apart can become the same.
        chosen.sort_by_key(|c| c.placement);
        chosen.dedup_by_key(|c| c.placement);
        if !self.frozen {
            let occurs: Vec<bool> =
                word_counts(&chosen, self.words.len()).iter().map(|&n| n > 0).collect();
            self.keep_words(&occurs, candidates, &mut chosen);
        }
        self.learn_prices(&chosen, &counts);
        Ok(chosen)
    }

    /// Whether the last round made the description shorter by less than [`LEAST_SAVING`], or longer.
    fn saves_little(&self) -> bool {
        matches!(self.lengths[..], [.., before, last] if last > (1.0 - LEAST_SAVING) * before)
    }

    /// The cover with the prices at hand.
    fn covered(
        &self,
        candidates: &[Candidate],
        progress: &dyn Progress,
    ) -> Result<(Vec<Candidate>, CoverCounts)> {
        let (chosen, counts) = cover(candidates, &self.prices, &self.scene.weights, progress)?;
        Ok((chosen.iter().map(|&k| candidates[k as usize].clone()).collect(), counts))
    }

    /// `worth(c)`: what removing an occurrence adds to the description.
    fn worth(&self, c: &Candidate, counts: &CoverCounts) -> f32 {
        self.prices.inlier * counts.n_explained_once(&c.coverage.points) - self.prices.cost(c)
    }

    /// Takes over what the coder spends on `chosen`, and adds the length of the whole description to the list: bits of
    /// occurrences and words, of points that are not explained, and of outliers.
    fn learn_prices(&mut self, chosen: &[Candidate], counts: &CoverCounts) {
        let mut price = self.prices.learn(chosen, &self.params);
        let Ok(_) = code_words(&mut price, self.words.len() - 1, &self.words[1..]);
        let outliers: f32 = chosen.iter().map(|c| c.coverage.outliers as f32).sum();
        let misfit = self.prices.inlier * counts.n_unexplained() + self.prices.outlier * outliers;
        self.lengths.push(price.bits + f64::from(misfit));
    }

    /// Which words save at least their own bits. What an occurrence c saves is its worth, less that of the plane p in
    /// its place where that is above 0:
    ///
    /// ```text
    /// worth(p) = inlier * (|points of P(c) and P(p) that only c explains| + |points of P(p) not in P(S)|) - cost(p)
    /// ```
    fn paying_words(
        &self,
        candidates: &[Candidate],
        chosen: &[Candidate],
        counts: &CoverCounts,
    ) -> Vec<bool> {
        let mut saved = vec![0.0; self.words.len()];
        for c in chosen {
            let plane_here = Placement { word: 0, ..c.placement };
            let plane = candidates.binary_search_by_key(&plane_here, |c| c.placement);
            let with = self.worth(c, counts);
            let without = plane.ok().map_or(0.0, |k| {
                let plane = &candidates[k];
                let in_both = |i: &&u32| plane.coverage.points.binary_search(i).is_ok();
                let shared: Vec<u32> = c.coverage.points.iter().filter(in_both).copied().collect();
                let explained =
                    counts.n_explained_once(&shared) + counts.n_open(&plane.coverage.points);
                (self.prices.inlier * explained - self.prices.cost(plane)).max(0.0)
            });
            saved[usize::from(c.placement.word)] += with - without;
        }
        self.words.iter().zip(&saved).map(|(word, &saved)| saved >= word_bits(word)).collect()
    }

    /// Drops the words that are not to be kept, but for the plane, with all candidates of them; the others are numbered
    /// anew, the most frequent first.
    fn keep_words(
        &mut self,
        keep: &[bool],
        candidates: &mut Vec<Candidate>,
        chosen: &mut Vec<Candidate>,
    ) {
        let counts = word_counts(chosen, self.words.len());
        let mut order: Vec<usize> = (1..self.words.len()).filter(|&k| keep[k]).collect();
        order.sort_by_key(|&k| (std::cmp::Reverse(counts[k]), k));
        order.insert(0, 0);
        let mut new_number = vec![None; self.words.len()];
        for (new, &old) in order.iter().enumerate() {
            new_number[old] = Some(new as u16);
        }
        let renumber = |all: &mut Vec<Candidate>| {
            all.retain(|c| new_number[usize::from(c.placement.word)].is_some());
            for c in all.iter_mut() {
                c.placement.word = new_number[usize::from(c.placement.word)].unwrap_or(0);
            }
            sort_within_places(all);
        };
        renumber(candidates);
        renumber(chosen);
        self.words = order.iter().map(|&k| self.words[k].clone()).collect();
        self.prices.word = order.iter().map(|&k| self.prices.word[k]).collect();
        self.params.n_words = self.words.len() as u32;
    }
}

/// Bits of a word in the file.
fn word_bits(word: &Word) -> f32 {
    let mut price = Price::default();
    let Ok(_) = code_words(&mut price, 1, std::slice::from_ref(word));
    price.bits as f32
}
