//! Places of one kind.

use surfabet_models::{Error, Result};

use crate::PlaceSignature;

/// Least mean similarity of words within a kind, unless another or a number of kinds is given. A first value: not measured yet
/// (`docs/benchmarks/recognition.md`).
pub const KIND_SIMILARITY: f64 = 0.9;

/// A number per place, equal for places of one kind; kinds are numbered from 0 by their first place.
///
/// Kinds are joined by average linkage: the two with the largest mean similarity of words
/// ([`PlaceSignature::word_similarity`]) between their places become one, until `n_kinds` are left or, without that number,
/// until the mean falls below `min_similarity`.
///
/// # Errors
/// [`Error::InvalidParameter`] for `n_kinds` of 0 or `min_similarity` outside of 0 to 1.
pub fn label_places(
    places: &[&PlaceSignature],
    n_kinds: Option<usize>,
    min_similarity: f64,
) -> Result<Vec<u32>> {
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
    let similarities: Vec<Vec<f64>> =
        places.iter().map(|a| places.iter().map(|b| a.word_similarity(b)).collect()).collect();
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
    Ok(labels)
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
        let labels = |n| label_places(&all, n, KIND_SIMILARITY).unwrap();
        assert_eq!(labels(Some(2)), [0, 1, 0, 1]);
        assert_eq!(labels(Some(4)), [0, 1, 2, 3]);
        assert_eq!(labels(Some(1)), [0; 4]);
        assert_eq!(label_places(&all, None, 1.0).unwrap().len(), 4);
        assert_eq!(label_places(&all, None, 0.0).unwrap(), [0; 4]);
    }

    #[test]
    fn options_outside_their_domain_are_refused() {
        let of = |n, least| label_places(&[], n, least).map_err(|e| e.to_string());
        assert!(of(Some(0), 0.5).unwrap_err().starts_with("n_kinds is 0"));
        assert!(of(None, 1.1).unwrap_err().starts_with("min_similarity is 1.1"));
        assert!(of(None, f64::NAN).is_err());
        assert_eq!(of(None, 0.5), Ok(vec![]));
    }
}
