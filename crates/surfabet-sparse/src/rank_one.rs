//! The atom update of K-SVD: the best atom, and coefficients, for the residuals of the signals that use it.
//!
//! Minimises `Σ_i Σ_j w_ij (e_ij − x_i d_j)²` over the coefficients `x` and the unit-norm atom `d`. Without
//! weights that is the leading singular triplet of the residuals. With weights there is no such closed form
//! (weighted low-rank approximation, Srebro and Jaakkola 2003): the triplet of the residuals, with what is
//! missing filled in from the present estimate, starts an alternation between the two closed-form halves
//! `x_i = Σ_j w e d / Σ_j w d²` and `d_j = Σ_i w e x / Σ_i w x²`. Neither stage can raise the error.

use rayon::prelude::*;
use surfabet_base::Progress;

use crate::dictionary::normalize;
use crate::error::Result;
use crate::linalg::leading_right_singular_vector;
use crate::pursuit::dot;

/// Signals per partial sum. Fixed, so that sums do not depend on the number of threads.
const ROWS: usize = 32;

/// Steps of the bidiagonalisation that finds the leading triplet. It starts from the atom as it is and is
/// repeated in every iteration of K-SVD, so it need not converge to the last digit at once.
const LANCZOS_STEPS: usize = 8;

/// When the weighted alternation ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Most alternations.
    pub iterations: usize,
    /// Least relative gain in explained energy for another one.
    pub tolerance: f64,
}

/// The residuals of the signals that use an atom, without that atom's share.
pub struct Group<'a> {
    /// Number of values of a signal.
    pub n_features: usize,
    /// Residuals, one row per signal.
    pub residuals: &'a [f32],
    /// Weights in the same layout, at most 1.
    pub weights: Option<&'a [f32]>,
}

/// Improves `atom` and its `coefficients` in place; a no-op when neither can be improved.
pub fn update(
    group: &Group<'_>,
    atom: &mut [f32],
    coefficients: &mut [f32],
    convergence: &Convergence,
    progress: &dyn Progress,
) -> Result<()> {
    let n = group.n_features;
    let Some(weights) = group.weights else {
        let leading = leading_atom(group.residuals, atom, progress)?;
        coefficients
            .par_iter_mut()
            .with_min_len(ROWS)
            .zip(group.residuals.par_chunks_exact(n))
            .for_each(|(x, e)| *x = dot(e, &leading) as f32);
        atom.copy_from_slice(&leading);
        return Ok(());
    };
    let mut filled = group.residuals.to_vec();
    let weighted = weight_and_fill(&mut filled, weights, atom, coefficients);
    let problem = Weighted { n, weighted: &weighted, weights };
    let gain_before = problem.gain(atom, coefficients);
    let mut best = leading_atom(&filled, atom, progress)?;
    let mut solved = problem.solve(&best);
    for _ in 0..convergence.iterations {
        progress.check()?;
        let Some(next) = solved.next_atom() else { break };
        let next_solved = problem.solve(&next);
        let gained = next_solved.explained - solved.explained;
        if gained <= 0.0 {
            break;
        }
        (best, solved) = (next, next_solved);
        if gained <= convergence.tolerance * solved.explained {
            break;
        }
    }
    if solved.explained >= gain_before {
        atom.copy_from_slice(&best);
        coefficients.copy_from_slice(&solved.coefficients);
    }
    Ok(())
}

/// Fills `residuals` by `w e + (1 − w) x d`, and returns `w e`.
///
/// The unweighted error of the filled residuals bounds the weighted error from above and equals it at the
/// present estimate, so lowering the one lowers the other.
fn weight_and_fill(
    residuals: &mut [f32],
    weights: &[f32],
    atom: &[f32],
    coefficients: &[f32],
) -> Vec<f32> {
    let n = atom.len();
    let mut weighted = vec![0.0; residuals.len()];
    (residuals.par_chunks_exact_mut(n), weighted.par_chunks_exact_mut(n))
        .into_par_iter()
        .with_min_len(ROWS)
        .zip(weights.par_chunks_exact(n))
        .zip(coefficients)
        .for_each(|(((e, we), w), &x)| {
            for (((e, we), &w), &d) in e.iter_mut().zip(we).zip(w).zip(atom) {
                *we = w * *e;
                *e = *we + (1.0 - w) * x * d;
            }
        });
    weighted
}

/// A masked rank-one problem.
struct Weighted<'a> {
    n: usize,
    /// `w e`
    weighted: &'a [f32],
    weights: &'a [f32],
}

/// The best coefficients for an atom, and sums from which the best atom for them follows.
struct Solved {
    coefficients: Vec<f32>,
    /// Energy explained: what the atom takes off the weighted squared error.
    explained: f64,
    /// `Σ_i w e x` per feature.
    numerators: Vec<f64>,
    /// `Σ_i w x²` per feature.
    denominators: Vec<f64>,
}

impl Weighted<'_> {
    /// What `x d` takes off the weighted squared error: `Σ 2 x w e d − x² w d²`.
    fn gain(&self, atom: &[f32], coefficients: &[f32]) -> f64 {
        let squares: Vec<f32> = atom.iter().map(|d| d * d).collect();
        let rows = self.weighted.chunks_exact(self.n).zip(self.weights.chunks_exact(self.n));
        rows.zip(coefficients)
            .map(|((we, w), &x)| {
                let x = f64::from(x);
                x * (2.0 * dot(we, atom) - x * dot(w, &squares))
            })
            .sum()
    }

    fn solve(&self, atom: &[f32]) -> Solved {
        let n = self.n;
        let squares: Vec<f32> = atom.iter().map(|d| d * d).collect();
        let mut coefficients = vec![0.0; self.weighted.len() / n];
        let partial: Vec<(f64, Vec<f32>, Vec<f32>)> = coefficients
            .par_chunks_mut(ROWS)
            .zip(self.weighted.par_chunks(ROWS * n))
            .zip(self.weights.par_chunks(ROWS * n))
            .map(|((coefficients, weighted), weights)| {
                let (mut explained, mut numerators, mut denominators) =
                    (0.0, vec![0.0f32; n], vec![0.0f32; n]);
                let rows = weighted.chunks_exact(n).zip(weights.chunks_exact(n));
                for (x, (we, w)) in coefficients.iter_mut().zip(rows) {
                    let (share, length) = (dot(we, atom), dot(w, &squares));
                    // The atom is unobserved here: no coefficient can be told from another.
                    if length <= 1e-12 {
                        continue;
                    }
                    explained += share * share / length;
                    *x = (share / length) as f32;
                    let (x, squared) = (*x, *x * *x);
                    for (((a, b), we), w) in
                        numerators.iter_mut().zip(&mut denominators).zip(we).zip(w)
                    {
                        *a += x * we;
                        *b += squared * w;
                    }
                }
                (explained, numerators, denominators)
            })
            .collect();
        let (mut explained, mut numerators, mut denominators) = (0.0, vec![0.0; n], vec![0.0; n]);
        for (e, a, b) in &partial {
            explained += e;
            add(&mut numerators, a);
            add(&mut denominators, b);
        }
        Solved { coefficients, explained, numerators, denominators }
    }
}

impl Solved {
    /// The best atom for these coefficients, 0 where no signal observes it; `None` when that is everywhere.
    fn next_atom(&self) -> Option<Vec<f32>> {
        let largest = self.denominators.iter().copied().fold(0.0, f64::max);
        let ratios = self.numerators.iter().zip(&self.denominators);
        let mut atom: Vec<f32> =
            ratios.map(|(a, b)| if *b > 1e-12 * largest { (a / b) as f32 } else { 0.0 }).collect();
        normalize(&mut atom).then_some(atom)
    }
}

fn add(sums: &mut [f64], values: &[f32]) {
    for (s, &v) in sums.iter_mut().zip(values) {
        *s += f64::from(v);
    }
}

/// Leading right singular vector of `rows` (one per signal) in the Krylov space of `start`: Golub-Kahan
/// bidiagonalisation with full orthogonalisation. It explains at least as much as `start` does, and has a
/// positive product with it. Public for the benches only.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn leading_atom(rows: &[f32], start: &[f32], progress: &dyn Progress) -> Result<Vec<f32>> {
    let n = start.len();
    let steps = LANCZOS_STEPS.min(n).min(rows.len() / n);
    let mut right: Vec<Vec<f32>> = vec![start.to_vec()];
    let mut left: Vec<Vec<f32>> = Vec::new();
    let (mut diagonal, mut above) = (Vec::new(), Vec::new());
    let mut largest = 0.0f64;
    while left.len() < steps {
        progress.check()?;
        let Some(newest) = right.last() else { break };
        let mut u = times(rows, newest);
        let alpha = orthonormalize(&mut u, &left);
        largest = largest.max(alpha);
        diagonal.push(alpha);
        left.push(u);
        if alpha <= 1e-6 * largest || left.len() == steps {
            break;
        }
        let mut v = transposed_times(rows, &left[left.len() - 1], n);
        let beta = orthonormalize(&mut v, &right);
        if beta <= 1e-6 * largest {
            break;
        }
        above.push(beta);
        right.push(v);
    }
    let size = diagonal.len();
    let mut bidiagonal = vec![0.0; size * size];
    for (i, &alpha) in diagonal.iter().enumerate() {
        bidiagonal[i * size + i] = alpha;
    }
    for (i, &beta) in above.iter().enumerate().take(size.saturating_sub(1)) {
        bidiagonal[(i + 1) * size + i] = beta;
    }
    let mut atom = start.to_vec();
    if largest == 0.0 {
        return Ok(atom);
    }
    if let Some(mixture) = leading_right_singular_vector(&bidiagonal, size) {
        let sign = if mixture[0] < 0.0 { -1.0 } else { 1.0 };
        let mut sums = vec![0.0f64; n];
        for (direction, share) in right.iter().zip(&mixture) {
            for (s, &v) in sums.iter_mut().zip(direction) {
                *s += sign * share * f64::from(v);
            }
        }
        let mut candidate: Vec<f32> = sums.iter().map(|&s| s as f32).collect();
        if normalize(&mut candidate) {
            atom = candidate;
        }
    }
    Ok(atom)
}

/// Makes `v` orthogonal to `basis` and scales it to norm 1, returning its norm before.
fn orthonormalize(v: &mut [f32], basis: &[Vec<f32>]) -> f64 {
    for _ in 0..2 {
        for b in basis {
            let overlap = dot(v, b) as f32;
            for (v, b) in v.iter_mut().zip(b) {
                *v -= overlap * b;
            }
        }
    }
    let norm = dot(v, v).sqrt();
    if norm > 0.0 {
        for v in v {
            *v = (f64::from(*v) / norm) as f32;
        }
    }
    norm
}

fn times(rows: &[f32], v: &[f32]) -> Vec<f32> {
    rows.par_chunks_exact(v.len()).with_min_len(ROWS).map(|row| dot(row, v) as f32).collect()
}

fn transposed_times(rows: &[f32], u: &[f32], n: usize) -> Vec<f32> {
    let partial: Vec<Vec<f32>> = rows
        .par_chunks(ROWS * n)
        .zip(u.par_chunks(ROWS))
        .map(|(rows, u)| {
            let mut sums = vec![0.0f32; n];
            for (row, &u) in rows.chunks_exact(n).zip(u) {
                for (s, &v) in sums.iter_mut().zip(row) {
                    *s += u * v;
                }
            }
            sums
        })
        .collect();
    let mut sums = vec![0.0; n];
    for p in &partial {
        add(&mut sums, p);
    }
    sums.iter().map(|&s| s as f32).collect()
}
