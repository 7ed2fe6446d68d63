//! How the values of a scalar, such as intensity, become numbers of steps.

use surfabet_base::rounding::round_f64;

use crate::error::{Error, Result};

/// Most steps between the ends of a scale: sums of 32 of them stay exact in 32 bits, single ones in single precision.
pub const MAX_STEPS: f64 = (1 << 20) as f64;

/// Largest number of whole steps: one more for rounding.
pub(crate) const MAX_CODE: i32 = MAX_STEPS as i32 + 1;

/// A scale: `q` steps stand for `low + q step`, limited to `low..=high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarScale {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Rounding of the values, in their own unit.
    pub step: f64,
}

/// Stands for a scale that is not read yet.
impl Default for ScalarScale {
    fn default() -> Self {
        Self { low: 0.0, high: 0.0, step: 1.0 }
    }
}

impl ScalarScale {
    /// The scale of these values with a step of `share` of their standard deviation, but not of less than the 2^20th part
    /// of their range; 1 where all are the same. Values that are not finite are left aside.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for `name` when the values are so large that their variance is not finite.
    pub(crate) fn of(
        name: &str,
        values: impl Iterator<Item = f64> + Clone,
        share: f64,
    ) -> Result<Self> {
        let values = values.filter(|v| v.is_finite());
        let (mut n, mut sum) = (0.0_f64, 0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.clone() {
            (n, sum) = (n + 1.0, sum + v);
            (low, high) = (low.min(v), high.max(v));
        }
        if n == 0.0 {
            return Ok(Self::default());
        }
        let mean = sum / n;
        let deviation = (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        Self::from_range(name, low, high, deviation, share)
    }

    /// As [`ScalarScale::of`] where the range and the standard deviation of the values are known.
    ///
    /// # Errors
    /// As [`ScalarScale::of`].
    pub(crate) fn from_range(
        name: &str,
        low: f64,
        high: f64,
        deviation: f64,
        share: f64,
    ) -> Result<Self> {
        let step = (share * deviation).max((high - low) / MAX_STEPS);
        if !step.is_finite() {
            let given = format!("{name} from {low:e} to {high:e}");
            return Err(Error::invalid("attributes", given, "of values whose variance is finite"));
        }
        let step = if step > 0.0 { step } else { 1.0 };
        Ok(Self { low, high, step })
    }

    /// What is wrong with a scale of a file.
    pub fn check(&self) -> Result<(), String> {
        let Self { low, high, step } = *self;
        let is_finite = [low, high, step].iter().all(|c| c.is_finite());
        if !(is_finite && low <= high && step > 0.0 && (high - low) / step <= f64::from(MAX_CODE)) {
            return Err(format!("a scalar from {low} to {high} in steps of {step}"));
        }
        Ok(())
    }

    /// A value in steps, not rounded.
    pub(crate) fn in_steps(&self, value: f64) -> f64 {
        (value - self.low) / self.step
    }

    /// A value in whole steps; that of the low end where it is not finite.
    pub(crate) fn code(&self, value: f64) -> i32 {
        round_f64(self.in_steps(value).clamp(0.0, f64::from(MAX_CODE))) as i32
    }

    /// The value of a number of steps.
    pub(crate) fn value(&self, steps: f64) -> f64 {
        (self.low + self.step * steps).clamp(self.low, self.high)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn scale(values: &[f64], share: f64) -> ScalarScale {
        ScalarScale::of("a", values.iter().copied(), share).unwrap()
    }

    proptest! {
        #[test]
        fn values_come_back_to_within_half_a_step(
            values in prop::collection::vec(-1e6_f64..1e6, 1..50), share in 0.01_f64..2.0,
        ) {
            let scale = scale(&values, share);
            prop_assert_eq!(scale.check(), Ok(()));
            for v in values {
                let back = scale.value(f64::from(scale.code(v)));
                prop_assert!((back - v).abs() <= 0.5 * scale.step * (1.0 + 1e-9), "{v} {back}");
            }
        }
    }

    #[test]
    fn the_step_is_a_share_of_the_standard_deviation() {
        // Of 1, 2, 3, 4 the variance is 5/4.
        assert!((scale(&[1.0, 2.0, 3.0, 4.0], 0.5).step - 0.5 * 1.25_f64.sqrt()).abs() < 1e-12);
        let same = scale(&[7.0, f64::NAN, 7.0], 0.5);
        assert_eq!(same, ScalarScale { low: 7.0, high: 7.0, step: 1.0 });
        assert_eq!((same.code(7.0), same.value(3.0)), (0, 7.0));
        assert_eq!(scale(&[], 0.5), ScalarScale::default());
        // A share too small for the range.
        assert_eq!(scale(&[0.0, MAX_STEPS], 1e-12).step, 1.0);
    }

    #[test]
    fn too_large_values_are_refused_by_name() {
        let error = ScalarScale::of("range", [0.0, 1e300].into_iter(), 0.5).unwrap_err();
        assert!(error.to_string().contains("range from 0e0 to 1e300"), "{error}");
    }

    #[test]
    fn scales_of_no_model_are_told() {
        let good = ScalarScale { low: -1.0, high: 3.0, step: 0.5 };
        assert_eq!(good.check(), Ok(()));
        for bad in [
            ScalarScale { low: 4.0, ..good },
            ScalarScale { step: 0.0, ..good },
            ScalarScale { step: -0.5, ..good },
            ScalarScale { high: f64::MAX, low: -f64::MAX, step: 1.0 },
            ScalarScale { step: 1e-7, ..good },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
