//! When two sets of points are one plane (section II-D, step 1).

use surfabet_geom::Moments;

use crate::planes::constants::CHANCE;
use crate::planes::fit::incidence::Incidence;
use crate::planes::fit::m_step::plane;
use crate::planes::fit::trim::mean_square;
use crate::planes::patch::{Frame, Patch};
use crate::vector::dot;

/// A set of points and its plane, as merging sees them.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::planes::fit) struct PlanarSet {
    /// Number of points.
    pub n: usize,
    pub moments: Moments,
    pub frame: Frame,
    /// Sum of the sides that the points were seen from.
    pub facing: [f64; 3],
    /// Variance of the points about the means of their tiles: without the surface's shape.
    pub noise: f64,
}

/// When two parts become one.
#[derive(Debug, Clone, Copy)]
pub(in crate::planes::fit) struct Rule {
    /// Largest distance of one part's points from the other's plane, as root of the mean square: G.
    pub distance: f64,
    /// Standard deviation that every part may have, metres.
    pub deviation: f64,
    /// How that depends on the angle at which a part was seen.
    pub incidence: Incidence,
    /// Factor of the deviation of a part about its own plane that is allowed about the common one.
    pub tolerance: f64,
}

impl PlanarSet {
    /// The whole support of a patch.
    pub fn of(patch: &Patch) -> Self {
        Self {
            n: patch.whole.len(),
            moments: patch.moments,
            frame: patch.frame,
            facing: patch.facing,
            noise: patch.noise * patch.noise,
        }
    }

    /// By how much its noise across a plane is above the median, for the angle at which its points were seen.
    pub fn noise_factor(&self, frame: &Frame, incidence: Incidence) -> f64 {
        if self.n == 0 {
            return 1.0;
        }
        incidence.factor(dot(self.facing, frame.normal).abs() / self.n as f64)
    }

    /// The union with another part and the mean square distance of its points from their plane, if `rule` allows.
    ///
    /// With `d(X, e)` the root mean square distance of the points of `X` from the plane `e`, both of these have to hold:
    ///
    /// ```text
    /// min(d(A, e_B), d(B, e_A)) < G
    /// d(X, e_AB)^2 <= (tolerance^2 + 4 / n_X) max(noise_X, f_X G / 3)^2   for X = A and X = B
    /// ```
    ///
    /// with the factor `f_X` of the noise at the angle at which `X` was seen and the number `n_X` of their points. The paper has the first, of mean distances. Points known to be seen from opposite sides of the common plane do not
    /// merge.
    pub fn joined(&self, other: &Self, rule: &Rule) -> Option<(f64, Self)> {
        let apart =
            mean_square(&self.moments, &other.frame).min(mean_square(&other.moments, &self.frame));
        if apart >= rule.distance * rule.distance {
            return None;
        }
        let mut moments = self.moments;
        moments.merge(&other.moments);
        let frame = plane(&moments)?;
        if dot(self.facing, frame.normal) * dot(other.facing, frame.normal) < 0.0 {
            return None;
        }
        let fits = |part: &Self| {
            let deviation = rule.deviation * part.noise_factor(&frame, rule.incidence);
            let variance = part.noise.max(deviation * deviation);
            let chance = CHANCE / part.n as f64;
            let allowed = rule.tolerance * rule.tolerance + chance;
            mean_square(&part.moments, &frame) <= allowed * variance
        };
        if !(fits(self) && fits(other)) {
            return None;
        }
        let share = other.moments.weight() / moments.weight();
        let joined = Self {
            n: self.n + other.n,
            moments,
            frame,
            facing: std::array::from_fn(|a| self.facing[a] + other.facing[a]),
            noise: (1.0 - share) * self.noise + share * other.noise,
        };
        Some((mean_square(&moments, &joined.frame), joined))
    }
}
