//! Patches that are no surface: through the middle of clutter, across a corner, along something bent, between two surfaces.
//!
//! No single figure separates them. A logistic regression weighs six that each help; what it learned from is
//! in docs/benchmarks/planes.md.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::removal::Removal;
use crate::error::Result;
use crate::planes::constants::{
    CERTAINTY_WEIGHT, FILL_WEIGHT, GAIN_WEIGHT, KURTOSIS_WEIGHT, LEAST_FIGURE, LENGTH_WEIGHT,
    NORMAL_KURTOSIS, SPREAD_WEIGHT, SURFACE_OFFSET,
};
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// Figures by which a surface differs from other patches.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Evidence {
    /// What the likelihood loses without it, per point: something between two surfaces is explained by both.
    gain: f64,
    /// Standard deviation of its points about its plane, in that of the noise: a bent surface has more, one of several thin
    /// layers has less.
    spread: f64,
    /// Fourth moment of these distances by the square of the second: 3 for normal noise, less where a patch cuts a slice
    /// out of something thick, whose sides are sharp.
    kurtosis: f64,
    /// Share of its rectangle that supported tiles cover: most surfaces are rectangles.
    fill: f64,
    /// Mean probability of the points that support it.
    certainty: f64,
    /// Its longer side, in standard deviations of the noise.
    length: f64,
}

impl Evidence {
    /// Of a patch, with the standard deviation of the noise at the angle at which it was seen.
    fn of(points: &Points, patch: &Patch, removal: &Removal, noise: f64) -> Self {
        let (mut second, mut fourth) = (0.0, 0.0);
        for &i in &patch.whole {
            let square = patch.frame.local(points.positions[i as usize])[2].powi(2);
            second += square;
            fourth += square * square;
        }
        let n = patch.whole.len() as f64;
        let [x, y] = patch.tiles.size();
        let exact = second <= 0.0;
        Self {
            gain: removal.loss / removal.mass,
            spread: patch.standard_deviation / noise,
            kurtosis: if exact { NORMAL_KURTOSIS } else { n * fourth / (second * second) },
            fill: patch.tiles.area() / (x * y),
            certainty: removal.mass / n,
            length: x.max(y) / noise,
        }
    }

    /// The probability that a patch with this evidence is one surface: `1 / (1 + exp(-b - sum_k c_k ln x_k))`.
    fn probability(&self) -> f64 {
        let weighed = [
            (GAIN_WEIGHT, self.gain),
            (SPREAD_WEIGHT, self.spread),
            (KURTOSIS_WEIGHT, self.kurtosis),
            (FILL_WEIGHT, self.fill),
            (CERTAINTY_WEIGHT, self.certainty),
            (LENGTH_WEIGHT, self.length),
        ];
        let sum: f64 = weighed.iter().map(|(c, x)| c * x.max(LEAST_FIGURE).ln()).sum();
        1.0 / (1.0 + (-SURFACE_OFFSET - sum).exp())
    }
}

/// The probability of each patch that it is one surface; `noise` is the standard deviation of the points across each.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub(super) fn probabilities(
    points: &Points,
    patches: &[Patch],
    removals: &[Removal],
    noise: &[f64],
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    parallel::try_map_range(patches.len(), |j| {
        progress.check()?;
        Ok(Evidence::of(points, &patches[j], &removals[j], noise[j]).probability())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of normal noise, a filled rectangle, its points on nothing else.
    const SURFACE: Evidence = Evidence {
        gain: 3.0,
        spread: 1.0,
        kurtosis: 3.0,
        fill: 0.8,
        certainty: 0.95,
        length: 100.0,
    };

    #[test]
    fn what_looks_like_a_surface_is_probably_one() {
        assert!(SURFACE.probability() > 0.8);
    }

    #[test]
    fn each_sign_of_something_else_lowers_the_probability() {
        let signs = [
            Evidence { gain: 0.5, ..SURFACE },
            Evidence { spread: 1.5, ..SURFACE },
            Evidence { kurtosis: 1.8, ..SURFACE },
            Evidence { fill: 0.3, ..SURFACE },
            Evidence { length: 5.0, ..SURFACE },
        ];
        for sign in signs {
            assert!(sign.probability() < SURFACE.probability(), "{sign:?}");
        }
        assert!(Evidence { gain: 0.5, spread: 1.5, kurtosis: 1.8, ..SURFACE }.probability() < 0.1);
    }
}
