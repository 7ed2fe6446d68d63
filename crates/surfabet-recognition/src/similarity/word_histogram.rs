//! What a scene is made of: the share of area of each word, radius and inclination.

use surfabet_models::alphabet::AlphabetModel;
use surfabet_models::alphabet::{PIXELS, Word};

/// Classes of inclination of a normal, from level to steep.
const INCLINATIONS: usize = 4;

/// Share of the surface that one word has in one radius and inclination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WordShare {
    /// Which word.
    pub word: u16,
    /// Its radius, metres.
    pub radius: f64,
    /// Class of the elevation of its normal, in quarters of a right angle: 0 steep (a wall) to 3 level (a floor).
    pub inclination: u8,
    /// Share of the area of all occurrences, 0 to 1.
    pub share: f64,
}

/// The share of area per word, radius and inclination of its normal: ascending by these, without what does not
/// occur. Shares add up to 1; a model without occurrences has none.
pub fn word_histogram(model: &AlphabetModel) -> Vec<WordShare> {
    let words = model.alphabet().words();
    let mut all: Vec<WordShare> = model
        .occurrences()
        .map(|o| WordShare {
            word: o.word,
            radius: o.radius,
            inclination: inclination(o.rows[2][2]),
            share: area(&words[usize::from(o.word)], o.radius),
        })
        .collect();
    let total: f64 = all.iter().map(|s| s.share).sum();
    all.sort_by(|a, b| {
        let radii = a.radius.total_cmp(&b.radius);
        a.word.cmp(&b.word).then(radii).then(a.inclination.cmp(&b.inclination))
    });
    let same = |a: &WordShare, b: &WordShare| {
        (a.word, a.inclination) == (b.word, b.inclination) && a.radius == b.radius
    };
    let merged = |group: &[WordShare]| WordShare {
        share: group.iter().map(|s| s.share).sum::<f64>() / total,
        ..group[0]
    };
    all.chunk_by(same).map(merged).collect()
}

/// Area of the set pixels of a word, square metres.
pub(super) fn area(word: &Word, radius: f64) -> f64 {
    f64::from(word.mask.count_ones()) / (PIXELS * PIXELS) as f64 * (2.0 * radius).powi(2)
}

/// Class of inclination of a normal with the vertical component `z`.
fn inclination(z: f64) -> u8 {
    let quarter = z.abs().min(1.0).asin() / std::f64::consts::FRAC_PI_2 * INCLINATIONS as f64;
    (quarter as u8).min(INCLINATIONS as u8 - 1)
}
