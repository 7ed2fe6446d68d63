//! Signals with missing or uncertain values: `S` and `W` of HSCSM eq. 1.

use crate::error::{Error, Result};

/// Largest magnitude of a signal value or weight: its square, summed, still fits single precision.
pub const MAX_MAGNITUDE: f32 = 1e15;

/// A borrowed, checked table of signals, one row of `n_features` values each, with optional weights.
///
/// A weight is how much the error of its value counts: 0 for a value that was not observed (the value is
/// ignored), 1 for one that was, anything between for less certain ones. Only the ratios of the weights of a
/// signal matter for its code; across signals they are how much each counts in learning.
#[derive(Debug, Clone, Copy)]
pub struct Signals<'a> {
    n_features: usize,
    values: &'a [f32],
    weights: Option<&'a [f32]>,
}

impl<'a> Signals<'a> {
    /// Signals from signal-major `values` (row `i` is `values[i * n_features..][..n_features]`) and, in the
    /// same layout, `weights`; without weights every value counts 1.
    ///
    /// # Errors
    /// `n_features` is 0, lengths do not fit, a value is not finite or beyond [`MAX_MAGNITUDE`], or a weight
    /// is not finite, negative or beyond it. Values of weight 0 have to be finite too: set them to 0.
    pub fn new(n_features: usize, values: &'a [f32], weights: Option<&'a [f32]>) -> Result<Self> {
        check_rows("signals", n_features, values)?;
        check_numbers("signal", n_features, values, "finite and within ±1e15", |v| {
            v.abs() <= MAX_MAGNITUDE
        })?;
        if let Some(weights) = weights {
            if weights.len() != values.len() {
                return Err(Error::WeightCount { weights: weights.len(), values: values.len() });
            }
            check_numbers("weight row", n_features, weights, "a weight from 0 to 1e15", |w| {
                (0.0..=MAX_MAGNITUDE).contains(&w)
            })?;
        }
        Ok(Self { n_features, values, weights })
    }

    /// Number of values of a signal.
    pub fn n_features(&self) -> usize {
        self.n_features
    }

    /// Number of signals.
    pub fn len(&self) -> usize {
        self.values.len() / self.n_features
    }

    /// True when there are no signals.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// True when the signals carry weights.
    pub fn has_weights(&self) -> bool {
        self.weights.is_some()
    }

    /// The values of signal `i`, missing ones included.
    ///
    /// # Panics
    /// If `i` is not below [`Signals::len`].
    pub fn values(&self, i: usize) -> &'a [f32] {
        &self.values[i * self.n_features..][..self.n_features]
    }

    /// The weights of signal `i`; `None` when every value counts 1.
    ///
    /// # Panics
    /// If `i` is not below [`Signals::len`].
    pub fn weights(&self, i: usize) -> Option<&'a [f32]> {
        self.weights.map(|w| &w[i * self.n_features..][..self.n_features])
    }

    /// True when something of signal `i` is observed and every value of it counts the same.
    ///
    /// # Panics
    /// If `i` is not below [`Signals::len`].
    pub fn is_evenly_weighted(&self, i: usize) -> bool {
        self.weights(i).is_none_or(|w| w[0] > 0.0 && w.iter().all(|&weight| weight == w[0]))
    }

    /// Weighted squared norm of signal `i`, `Σ w s²`.
    ///
    /// # Panics
    /// If `i` is not below [`Signals::len`].
    pub fn energy(&self, i: usize) -> f64 {
        let squares = self.values(i).iter().map(|&v| f64::from(v).powi(2));
        match self.weights(i) {
            None => squares.sum(),
            Some(weights) => squares.zip(weights).map(|(s, &w)| s * f64::from(w)).sum(),
        }
    }
}

/// Refuses empty rows and buffers that are not whole rows.
pub(crate) fn check_rows(name: &'static str, n_features: usize, numbers: &[f32]) -> Result<()> {
    if n_features == 0 {
        return Err(Error::invalid("n_features", 0, "at least 1"));
    }
    if !numbers.len().is_multiple_of(n_features) {
        return Err(Error::RaggedRows { name, found: numbers.len(), n_features });
    }
    Ok(())
}

/// Refuses the first number that does not satisfy `accept`, by row and feature.
pub(crate) fn check_numbers(
    name: &'static str,
    n_features: usize,
    numbers: &[f32],
    requirement: &'static str,
    accept: impl Fn(f32) -> bool,
) -> Result<()> {
    match numbers.iter().position(|&v| !accept(v)) {
        None => Ok(()),
        Some(at) => Err(Error::InvalidNumber {
            name,
            row: at / n_features,
            feature: at % n_features,
            value: numbers[at],
            requirement,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_as_given() {
        let (values, weights) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.0, 0.0, 0.5, 1.0, 1.0, 0.0]);
        let signals = Signals::new(3, &values, Some(&weights)).unwrap();
        assert_eq!(signals.len(), 2);
        assert_eq!(signals.values(1), [4.0, 5.0, 6.0]);
        assert_eq!(signals.weights(0), Some(&[1.0, 0.0, 0.5][..]));
        assert!(!signals.is_evenly_weighted(0));
        let halves = Signals::new(3, &values, Some(&[0.5, 0.5, 0.5, 0.0, 0.0, 0.0])).unwrap();
        assert!(halves.is_evenly_weighted(0), "as if without weights");
        assert!(!halves.is_evenly_weighted(1), "nothing is observed");
        assert!(Signals::new(3, &values, None).unwrap().is_evenly_weighted(1));
        assert!(Signals::new(3, &[], None).unwrap().is_empty());
    }

    #[test]
    fn bad_numbers_are_named() {
        let error = Signals::new(2, &[0.0, 1.0, 2.0, f32::NAN], None).unwrap_err();
        assert!(matches!(error, Error::InvalidNumber { row: 1, feature: 1, .. }), "{error}");
        assert!(Signals::new(2, &[0.0, f32::INFINITY], None).is_err());
        assert!(Signals::new(2, &[0.0, 1e16], None).is_err());
        assert!(Signals::new(2, &[0.0, 1.0], Some(&[1.0, -0.1])).is_err());
        assert!(Signals::new(2, &[0.0, 1.0], Some(&[1.0, f32::NAN])).is_err());
        assert!(matches!(
            Signals::new(2, &[0.0, 1.0], Some(&[1.0])),
            Err(Error::WeightCount { weights: 1, values: 2 })
        ));
        assert!(matches!(Signals::new(2, &[0.0; 3], None), Err(Error::RaggedRows { .. })));
        assert!(Signals::new(0, &[], None).is_err());
    }
}
