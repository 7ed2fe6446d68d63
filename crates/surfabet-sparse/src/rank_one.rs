//! The atom update of K-SVD: the best atom, and coefficients, for the residuals of the signals that use it.
//!
//! Minimises `Σ_i Σ_j w_ij (e_ij − x_i d_j)²` over the coefficients `x` and the unit-norm atom `d`. Without
//! weights that is the leading singular triplet of the residuals. With weights there is no such closed form
//! (weighted low-rank approximation, Srebro and Jaakkola 2003): the triplet of the residuals, with what is
//! missing filled in from the present estimate, starts an alternation between the two closed-form halves
//! `x_i = Σ_j w e d / Σ_j w d²` and `d_j = Σ_i w e x / Σ_i w x²`. Neither stage can raise the error.

use pulp::Arch;
use surfabet_base::Progress;
use surfabet_base::parallel;

use crate::dictionary::normalize;
use crate::error::Result;
use crate::linalg::leading_right_singular_vector;
use crate::pursuit::dot;

/// Signals per partial sum. Fixed, so that sums do not depend on the number of threads.
const ROWS: usize = 32;

/// Values of a group below which handing work to other threads costs more than it saves.
const PARALLEL: usize = 1 << 17;

/// Steps of the bidiagonalisation that finds the leading triplet. It starts from the atom as it is and is
/// repeated in every iteration of K-SVD, so it need not converge to the last digit at once.
const LANCZOS_STEPS: usize = 8;

/// A signal that uses the atom.
pub struct Member<'a> {
    /// What its code leaves of the signal.
    pub residual: &'a mut [f32],
    /// Weights of its values, at most 1.
    pub weights: Option<&'a [f32]>,
    /// Coefficient of the atom.
    pub coefficient: f32,
}

/// Improves `atom` for the coefficients of its `members`, then these for the atom, and keeps the residuals in step.
/// Neither half raises the weighted error but for rounding.
pub fn update(members: &mut [Member<'_>], atom: &mut [f32]) {
    let Some(next) = next_atom(members, atom) else { return };
    let before: &[f32] = atom;
    over_chunks(members, atom.len(), |chunk| {
        Arch::new().dispatch(|| solve(chunk, before, &next));
    });
    atom.copy_from_slice(&next);
}

/// Work on chunks of [`ROWS`] members, on all threads where that pays. Results come in the order of the chunks.
fn over_chunks<'a, T: Send>(
    members: &mut [Member<'a>],
    n: usize,
    work: impl Fn(&mut [Member<'a>]) -> T + Sync + Send,
) -> Vec<T> {
    if members.len() * n < PARALLEL {
        members.chunks_mut(ROWS).map(work).collect()
    } else {
        parallel::map_owned(members.chunks_mut(ROWS).collect(), work)
    }
}

/// The best atom for the coefficients as they are, `d_j + Σ_i w r x / Σ_i w x²` scaled to norm 1; 0 where no signal
/// observes it, `None` when that is everywhere.
fn next_atom(members: &mut [Member<'_>], atom: &[f32]) -> Option<Vec<f32>> {
    let n = atom.len();
    let partial = over_chunks(members, n, |chunk| {
        let (mut numerators, mut denominators) = (vec![0.0f32; n], vec![0.0f32; n]);
        Arch::new().dispatch(|| {
            for member in chunk {
                accumulate(member, &mut numerators, &mut denominators);
            }
        });
        (numerators, denominators)
    });
    let (mut numerators, mut denominators) = (vec![0.0; n], vec![0.0; n]);
    for (a, b) in &partial {
        add(&mut numerators, a);
        add(&mut denominators, b);
    }
    if members.iter().all(|m| m.weights.is_none()) {
        let all = denominators[0];
        denominators.fill(all);
    }
    let largest = denominators.iter().copied().fold(0.0, f64::max);
    let mut next: Vec<f32> = (atom.iter().zip(numerators).zip(denominators))
        .map(|((&d, a), b)| if b > 1e-12 * largest { (f64::from(d) + a / b) as f32 } else { 0.0 })
        .collect();
    normalize(&mut next).then_some(next)
}

/// `Σ w r x` and `Σ w x²` per feature.
#[inline(always)]
fn accumulate(member: &Member<'_>, numerators: &mut [f32], denominators: &mut [f32]) {
    let x = member.coefficient;
    match member.weights {
        None => {
            for (a, r) in numerators.iter_mut().zip(&*member.residual) {
                *a += x * r;
            }
            // Without weights all features have the same: one stands for all.
            denominators[0] += x * x;
        }
        Some(weights) => {
            let rows = member.residual.iter().zip(weights);
            for ((a, b), (r, w)) in numerators.iter_mut().zip(denominators).zip(rows) {
                let wx = w * x;
                *a += wx * r;
                *b += wx * x;
            }
        }
    }
}

/// Best coefficients for the atom `next` in the place of `atom`: `x_i = Σ_j w e d / Σ_j w d²` with `e` the residual
/// and the share of the atom as it was.
#[inline(always)]
fn solve(members: &mut [Member<'_>], atom: &[f32], next: &[f32]) {
    let overlap = dot(atom, next);
    let products: Vec<f32> = atom.iter().zip(next).map(|(a, b)| a * b).collect();
    let squares: Vec<f32> = next.iter().map(|d| d * d).collect();
    for member in members {
        let x = member.coefficient;
        let (share, overlap, length) = match member.weights {
            None => (dot(member.residual, next), overlap, 1.0),
            Some(w) => (dot3(w, member.residual, next), dot(w, &products), dot(w, &squares)),
        };
        // The atom is unobserved here: all coefficients fit equally.
        let solved =
            if length > 1e-12 { ((share + f64::from(x) * overlap) / length) as f32 } else { 0.0 };
        for ((r, &before), &after) in member.residual.iter_mut().zip(atom).zip(next) {
            *r += x * before - solved * after;
        }
        member.coefficient = solved;
    }
}

/// `Σ a b c`, in lanes as [`dot`].
#[inline(always)]
pub fn dot3(a: &[f32], b: &[f32], c: &[f32]) -> f64 {
    let (a, a_rest) = a.as_chunks::<16>();
    let (b, b_rest) = b.as_chunks::<16>();
    let (c, c_rest) = c.as_chunks::<16>();
    let mut lanes = [0.0f32; 16];
    for ((a, b), c) in a.iter().zip(b).zip(c) {
        for l in 0..16 {
            lanes[l] += a[l] * b[l] * c[l];
        }
    }
    let rest = a_rest.iter().zip(b_rest).zip(c_rest);
    let rest: f64 = rest.map(|((&a, &b), &c)| f64::from(a) * f64::from(b) * f64::from(c)).sum();
    lanes.iter().map(|&l| f64::from(l)).sum::<f64>() + rest
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
    parallel::map_chunks(rows, v.len(), |row| dot(row, v) as f32)
}

fn transposed_times(rows: &[f32], u: &[f32], n: usize) -> Vec<f32> {
    let partial = parallel::map_range(u.len().div_ceil(ROWS), |chunk| {
        let of_chunk = chunk * ROWS..u.len().min((chunk + 1) * ROWS);
        let rows = &rows[of_chunk.start * n..of_chunk.end * n];
        let mut sums = vec![0.0f32; n];
        for (row, &u) in rows.chunks_exact(n).zip(&u[of_chunk]) {
            for (s, &v) in sums.iter_mut().zip(row) {
                *s += u * v;
            }
        }
        sums
    });
    let mut sums = vec![0.0; n];
    for p in &partial {
        add(&mut sums, p);
    }
    sums.iter().map(|&s| s as f32).collect()
}
