//! Patches that are no surface: through the middle of clutter, across a corner, along something bent, between two surfaces.
//!
//! No single figure separates them, and none means the same whatever the others are: a small network weighs nine; what it learned from
//! is in docs/benchmarks/planes.md.

use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::removal::Removal;
use crate::error::Result;
use crate::planes::constants::{LEAST_FIGURE, NORMAL_KURTOSIS, SURFACE_OFFSET, SURFACE_UNITS};
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
    /// Its longer and its shorter side, in standard deviations of the noise.
    length: f64,
    width: f64,
    /// Share of its points in the cubes of supported tiles: of something with a rim of clutter fewer are.
    near: f64,
    /// Standard deviation of its points about the means of their tiles, in that of the noise: less than `spread` where it is bent or stepped.
    within: f64,
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
            width: x.min(y) / noise,
            near: patch.support.len() as f64 / n,
            within: patch.noise / noise,
        }
    }

    /// The logarithms of the figures.
    fn logarithms(&self) -> [f64; 9] {
        [
            self.gain,
            self.spread,
            self.kurtosis,
            self.fill,
            self.certainty,
            self.length,
            self.width,
            self.near,
            self.within,
        ]
        .map(|x| x.max(LEAST_FIGURE).ln())
    }

    /// The probability that a patch with this evidence is one surface: `1 / (1 + exp(-b - sum_u v_u tanh(b_u + sum_k c_uk ln x_k)))`.
    fn probability(&self) -> f64 {
        let x = self.logarithms();
        let out = SURFACE_UNITS.iter().map(|unit| {
            let sum: f64 = unit.weights.iter().zip(&x).map(|(c, x)| c * x).sum();
            unit.output * (unit.offset + sum).tanh()
        });
        1.0 / (1.0 + (-SURFACE_OFFSET - out.sum::<f64>()).exp())
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
        width: 60.0,
        near: 0.88,
        within: 1.0,
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
            Evidence { length: 5.0, width: 5.0, ..SURFACE },
            Evidence { near: 0.6, ..SURFACE },
        ];
        for sign in signs {
            assert!(sign.probability() < SURFACE.probability(), "{sign:?}");
        }
        assert!(Evidence { gain: 0.5, spread: 1.5, kurtosis: 1.8, ..SURFACE }.probability() < 0.1);
    }

    #[test]
    fn exact_surfaces_of_any_size_are_surfaces() {
        for length in [10.0, 30.0, 100.0, 1000.0] {
            let exact = Evidence { spread: 0.0, within: 0.0, near: 1.0, length, ..SURFACE };
            let exact = Evidence { width: 0.6 * length, certainty: 1.0, fill: 1.0, ..exact };
            assert!(exact.probability() > 0.9, "{exact:?}");
        }
    }
}
