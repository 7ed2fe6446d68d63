//! Place similarity: by the words of two scenes, and by how their occurrences lie to each other.
//!
//! | file | what is compared |
//! |---|---|
//! | `word_histogram` | the share of area of each word, radius and inclination |
//! | `word_similarity` | the words by shape, radius and inclination |
//! | `pair_histogram` | distance, height and angle of every pair of occurrences |
//! | `layers` | the share of area by height above the floor and inclination, for kinds of places |
//! | `inclination` | classes of inclination of both |

mod inclination;
mod layers;
mod pair_histogram;
mod word_histogram;
mod word_similarity;

use surfabet_geom::Progress;
use surfabet_models::Result;
use surfabet_models::alphabet::AlphabetModel;

use self::layers::layers;
use self::pair_histogram::{pair_cosine, pair_roots};
pub use self::word_histogram::{WordShare, word_histogram};
use self::word_similarity::UsedWords;
use super::constants::WORDS_WEIGHT;

/// What a place is compared by: its words, how their occurrences lie to each other, and at which heights. Made once per model,
/// compared often.
#[derive(Debug, Clone)]
pub struct PlaceSignature {
    words: UsedWords,
    pairs: Vec<f64>,
    layers: Vec<f64>,
}

impl PlaceSignature {
    /// The signature of a model; of one without occurrences it is empty.
    ///
    /// # Errors
    /// [`surfabet_models::Error::Cancelled`].
    pub fn of(model: &AlphabetModel, progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            words: UsedWords::of(model),
            pairs: pair_roots(model, progress)?,
            layers: layers(model),
        })
    }

    /// Similarity of two places, 0 to 1, as [`place_similarity`].
    pub fn similarity(&self, other: &Self) -> f64 {
        if self.is_empty() || other.is_empty() {
            return f64::from(u8::from(self.is_empty() && other.is_empty()));
        }
        let (words, pairs) =
            (self.words.cosine(&other.words), pair_cosine(&self.pairs, &other.pairs));
        (words.powf(WORDS_WEIGHT) * pairs.powf(1.0 - WORDS_WEIGHT)).clamp(0.0, 1.0)
    }

    /// Shares of area by height above the floor and inclination, which add up to 1; of a model without occurrences all are 0.
    pub(crate) fn layers(&self) -> &[f64] {
        &self.layers
    }

    /// Whether the model has no occurrences.
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }
}

/// Similarity of two places, 0 to 1: 1 for a model and itself, the same either way, and whatever the heading and the
/// position of the scans.
///
/// A geometric mean of two cosines, `words^w pairs^(1 - w)`: of the words that occur, by shape, radius and inclination,
/// so that the alphabets may differ; and of how occurrences lie to each other: distance, height and angle of every pair.
/// Pairs distinguish one place from another, words one kind of place from another. A model without occurrences is similar only to another
/// one without.
///
/// # Errors
/// [`surfabet_models::Error::Cancelled`].
pub fn place_similarity(
    a: &AlphabetModel,
    b: &AlphabetModel,
    progress: &dyn Progress,
) -> Result<f64> {
    Ok(PlaceSignature::of(a, progress)?.similarity(&PlaceSignature::of(b, progress)?))
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};
    use surfabet_models::alphabet::{AlphabetOptions, learn};

    use super::*;

    /// A room without a ceiling, turned and moved.
    fn room(size: [f64; 3], yaw: f64, shift: [f64; 3]) -> AlphabetModel {
        let [x, y, z] = size;
        let walls = [
            [[x, 0.0, 0.0], [0.0, y, 0.0]],
            [[x, 0.0, 0.0], [0.0, 0.0, z]],
            [[0.0, y, 0.0], [0.0, 0.0, z]],
        ];
        let (s, c) = yaw.sin_cos();
        let mut points = Vec::new();
        for [right, up] in walls {
            for i in 0..3600 {
                let [a, b] = [f64::from(i % 60) / 60.0, f64::from(i / 60) / 60.0];
                let p: [f64; 3] = std::array::from_fn(|k| a * right[k] + b * up[k]);
                let turned = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
                points.push(std::array::from_fn(|k| (turned[k] + shift[k]) as f32));
            }
        }
        let (cloud, _) = PointCloud::from_positions(points);
        learn(&cloud, &AlphabetOptions::default(), &Silent).unwrap()
    }

    #[test]
    fn shares_add_up_to_one() {
        let histogram = word_histogram(&room([4.0, 3.0, 2.5], 0.3, [0.0; 3]));
        assert!((histogram.iter().map(|s| s.share).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(histogram.iter().all(|s| s.share > 0.0));
        // Floors are level, walls steep; nothing lies between.
        let level: f64 = histogram.iter().filter(|s| s.inclination == 3).map(|s| s.share).sum();
        let steep: f64 = histogram.iter().filter(|s| s.inclination == 0).map(|s| s.share).sum();
        assert!(level > 0.2 && steep > 0.4 && level + steep > 0.9, "{level} {steep}");
    }

    #[test]
    fn a_place_is_similar_to_itself_whatever_the_heading() {
        let place = room([4.0, 3.0, 2.5], 0.0, [0.0; 3]);
        let again = room([4.0, 3.0, 2.5], 0.9, [30.0, -7.0, 1.0]);
        let other = room([9.0, 2.0, 2.5], 0.4, [1.0, 1.0, 0.0]);
        let similarity = |a, b| place_similarity(a, b, &Silent).unwrap();
        assert!((similarity(&place, &place) - 1.0).abs() < 1e-9);
        for (a, b) in [(&place, &again), (&place, &other), (&again, &other)] {
            assert_eq!(similarity(a, b), similarity(b, a));
            assert!((0.0..=1.0).contains(&similarity(a, b)));
        }
        assert!(similarity(&place, &again) > 0.9, "{}", similarity(&place, &again));
        assert!(
            similarity(&place, &again) > similarity(&place, &other) + 0.05,
            "{}",
            similarity(&place, &other)
        );
    }
}
