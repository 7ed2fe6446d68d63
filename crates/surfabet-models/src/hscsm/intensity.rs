//! Intensities in the place of colours: grey between two limits, for clouds without colours.

use surfabet_geom::PointCloud;

use super::constants::CLAMPED_SHARE;

/// Largest grey level.
const WHITE: f64 = 255.0;

/// Intensities that black and white stand for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IntensityLimits {
    /// Intensity of grey level 0.
    pub low: f64,
    /// Intensity of grey level 255.
    pub high: f64,
}

impl IntensityLimits {
    /// The limits for a cloud whose intensities take the place of colours; `None` with colours, and without
    /// intensities that are finite.
    pub(super) fn in_place_of_colors(cloud: &PointCloud) -> Option<Self> {
        match cloud.colors() {
            Some(_) => None,
            None => Self::of(cloud.intensities()?),
        }
    }

    /// The least and the largest of the finite values, where at each end the [`CLAMPED_SHARE`] of them is left out;
    /// of all where these are the same. `None` without finite values.
    fn of(values: &[f32]) -> Option<Self> {
        let mut finite: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
        if finite.is_empty() {
            return None;
        }
        finite.sort_unstable_by(f32::total_cmp);
        let limits = |left_out: usize| Self {
            low: f64::from(finite[left_out]),
            high: f64::from(finite[finite.len() - 1 - left_out]),
        };
        // Less than half of the values, so one is left.
        let robust = limits((CLAMPED_SHARE * finite.len() as f64) as usize);
        Some(if robust.low < robust.high { robust } else { limits(0) })
    }

    /// What is wrong with the limits of a file.
    ///
    /// # Errors
    /// An error when they are in the wrong order or not those of intensities, which are in single precision.
    pub fn check(&self) -> Result<(), String> {
        let Self { low, high } = *self;
        let is_single = |v: f64| v.abs() <= f64::from(f32::MAX);
        if !(is_single(low) && is_single(high) && low <= high) {
            return Err(format!("intensities from {low:e} to {high:e}"));
        }
        Ok(())
    }

    /// Grey level of a finite intensity, 0 to 255; 0 where both limits are the same.
    fn grey(&self, intensity: f32) -> f32 {
        let Self { low, high } = *self;
        let share = (f64::from(intensity).clamp(low, high) - low) / (high - low);
        if low < high { (WHITE * share) as f32 } else { 0.0 }
    }

    /// Intensity of a decoded pixel: of the mean of its red, green and blue, within the limits.
    pub(super) fn intensity(&self, rgb: [f32; 3]) -> f32 {
        let mean = rgb.into_iter().map(f64::from).sum::<f64>() / 3.0;
        // Coefficients of hostile files can add up to no number.
        let share = if mean.is_nan() { 0.0 } else { mean.clamp(0.0, WHITE) / WHITE };
        (self.low + (self.high - self.low) * share).clamp(self.low, self.high) as f32
    }
}

/// What the colour images of a cloud show.
pub(super) enum Shades<'a> {
    /// Neither colours nor intensities.
    Nothing,
    Colors(&'a [[u8; 3]]),
    /// Grey level of each point's intensity.
    Greys(Vec<f32>),
}

impl<'a> Shades<'a> {
    /// The colours of the cloud, else its intensities between these limits.
    pub fn of(cloud: &'a PointCloud, limits: Option<IntensityLimits>) -> Self {
        let (Some(limits), Some(values)) = (limits, cloud.intensities()) else {
            return cloud.colors().map_or(Self::Nothing, Self::Colors);
        };
        Self::Greys(values.iter().map(|&v| limits.grey(v)).collect())
    }

    /// True when the patches have colour images.
    pub fn are_there(&self) -> bool {
        !matches!(self, Self::Nothing)
    }

    /// Red, green and blue of a point, 0 to 255; zero without.
    pub fn of_point(&self, i: usize) -> [f32; 3] {
        match self {
            Self::Nothing => [0.0; 3],
            Self::Colors(colors) => colors[i].map(f32::from),
            Self::Greys(greys) => [greys[i]; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn intensities_within_the_limits_come_back(
            values in prop::collection::vec(-1e9_f32..1e9, 1..200),
        ) {
            let limits = IntensityLimits::of(&values).unwrap();
            prop_assert_eq!(limits.check(), Ok(()));
            for v in values {
                let back = f64::from(limits.intensity([limits.grey(v); 3])) - f64::from(v);
                // Two roundings to single: of grey levels, and of intensities.
                let scale = (limits.high - limits.low) + limits.low.abs().max(limits.high.abs());
                prop_assert!(back.abs() <= scale * f64::from(f32::EPSILON), "{v}: {back}");
            }
        }
    }

    #[test]
    fn a_thousandth_of_the_values_is_clamped_at_each_end() {
        let mut values: Vec<f32> = (0..2000).map(|i| i as f32).collect();
        values[0] = -1e30;
        values[1999] = 1e30;
        values.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let limits = IntensityLimits::of(&values).unwrap();
        assert_eq!(limits, IntensityLimits { low: 2.0, high: 1997.0 });
        assert_eq!([limits.grey(-1e30), limits.grey(1e30)], [0.0, 255.0]);
        // Of fewer than a thousand none.
        let limits = IntensityLimits::of(&values[..999]).unwrap();
        assert_eq!(limits, IntensityLimits { low: f64::from(-1e30_f32), high: 998.0 });
    }

    #[test]
    fn limits_of_one_value_and_of_the_largest_values() {
        let same = IntensityLimits::of(&[7.0, f32::NAN, 7.0]).unwrap();
        assert_eq!(same, IntensityLimits { low: 7.0, high: 7.0 });
        assert_eq!((same.grey(7.0), same.intensity([255.0, 0.0, 9.0])), (0.0, 7.0));
        assert_eq!(IntensityLimits::of(&[f32::NAN, f32::INFINITY]), None);
        // One value in a few thousand others that are the same is not lost.
        let mut values = vec![0.0; 5000];
        values[17] = 4.0;
        assert_eq!(IntensityLimits::of(&values).unwrap(), IntensityLimits { low: 0.0, high: 4.0 });
        let widest = IntensityLimits::of(&[f32::MIN, f32::MAX]).unwrap();
        assert_eq!(widest.check(), Ok(()));
        assert_eq!(widest.intensity([widest.grey(f32::MAX); 3]), f32::MAX);
        assert_eq!(widest.intensity([f32::NAN; 3]), f32::MIN);
    }

    #[test]
    fn limits_of_no_model_are_told() {
        for (low, high) in [(1.0, 0.5), (f64::NAN, 1.0), (0.0, f64::INFINITY), (-1e300, 1e300)] {
            assert!(IntensityLimits { low, high }.check().is_err(), "{low} {high}");
        }
    }
}
