//! How similar the words of two scenes are.

use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::alphabet::{HEIGHT_STEPS, PIXELS, Word};

use super::word_histogram::{WordShare, word_histogram};
use crate::constants::{HALF_HEIGHT_DIFFERENCE, HOLE_DIFFERENCE, RADIUS_WEIGHT};

/// The words of a scene with their shares of its area.
#[derive(Debug, Clone)]
pub(super) struct UsedWords {
    all: Vec<UsedWord>,
    /// `k(a, a)`, see [`Self::cosine`].
    squared: f64,
}

/// A word of a scene in one radius and inclination.
#[derive(Debug, Clone)]
struct UsedWord {
    word: Word,
    radius: f64,
    inclination: u8,
    share: f64,
}

impl UsedWords {
    pub fn of(model: &AlphabetModel) -> Self {
        let words = model.alphabet().words();
        let used = |s: WordShare| UsedWord {
            word: words[usize::from(s.word)].clone(),
            radius: s.radius,
            inclination: s.inclination,
            share: s.share,
        };
        let all: Vec<UsedWord> = word_histogram(model).into_iter().map(used).collect();
        let squared = kernel(&all, &all);
        Self { all, squared }
    }

    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Cosine of two scenes under the kernel `k(a, b) = sum over the words x of a and y of b of share(x) share(y) s(x, y)`
    /// with the similarity s of words by shape, so that the alphabets may differ: `k(a, b) / sqrt(k(a, a) k(b, b))`.
    pub fn cosine(&self, other: &Self) -> f64 {
        // Summed both ways, so that rounding is the same for (a, b) and (b, a).
        let across = 0.5 * (kernel(&self.all, &other.all) + kernel(&other.all, &self.all));
        across / (self.squared * other.squared).sqrt()
    }
}

fn kernel(p: &[UsedWord], q: &[UsedWord]) -> f64 {
    p.iter().map(|x| q.iter().map(|y| x.share * y.share * x.similarity(y)).sum::<f64>()).sum()
}

impl UsedWord {
    /// Similarity of two words as they occur, 1 to 0: `exp(-i^2 - RADIUS_WEIGHT r^2) 2^(-d / HALF_HEIGHT_DIFFERENCE)`, with
    /// i classes of inclination and r octaves of radius between them, and their difference of heights d.
    fn similarity(&self, other: &Self) -> f64 {
        let classes = f64::from(self.inclination.abs_diff(other.inclination));
        let octaves = (self.radius / other.radius).log2();
        let heights = height_difference(&self.word, &other.word) / HALF_HEIGHT_DIFFERENCE;
        (-classes * classes - RADIUS_WEIGHT * octaves * octaves - heights * std::f64::consts::LN_2)
            .exp()
    }
}

/// Mean squared difference of the heights of two words, in squared radii; [`HOLE_DIFFERENCE`] where one has a hole.
fn height_difference(a: &Word, b: &Word) -> f64 {
    let n = PIXELS * PIXELS;
    let of = |k: usize| match (a.mask >> k & 1, b.mask >> k & 1) {
        (1, 1) => {
            (f64::from(i16::from(a.heights[k]) - i16::from(b.heights[k])) / HEIGHT_STEPS).powi(2)
        }
        (0, 0) => 0.0,
        _ => HOLE_DIFFERENCE,
    };
    (0..n).map(of).sum::<f64>() / n as f64
}
