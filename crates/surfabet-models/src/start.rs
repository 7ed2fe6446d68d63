//! What a method starts from: the cloud without its outliers, its figures, and the options that follow from them.

use std::borrow::Cow;

use surfabet_geom::{PointCloud, Survey};

use crate::error::{Error, Result};
use crate::quality::Quality;
use crate::report::Report;
use crate::stages::Stages;

/// Side of a pixel in standard deviations of the noise, where that is more: finer pixels show noise, not the surface. On
/// flat walls half takes 14 times the bytes and is farther from the true walls (`docs/benchmarks/constants.md`).
const DEVIATIONS_PER_PIXEL: f64 = 1.25;

/// Pixels between two surfaces that lie close behind one another: one between theirs stays empty, so that neither
/// their depths nor their colours mix.
const PIXELS_PER_GAP: f64 = 2.0;

/// Pixels are not finer than this for the sake of such a gap, spacings: of points at random places, whose mean distance to
/// the nearest one is half of what it is on a lattice, each pixel then holds one.
const LEAST_SPACINGS_PER_PIXEL: f64 = 2.0;

/// Pixels between two such surfaces at least, where nobody knows which way surfaces face: of those that face opposite ways
/// a pixel may be wider than the gap.
const LEAST_PIXELS_PER_GAP: f64 = 1.25;

/// Pixels along the diagonal of a scene, at most, far below the limits of files: positions about the middle in 32 bits
/// still resolve a hundredth of such a pixel.
const MOST_PIXELS: f64 = 200_000.0;

/// A length for clouds that have none: of one point, or with all points at one place. Metres; any would do.
const ANY_LENGTH: f64 = 0.01;

/// The tolerance in pixels that were asked for, where it is more than that of the survey: who asks for coarse pixels does
/// not want each point of the scan. Of points that are decoded half a pixel apart one is always as near as this, and pixels that are
/// finer than three spacings have the survey's.
const TOLERANCE_PER_PIXEL: f64 = 2.0 / 3.0;

/// An option that was not given, and what the data made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenOption {
    /// Name of the option.
    pub option: &'static str,
    /// Its value.
    pub value: f64,
    /// Why this value.
    pub reason: String,
}

/// Which points are no part of the scene, unless the user keeps outliers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leave {
    /// Those that would make the scene many times as large as it is.
    Strays,
    /// All that are far from the others.
    Outliers,
}

/// The least side of a pixel where the error is bounded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OfBound {
    /// Metres.
    pub bound: f64,
    /// The side as a share of the bound.
    pub share: f64,
}

/// A cloud with what was measured of it.
pub(crate) struct Start<'a> {
    /// The cloud that is learned from.
    pub cloud: Cow<'a, PointCloud>,
    pub survey: Survey,
    /// Points of the input that were left out, by number, ascending.
    pub left_out: Vec<u32>,
    quality: Quality,
    chosen: Vec<ChosenOption>,
}

impl<'a> Start<'a> {
    /// Measures the cloud, as the first stage, and leaves points out unless `keep_outliers`.
    ///
    /// # Errors
    /// [`Error::EmptyCloud`], [`Error::Cancelled`].
    pub fn of(
        cloud: &'a PointCloud,
        quality: Quality,
        leave: Leave,
        keep_outliers: bool,
        stages: &mut Stages<'_>,
    ) -> Result<Self> {
        stages.run("measuring the cloud", |progress| {
            if cloud.is_empty() {
                return Err(Error::EmptyCloud);
            }
            let survey = Survey::of(cloud, progress)?;
            let left_out = match leave {
                _ if keep_outliers => Vec::new(),
                Leave::Strays => survey.strays.clone(),
                Leave::Outliers => survey.outliers.clone(),
            };
            Self::without(cloud, left_out, survey, quality)
        })
    }

    /// The cloud without the points `left_out`.
    fn without(
        cloud: &'a PointCloud,
        left_out: Vec<u32>,
        survey: Survey,
        quality: Quality,
    ) -> Result<Self> {
        let cloud = if left_out.is_empty() {
            Cow::Borrowed(cloud)
        } else {
            let mut out = left_out.iter().map(|&i| i as usize).peekable();
            let is_kept = |i: &usize| out.next_if_eq(i).is_none();
            let kept: Vec<usize> = (0..cloud.len()).filter(is_kept).collect();
            Cow::Owned(cloud.select(&kept)?)
        };
        Ok(Self { cloud, survey, left_out, quality, chosen: Vec::new() })
    }

    /// Of values per point of the input those of the points that were not left out.
    pub fn kept<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let mut out = self.left_out.iter().map(|&i| i as usize).peekable();
        let mut is_kept = |i: usize| out.next_if_eq(&i).is_none();
        values.iter().enumerate().filter(|(i, _)| is_kept(*i)).map(|(_, &value)| value).collect()
    }

    /// The value of an option: the one that was given, or `value` for this reason, which the report gives.
    pub fn choose(
        &mut self,
        option: &'static str,
        given: Option<f64>,
        value: impl FnOnce(&Survey, Quality) -> (f64, String),
    ) -> f64 {
        given.unwrap_or_else(|| {
            let (value, reason) = value(&self.survey, self.quality);
            self.note(option, value, reason);
            value
        })
    }

    /// Notes the value of an option that follows from the data.
    pub fn note(&mut self, option: &'static str, value: f64, reason: String) {
        self.chosen.push(ChosenOption { option, value, reason });
    }

    /// Side of a pixel, metres: the one that was given, or so many spacings, unless noise, a bound on the error or layers ask for
    /// another.
    pub fn pixel(&mut self, given: Option<f64>, spacings: f64, bound: Option<OfBound>) -> f64 {
        self.choose("resolution", given, |survey, quality| pixel(survey, quality, spacings, bound))
    }

    /// How far a decoded cloud may be from a point and still show it, metres; pixels may have been asked for.
    pub fn tolerance(&self, asked_pixel: Option<f64>) -> f64 {
        let of_data = self.survey.tolerance();
        match (asked_pixel, self.quality) {
            (Some(pixel), _) => of_data.max(TOLERANCE_PER_PIXEL * pixel),
            (None, Quality::Small) => self.quality.scale() * of_data,
            (None, Quality::Balanced | Quality::Fine) => of_data,
        }
    }

    /// Options that were not given, and what the data made of them.
    pub fn into_chosen(self) -> Vec<ChosenOption> {
        self.chosen
    }

    /// Adds to a report what was measured, chosen and left out.
    pub fn report<F>(&self, tolerance: f64, report: &mut Report<F>) {
        report.survey = self.survey.clone();
        report.tolerance = tolerance;
        report.left_out = self.left_out.len();
        report.chosen = self.chosen.clone();
    }
}

/// Side of a pixel by the data, and why: `spacings`, or more for noise or a bound, and less for layers.
fn pixel(
    survey: &Survey,
    quality: Quality,
    spacings: f64,
    bound: Option<OfBound>,
) -> (f64, String) {
    let of_spacing = spacings * survey.spacing;
    let of_noise = DEVIATIONS_PER_PIXEL * survey.noise;
    let scale = quality.scale();
    let (mut side, mut reason) = if of_noise > of_spacing {
        (
            scale * of_noise,
            format!(
                "{} times the noise of {:.3} m",
                scale * DEVIATIONS_PER_PIXEL,
                significant(survey.noise)
            ),
        )
    } else {
        let what = if survey.rounding > 0.0 {
            "times the rounding of coordinates,"
        } else {
            "spacings of"
        };
        (
            scale * of_spacing,
            format!("{} {what} {} m", scale * spacings, significant(survey.spacing)),
        )
    };
    if let Some(OfBound { bound, share }) = bound.filter(|of| scale * of.share * of.bound > side) {
        side = scale * share * bound;
        reason = format!("{} times the bound of {} m", scale * share, significant(bound));
    }
    if let Some(gap) = survey.layer_gap {
        let least = LEAST_SPACINGS_PER_PIXEL * survey.spacing;
        let most = if survey.has_facings { f64::INFINITY } else { gap / LEAST_PIXELS_PER_GAP };
        let apart = (gap / PIXELS_PER_GAP).max(least.min(most));
        if apart < side {
            side = apart;
            reason = format!("surfaces lie {} m behind one another", significant(gap));
        }
    }
    let diagonal = survey.extent().iter().map(|c| c * c).sum::<f64>().sqrt();
    if side < diagonal / MOST_PIXELS {
        side = diagonal / MOST_PIXELS;
        reason = format!("the scene is {} m large", significant(diagonal));
    }
    if side > 0.0 {
        (rounded(side), reason)
    } else {
        (ANY_LENGTH, "all points are at one place".into())
    }
}

/// A length with three digits, so that options can be given again as they are shown.
pub(crate) fn rounded(length: f64) -> f64 {
    // A number that was formatted is one.
    significant(length).parse().unwrap_or(length)
}

/// A length in three digits.
pub(crate) fn significant(length: f64) -> String {
    // With the exponent that rounding may raise.
    let scientific = format!("{length:.2e}");
    let exponent = scientific.split_once('e').and_then(|(_, e)| e.parse::<i32>().ok());
    match (scientific.parse::<f64>(), exponent) {
        (Ok(rounded), Some(exponent)) if rounded.is_finite() => {
            format!("{rounded:.*}", (2 - exponent).max(0) as usize)
        }
        // Not a number, or infinite.
        _ => length.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn survey(spacing: f64, noise: f64) -> Survey {
        let bounds = Some(([0.0; 3], [4.0, 3.0, 2.0]));
        Survey { spacing, noise, bounds, ..Survey::default() }
    }

    #[test]
    fn pixels_follow_the_spacing_the_noise_and_the_layers() {
        let of = |survey: &Survey, quality| pixel(survey, quality, 3.0, None);
        assert_eq!(of(&survey(0.01, 0.001), Quality::Balanced).0, 0.03);
        assert_eq!(of(&survey(0.01, 0.001), Quality::Small).0, 0.06);
        assert_eq!(of(&survey(0.01, 0.001), Quality::Fine).0, 0.015);
        assert_eq!(of(&survey(0.002, 0.008), Quality::Balanced).0, 0.01);
        let layered = |gap| Survey { layer_gap: Some(gap), ..survey(0.01, 0.001) };
        assert_eq!(of(&layered(0.05), Quality::Balanced).0, 0.025);
        // Where it is known which way surfaces face, pixels may be wider than the gap.
        assert_eq!(of(&layered(0.01), Quality::Balanced).0, 0.008);
        let faced = Survey { has_facings: true, ..layered(0.01) };
        assert_eq!(of(&faced, Quality::Balanced).0, 0.02);
        assert_eq!(of(&layered(0.2), Quality::Balanced).0, 0.03);
        assert_eq!(
            of(&survey(0.0, 0.0), Quality::Balanced).0,
            (29.0_f64.sqrt() / MOST_PIXELS * 1e7).round() / 1e7
        );
        assert_eq!(of(&Survey::default(), Quality::Balanced).0, ANY_LENGTH);
    }

    #[test]
    fn pixels_follow_a_bound_where_it_is_more_than_the_data_ask_for() {
        let of = |survey: &Survey, quality, bound| {
            pixel(survey, quality, 3.0, Some(OfBound { bound, share: 0.5 }))
        };
        let cloud = survey(0.01, 0.001);
        assert_eq!(of(&cloud, Quality::Balanced, 0.05).0, 0.03);
        let (side, reason) = of(&cloud, Quality::Balanced, 0.1);
        assert_eq!((side, reason.as_str()), (0.05, "0.5 times the bound of 0.100 m"));
        assert_eq!(of(&cloud, Quality::Fine, 0.1).0, 0.025);
        // Surfaces behind one another are kept apart all the same.
        let layered = Survey { layer_gap: Some(0.05), ..cloud };
        assert_eq!(of(&layered, Quality::Balanced, 0.5).0, 0.025);
    }

    #[test]
    fn lengths_are_shown_with_three_digits() {
        let shown = [0.012345, 1.0, 12345.0, 99.96, 0.00099999].map(significant);
        assert_eq!(shown, ["0.0123", "1.00", "12300", "100", "0.00100"]);
        assert_eq!(rounded(0.012345), 0.0123);
    }
}
