//! Edges that end on another rectangle's plane.
//!
//! Surfaces that meet end at the line in which their planes meet. Where noise mixes two walls in their corner, an edge that
//! is free trades its place for a lean of the planes, and both walls lean towards the line between their far ends. So edges
//! that are on a plane as far as the points can tell are held there: the middle of edge `k` with the residual
//! `g = n . (e_k - c)` about the plane `(c, n)` adds `-g^2 / 2 h^2` to the logarithm of the likelihood, `h` a small share
//! of the noise.

use nalgebra::{Cholesky, DVector, Dyn};

use super::rectangle::{PARAMETERS, Rectangle};
use crate::planes::constants::{FOLD_ANGLE, TIE_SIGMAS};
use crate::vector::{cross, dot, minus};

/// An edge and the plane that it ends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tie {
    /// The rectangle whose edge it is.
    of: usize,
    /// The axis along which the edge is away from the middle, 0 or 1.
    axis: usize,
    /// -1 for the low and 1 for the high edge.
    side: f64,
    /// The rectangle whose plane it is.
    to: usize,
}

/// How far an edge is from its plane, metres, and by which parameters that changes how fast.
pub(super) struct Residual {
    pub distance: f64,
    pub by: [(usize, f64); 11],
}

impl Tie {
    /// All edges of which the middle is near another rectangle, in whose plane they end.
    pub fn candidates(rectangles: &[Rectangle], sigma: f64) -> Vec<Self> {
        let mut found = Vec::new();
        for (of, rectangle) in rectangles.iter().enumerate() {
            for (axis, side) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
                let outwards = [rectangle.frame.u, rectangle.frame.v][axis];
                let middle = rectangle.edge(axis, side);
                for (to, other) in rectangles.iter().enumerate() {
                    let crosses = dot(outwards, other.frame.normal).abs() >= FOLD_ANGLE.sin();
                    if of != to && crosses && other.is_within(middle, TIE_SIGMAS * sigma) {
                        found.push(Self { of, axis, side, to });
                    }
                }
            }
        }
        found
    }

    /// The residual of some rectangles; each has [`PARAMETERS`] parameters, in order.
    pub fn residual(&self, rectangles: &[Rectangle]) -> Residual {
        let (own, other) = (&rectangles[self.of], &rectangles[self.to]);
        let axes = [own.frame.u, own.frame.v];
        let (outwards, along) = (axes[self.axis], axes[1 - self.axis]);
        let middle = own.edge(self.axis, self.side);
        let (arm, d) = (minus(middle, own.frame.center), minus(middle, other.frame.center));
        let normal = other.frame.normal;
        // A turn w moves the edge by w x arm, and the other's normal by w x normal.
        let (turn, lean) = (cross(arm, normal), cross(normal, d));
        let (a, b) = (PARAMETERS * self.of, PARAMETERS * self.to);
        let edge = a + 4 + 2 * self.axis + usize::from(self.side > 0.0);
        // The middle of an edge is half way between its ends.
        let (end, half) = (a + 4 + 2 * (1 - self.axis), 0.5 * dot(along, normal));
        Residual {
            distance: dot(normal, d),
            by: [
                (a, dot(turn, own.frame.u)),
                (a + 1, dot(turn, own.frame.v)),
                (a + 2, dot(turn, own.frame.normal)),
                (a + 3, dot(own.frame.normal, normal)),
                (edge, dot(outwards, normal)),
                (end, half),
                (end + 1, half),
                (b, dot(lean, other.frame.u)),
                (b + 1, dot(lean, other.frame.v)),
                (b + 2, dot(lean, other.frame.normal)),
                (b + 3, -1.0),
            ],
        }
    }

    /// True when holding the edge on the plane costs less of the likelihood of `n` points than a parameter is worth (BIC):
    /// `g^2 / var(g) < ln n`, of the parameters' information.
    pub fn is_likely(
        &self,
        rectangles: &[Rectangle],
        information: &Cholesky<f64, Dyn>,
        n: usize,
    ) -> bool {
        let Residual { distance, by } = self.residual(rectangles);
        let mut gradient = DVector::zeros(information.l_dirty().nrows());
        by.iter().for_each(|&(k, g)| gradient[k] += g);
        let variance = gradient.dot(&information.solve(&gradient));
        distance * distance < variance * (n as f64).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planes::patch::Frame;

    /// Two rectangles of 2 m x 1 m at a right angle, the second's edge `gap` before the first's plane.
    fn corner(gap: f64) -> [Rectangle; 2] {
        let floor = Frame {
            center: [0.0; 3],
            u: [1.0, 0.0, 0.0],
            v: [0.0, 1.0, 0.0],
            normal: [0.0, 0.0, 1.0],
        };
        let wall = Frame {
            center: [0.0, 0.5, 0.5 + gap],
            u: [1.0, 0.0, 0.0],
            v: [0.0, 0.0, 1.0],
            normal: [0.0, -1.0, 0.0],
        };
        [floor, wall].map(|frame| Rectangle { frame, half: [1.0, 0.5] })
    }

    #[test]
    fn edges_that_meet_are_candidates_and_no_others() {
        let tie = |of, side, to| Tie { of, axis: 1, side, to };
        let both = [tie(0, 1.0, 1), tie(1, -1.0, 0)];
        assert_eq!(Tie::candidates(&corner(0.0), 0.01), both);
        let gap = 1.01 * TIE_SIGMAS * 0.01;
        assert!(Tie::candidates(&corner(gap), 0.01).is_empty());
        assert_eq!(Tie::candidates(&corner(0.9 * gap), 0.01), both);
    }

    #[test]
    fn residuals_change_as_their_derivatives_say() {
        let mut rectangles = corner(0.05);
        rectangles[0] = rectangles[0].moved(&[0.1, -0.2, 0.3, 0.02, 0.1, 0.1, 0.0, 0.05], 0.01);
        for tie in
            [Tie { of: 0, axis: 1, side: 1.0, to: 1 }, Tie { of: 1, axis: 1, side: -1.0, to: 0 }]
        {
            let Residual { by, .. } = tie.residual(&rectangles);
            for k in 0..2 * PARAMETERS {
                let moved = |h: f64| {
                    let mut step = [0.0; PARAMETERS];
                    step[k % PARAMETERS] = h;
                    let mut moved = rectangles;
                    moved[k / PARAMETERS] = moved[k / PARAMETERS].moved(&step, 0.01);
                    tie.residual(&moved).distance
                };
                let wanted = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                let found: f64 = by.iter().filter(|b| b.0 == k).map(|b| b.1).sum();
                assert!((found - wanted).abs() < 1e-8, "{tie:?} {k}: {found} {wanted}");
            }
        }
    }
}
