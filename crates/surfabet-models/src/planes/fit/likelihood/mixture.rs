//! A mixture of blurred rectangles with one noise, fitted by maximum likelihood.
//!
//! ```text
//! L = sum_i ln(sum_j w_j f_j(a_i; sigma) + w_0 c)
//! ```
//!
//! over points `a_i` and rectangles `j` with the weights `w`, which add up to one; `c` is the density of points anywhere,
//! even over the box around all. It climbs by scoring: with `s_i` the derivative of the logarithm of point `i`, the step is
//! `(sum_i s_i s_i^T)^-1 sum_i s_i`, damped as by Levenberg and Marquardt (Berndt, Hall, Hall and Hausman 1974). The weights
//! of the rectangles move in the same step: where two walls meet, their edges follow their weights, and with weights by EM, one
//! step of these after one of the others, hundreds of steps end before the top. `w_0` alone is that of EM.

use nalgebra::{DMatrix, DVector};
use surfabet_base::parallel;
use surfabet_geom::Progress;

use super::rectangle::{PARAMETERS, Rectangle};
use super::ties::{Residual, Tie};
use crate::error::Result;
use crate::planes::constants::{
    DAMPING, LEAST_MIXTURE_SHARE, LEAST_REST, LESS_DAMPING, MORE_DAMPING, MOST_DAMPING,
    MOST_GROWTH, MOST_TURN, TIE_STIFFNESS,
};

/// Points per unit of parallel work; sums over units are added in order.
const CHUNK: usize = 512;

/// A mixture and its fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mixture {
    pub rectangles: Vec<Rectangle>,
    /// Share of the points of each rectangle.
    pub weights: Vec<f64>,
    /// Share of the points that are anywhere.
    pub rest: f64,
    /// Standard deviation of the noise along each axis, metres.
    pub sigma: f64,
    /// Density of points that are anywhere, per cubic metre.
    pub anywhere: f64,
    /// Edges that are held on planes.
    pub ties: Vec<Tie>,
    /// Logarithm of the likelihood, less what holding the ties takes.
    pub log_likelihood: f64,
}

/// Sums over points.
struct PointSums {
    log_likelihood: f64,
    /// Sum of the probabilities that points are anywhere.
    rest: f64,
    gradient: DVector<f64>,
    information: DMatrix<f64>,
}

impl PointSums {
    /// Adds the scores of a point: runs of eight from these parameters on, ascending, and `last` from parameter `at` on.
    fn add(&mut self, runs: &[(usize, [f64; PARAMETERS])], at: usize, last: &[f64]) {
        let n = self.gradient.len();
        let (gradient, columns) = (self.gradient.as_mut_slice(), self.information.as_mut_slice());
        // Below the diagonal, which the other side mirrors: what a run adds above it there does not count.
        for (k, (first, scores)) in runs.iter().enumerate() {
            for (a, s) in (*first..).zip(scores) {
                gradient[a] += s;
                let column = &mut columns[a * n..(a + 1) * n];
                for (below, others) in &runs[k..] {
                    add_times(&mut column[*below..below + PARAMETERS], *s, others);
                }
                add_times(&mut column[at..], *s, last);
            }
        }
        for (a, s) in (at..).zip(last) {
            gradient[a] += s;
            add_times(&mut columns[a * n + at..(a + 1) * n], *s, last);
        }
    }
}

/// Adds values, each times `factor`.
#[inline]
fn add_times(to: &mut [f64], factor: f64, values: &[f64]) {
    to.iter_mut().zip(values).for_each(|(to, value)| *to += factor * value);
}

impl Mixture {
    /// The rectangles with equal densities, before any climbing.
    pub fn new(rectangles: Vec<Rectangle>, sigma: f64, anywhere: f64) -> Self {
        let area: f64 = rectangles.iter().map(Rectangle::area).sum();
        let rest = 0.02;
        let weights = rectangles.iter().map(|r| (1.0 - rest) * r.area() / area).collect();
        let (ties, log_likelihood) = (Vec::new(), f64::NEG_INFINITY);
        Self { rectangles, weights, rest, sigma, anywhere, ties, log_likelihood }
    }

    /// The mixture with edges held where they end on another rectangle's plane, as far as the points can tell.
    pub fn tied(mut self, points: &[[f64; 3]]) -> Self {
        let information = damped(self.sums(points).information, 0.0).cholesky();
        let likely = |tie: &Tie| {
            information.as_ref().is_some_and(|i| tie.is_likely(&self.rectangles, i, points.len()))
        };
        let mut ties = Tie::candidates(&self.rectangles, self.sigma);
        ties.retain(likely);
        self.ties = ties;
        self
    }

    /// Number of parameters: planes and outlines, the noise, and the logarithm of each weight by the last.
    fn n_parameters(&self) -> usize {
        PARAMETERS * self.rectangles.len() + 1 + self.rectangles.len().saturating_sub(1)
    }

    /// The parameter that is the noise; weights follow.
    fn at_sigma(&self) -> usize {
        PARAMETERS * self.rectangles.len()
    }

    /// Climbs until a step gains less than `least` in the logarithm of the likelihood, at most `steps` steps.
    pub fn climb(
        mut self,
        points: &[[f64; 3]],
        steps: usize,
        least: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut damping = DAMPING;
        let mut sums = self.sums(points);
        self.log_likelihood = sums.log_likelihood;
        for _ in 0..steps {
            progress.check()?;
            let before = self.log_likelihood;
            let rest = (sums.rest / points.len() as f64).max(LEAST_REST);
            loop {
                let moved = self.stepped(&sums, damping, rest);
                let tried = moved.as_ref().map(|m| m.sums(points));
                if let (Some(mut moved), Some(tried)) = (moved, tried)
                    && tried.log_likelihood > before
                {
                    moved.log_likelihood = tried.log_likelihood;
                    self = moved;
                    sums = tried;
                    damping *= LESS_DAMPING;
                    break;
                }
                damping *= MORE_DAMPING;
                if damping > MOST_DAMPING {
                    return Ok(self);
                }
            }
            if self.log_likelihood - before < least {
                break;
            }
        }
        Ok(self)
    }

    /// The mixture after a damped step, with this share of points that are anywhere; `None` where there is none.
    fn stepped(&self, sums: &PointSums, damping: f64, rest: f64) -> Option<Self> {
        let step = damped(sums.information.clone(), damping).cholesky()?.solve(&sums.gradient);
        if !step.iter().all(|c| c.is_finite()) {
            return None;
        }
        let at = self.at_sigma();
        let sigma = self.sigma * step[at].clamp(-0.5, 0.5).exp();
        let rectangles = self
            .rectangles
            .iter()
            .enumerate()
            .map(|(j, rectangle)| {
                let mut own: [f64; PARAMETERS] = std::array::from_fn(|k| step[PARAMETERS * j + k]);
                own[..3].iter_mut().for_each(|turn| *turn = turn.clamp(-MOST_TURN, MOST_TURN));
                rectangle.moved(&own, sigma)
            })
            .collect();
        let by = |j: usize| {
            step.get(at + 1 + j).map_or(1.0, |s| s.clamp(-MOST_GROWTH, MOST_GROWTH).exp())
        };
        let mut weights: Vec<f64> =
            self.weights.iter().enumerate().map(|(j, w)| w * by(j)).collect();
        let all = (1.0 - rest) / weights.iter().sum::<f64>();
        weights.iter_mut().for_each(|w| *w *= all);
        Some(Self { rectangles, weights, rest, sigma, ..self.clone() })
    }

    fn sums(&self, points: &[[f64; 3]]) -> PointSums {
        let chunks: Vec<PointSums> =
            parallel::map_chunks(points, CHUNK, |chunk| self.sums_of(chunk));
        let mut total = self.no_sums();
        for sums in chunks {
            total.log_likelihood += sums.log_likelihood;
            total.rest += sums.rest;
            total.gradient += sums.gradient;
            total.information += sums.information;
        }
        total.information.fill_upper_triangle_with_lower_triangle();
        self.hold(&mut total);
        total
    }

    /// Adds what holds the ties.
    fn hold(&self, sums: &mut PointSums) {
        let precision = (TIE_STIFFNESS * self.sigma).powi(-2);
        for tie in &self.ties {
            let Residual { distance, by } = tie.residual(&self.rectangles);
            sums.log_likelihood -= 0.5 * precision * distance * distance;
            for &(a, g) in &by {
                sums.gradient[a] -= precision * distance * g;
                for &(b, h) in &by {
                    sums.information[(b, a)] += precision * g * h;
                }
            }
        }
    }

    fn no_sums(&self) -> PointSums {
        let n = self.n_parameters();
        PointSums {
            log_likelihood: 0.0,
            rest: 0.0,
            gradient: DVector::zeros(n),
            information: DMatrix::zeros(n, n),
        }
    }

    fn sums_of(&self, points: &[[f64; 3]]) -> PointSums {
        let mut sums = self.no_sums();
        let at = self.at_sigma();
        let mut near = Vec::new();
        // The scores of a point by the parameters of rectangles near it, and by the noise and the weights.
        let mut score: Vec<(usize, [f64; PARAMETERS])> = Vec::new();
        let mut last = vec![0.0; self.n_parameters() - at];
        let all: f64 = self.weights.iter().sum();
        for &p in points {
            near.clear();
            let mut density = self.rest * self.anywhere;
            for (j, rectangle) in self.rectangles.iter().enumerate() {
                if let Some(scores) = rectangle.scores(p, self.sigma) {
                    let of = self.weights[j] * scores.log.exp();
                    density += of;
                    near.push((j, of, scores));
                }
            }
            sums.log_likelihood += density.ln();
            let rest = self.rest * self.anywhere / density;
            sums.rest += rest;
            score.clear();
            let [by_sigma, by_weight @ ..] = &mut last[..] else { continue };
            *by_sigma = 0.0;
            // With w_j ~ exp(e_j) the derivative by e_j is p_j - w_j, of the points that are not anywhere.
            for (by, w) in by_weight.iter_mut().zip(&self.weights) {
                *by = -w / all * (1.0 - rest);
            }
            for (j, of, scores) in &near {
                let share = of / density;
                if let Some(by) = by_weight.get_mut(*j) {
                    *by += share;
                }
                if share > LEAST_MIXTURE_SHARE {
                    score.push((PARAMETERS * j, scores.by.map(|s| share * s)));
                    // By its logarithm, so that it stays positive.
                    *by_sigma += share * scores.by_sigma * self.sigma;
                }
            }
            sums.add(&score, at, &last);
        }
        sums
    }

    /// For each rectangle the points of which it is the most probable.
    pub fn members(&self, points: &[[f64; 3]]) -> Vec<Vec<u32>> {
        let best: Vec<Option<usize>> = parallel::map(points, |&p| {
            let mut best = (self.rest * self.anywhere, None);
            for (j, rectangle) in self.rectangles.iter().enumerate() {
                let scores = rectangle.scores(p, self.sigma);
                let of = scores.map_or(0.0, |s| self.weights[j] * s.log.exp());
                if of > best.0 {
                    best = (of, Some(j));
                }
            }
            best.1
        });
        let mut members = vec![Vec::new(); self.rectangles.len()];
        for (i, best) in best.into_iter().enumerate() {
            if let Some(j) = best {
                members[j].push(i as u32);
            }
        }
        members
    }
}

/// A matrix with its diagonal grown by this share, as by Levenberg and Marquardt, and positive where it is zero.
fn damped(mut matrix: DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    for i in 0..matrix.nrows() {
        matrix[(i, i)] += damping * matrix[(i, i)] + f64::MIN_POSITIVE.sqrt();
    }
    matrix
}
