//! Places of one kind.

use surfabet_models::{Error, Result};

use crate::PlaceSignature;
use crate::constants::{COMMON, NO_SHARE, SAME_SHARE};

/// Least mean similarity within a kind, unless another or a number of kinds is given. Of 0.4 to 0.6 the best on simulated rooms 0 to 7
/// (`docs/benchmarks/constants.md`).
pub const KIND_SIMILARITY: f64 = 0.5;

/// A number per place, equal for places of one kind, and the similarity of every two places; kinds are numbered from 0 by their first
/// place.
///
/// Kinds are joined by average linkage: the two with the largest mean similarity between their places become one, until `n_kinds` are
/// left or, without that number, until the mean falls below `min_similarity`.
///
/// Similarity, 0 to 1, is of how much stands at which height above the floor, level, sloped or steep. It is relative to the places
/// given: as with the inverse document frequency of words in texts, what all of them have, such as walls and a floor, counts little,
/// and what tells some of them from others counts most.
///
/// # Errors
/// [`Error::InvalidParameter`] for `n_kinds` of 0 or `min_similarity` outside of 0 to 1.
pub fn label_places(
    places: &[&PlaceSignature],
    n_kinds: Option<usize>,
    min_similarity: f64,
) -> Result<(Vec<u32>, Vec<Vec<f64>>)> {
    let invalid = |name, value: String, requirement| {
        let error = surfabet_geom::InvalidParameter::new(name, value, requirement);
        Err(Error::InvalidParameter(error))
    };
    if n_kinds == Some(0) {
        return invalid("n_kinds", "0".into(), "at least 1");
    }
    if !(0.0..=1.0).contains(&min_similarity) {
        return invalid("min_similarity", min_similarity.to_string(), "from 0 to 1");
    }
    let similarities = similarities(places);
    let mut kinds: Vec<Vec<usize>> = (0..places.len()).map(|i| vec![i]).collect();
    while kinds.len() > n_kinds.unwrap_or(1) {
        let Some((i, j, mean)) = closest(&kinds, &similarities) else { break };
        if n_kinds.is_none() && mean < min_similarity {
            break;
        }
        let joined = kinds.remove(j);
        kinds[i].extend(joined);
    }
    kinds.sort_by_key(|kind| kind.iter().min().copied());
    let mut labels = vec![0; places.len()];
    for (label, kind) in kinds.iter().enumerate() {
        kind.iter().for_each(|&i| labels[i] = label as u32);
    }
    Ok((labels, similarities))
}

/// Similarity of every two places: `max(0, cosine)` of their vectors `(z, COMMON)`, with z the logarithm of the share of area of each
/// class of height and inclination, about its mean over all places and over its deviation between them:
///
/// ```text
/// z = (l - mean l) / sqrt(var l + SAME_SHARE^2) / sqrt(number of classes),  l = ln(share + NO_SHARE)
/// ```
fn similarities(places: &[&PlaceSignature]) -> Vec<Vec<f64>> {
    let n = places.len() as f64;
    let mut vectors: Vec<Vec<f64>> = places
        .iter()
        .map(|p| p.layers().iter().map(|share| (share + NO_SHARE).ln()).collect())
        .collect();
    let classes = vectors.first().map_or(0, Vec::len);
    for k in 0..classes {
        let mean = vectors.iter().map(|v| v[k]).sum::<f64>() / n;
        let variance = vectors.iter().map(|v| (v[k] - mean).powi(2)).sum::<f64>() / n;
        let scale = ((variance + SAME_SHARE * SAME_SHARE) * classes as f64).sqrt();
        vectors.iter_mut().for_each(|v| v[k] = (v[k] - mean) / scale);
    }
    vectors.iter_mut().for_each(|v| v.push(COMMON));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let lengths: Vec<f64> = vectors.iter().map(|v| dot(v, v).sqrt()).collect();
    let similarity = |i: usize, j: usize| {
        (dot(&vectors[i], &vectors[j]) / (lengths[i] * lengths[j])).clamp(0.0, 1.0)
    };
    (0..places.len()).map(|i| (0..places.len()).map(|j| similarity(i, j)).collect()).collect()
}

/// The two kinds with the largest mean similarity between their places, the first of equal ones.
fn closest(kinds: &[Vec<usize>], similarities: &[Vec<f64>]) -> Option<(usize, usize, f64)> {
    let mean = |a: &[usize], b: &[usize]| {
        let sum: f64 = a.iter().map(|&i| b.iter().map(|&j| similarities[i][j]).sum::<f64>()).sum();
        sum / (a.len() * b.len()) as f64
    };
    let mut best: Option<(usize, usize, f64)> = None;
    for i in 0..kinds.len() {
        for j in i + 1..kinds.len() {
            let mean = mean(&kinds[i], &kinds[j]);
            if best.is_none_or(|(_, _, most)| mean > most) {
                best = Some((i, j, mean));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};
    use surfabet_models::alphabet::{AlphabetOptions, learn};

    use super::*;

    /// A floor with walls on two sides, or without.
    fn place(x: f64, y: f64, walls: f64) -> PlaceSignature {
        let mut points = Vec::new();
        for i in 0..3600 {
            let [u, v] = [f64::from(i % 60) / 60.0, f64::from(i / 60) / 60.0];
            points.push([x * u, y * v, 0.0]);
            if walls > 0.0 {
                points.push([x * u, 0.0, walls * v]);
                points.push([0.0, y * u, walls * v]);
            }
        }
        let points = points.into_iter().map(|p: [f64; 3]| p.map(|c| c as f32)).collect();
        let (cloud, _) = PointCloud::from_positions(points);
        let options = AlphabetOptions { radius: Some(0.1), ..AlphabetOptions::default() };
        PlaceSignature::of(&learn(&cloud, &options, &Silent).unwrap(), &Silent).unwrap()
    }

    #[test]
    fn the_most_similar_places_become_one_kind_first() {
        let places = [
            place(4.0, 3.0, 2.5),
            place(6.0, 5.0, 0.0),
            place(4.2, 3.1, 2.5),
            place(5.0, 5.0, 0.0),
        ];
        let all: Vec<&PlaceSignature> = places.iter().collect();
        let labels = |n| label_places(&all, n, KIND_SIMILARITY).unwrap().0;
        assert_eq!(labels(Some(2)), [0, 1, 0, 1]);
        assert_eq!(labels(Some(4)), [0, 1, 2, 3]);
        assert_eq!(labels(Some(1)), [0; 4]);
        let least = |least| label_places(&all, None, least).unwrap().0;
        assert_eq!(least(KIND_SIMILARITY), [0, 1, 0, 1]);
        assert_eq!(least(1.0), [0, 1, 2, 3]);
        assert_eq!(least(0.0), [0; 4]);
    }

    #[test]
    fn options_outside_their_domain_are_refused() {
        let of = |n, least| label_places(&[], n, least).map_err(|e| e.to_string());
        assert!(of(Some(0), 0.5).unwrap_err().starts_with("n_kinds is 0"));
        assert!(of(None, 1.1).unwrap_err().starts_with("min_similarity is 1.1"));
        assert!(of(None, f64::NAN).is_err());
        assert_eq!(of(None, 0.5), Ok((vec![], vec![])));
    }
}
