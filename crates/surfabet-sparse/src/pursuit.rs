//! What orthogonal matching pursuit knows of one signal: an orthonormal basis of the atoms chosen so far.
//!
//! Everything lives in the space of values scaled by the roots of their weights, where the weighted problem
//! `min Σ_i w_i (s_i − (D x)_i)²` is plain least squares.

use crate::signals::Signals;

/// An atom must add a direction of at least this squared length, relative to the mean weight: below, its
/// coefficient would be more rounding than signal.
const MIN_SQUARED_LENGTH: f32 = 1e-4;

/// Residual energy, relative to the signal's, that single precision cannot distinguish from zero.
const NOTHING_LEFT: f64 = 1e-12;

/// One signal on its way to a sparse code.
pub struct Pursuit {
    /// Roots of the weights, scaled so that the largest is 1; `None` when all weights are equal.
    roots: Option<Vec<f32>>,
    /// Norm of the weighted signal: everything else is relative to it.
    scale: f64,
    /// Weighted residual.
    residual: Vec<f32>,
    /// Its squared norm.
    energy: f64,
    /// Residual energy at which the code is good enough.
    enough: f64,
    /// Orthonormal directions, one after the other.
    basis: Vec<f32>,
    /// Column `t` of the triangular factor: the `t`-th chosen atom in the basis, `t + 1` entries.
    triangle: Vec<f64>,
    /// The signal in the basis.
    projections: Vec<f64>,
    atoms: Vec<u32>,
    min_squared_length: f32,
}

impl Pursuit {
    /// The pursuit of signal `i` for a code of at most `max_atoms`; `None` when nothing of it is observed, or what is observed is zero or
    /// within `tolerance` (weighted root mean square) of it.
    pub fn start(
        signals: &Signals<'_>,
        i: usize,
        tolerance: f32,
        max_atoms: usize,
    ) -> Option<Self> {
        let values = signals.values(i);
        let mut roots = None;
        let mut total_weight = values.len() as f64;
        if let Some(weights) = signals.weights(i) {
            let largest = weights.iter().copied().fold(0.0, f32::max);
            if largest == 0.0 {
                return None;
            }
            if weights.iter().any(|&w| w != largest) {
                let scaled = weights.iter().map(|&w| f64::from(w) / f64::from(largest));
                total_weight = scaled.clone().sum();
                roots = Some(scaled.map(|w| w.sqrt() as f32).collect::<Vec<f32>>());
            }
        }
        let weighted = |i: usize| {
            f64::from(values[i]) * roots.as_ref().map_or(1.0, |roots| f64::from(roots[i]))
        };
        let energy: f64 = (0..values.len()).map(|i| weighted(i).powi(2)).sum();
        let enough = f64::from(tolerance).powi(2) * total_weight / energy;
        // Written so that an energy of zero, and the NaN that follows from it, ends here too.
        if energy == 0.0 || enough >= 1.0 {
            return None;
        }
        let scale = energy.sqrt();
        let residual = (0..values.len()).map(|i| (weighted(i) / scale) as f32).collect();
        let mean_weight = (total_weight / values.len() as f64) as f32;
        Some(Self {
            roots,
            scale,
            residual,
            energy: 1.0,
            enough: enough.max(NOTHING_LEFT),
            basis: Vec::with_capacity(max_atoms * values.len()),
            triangle: Vec::with_capacity(max_atoms * (max_atoms + 1) / 2),
            projections: Vec::with_capacity(max_atoms),
            atoms: Vec::with_capacity(max_atoms),
            min_squared_length: MIN_SQUARED_LENGTH * mean_weight,
        })
    }

    /// True when weights differ within the signal.
    #[inline(always)]
    pub fn is_weighted(&self) -> bool {
        self.roots.is_some()
    }

    /// Least squared length of what an atom adds for it to be chosen.
    #[inline(always)]
    pub fn min_squared_length(&self) -> f32 {
        self.min_squared_length
    }

    /// True when the residual is small enough.
    #[inline(always)]
    pub fn is_done(&self) -> bool {
        self.energy <= self.enough
    }

    /// The weights, scaled so that the largest is 1.
    pub fn append_weights(&self, out: &mut Vec<f32>) {
        if let Some(roots) = &self.roots {
            out.extend(roots.iter().map(|r| r * r));
        }
    }

    /// The residual, weighted once more: its product with the atoms is what they correlate.
    pub fn append_residual(&self, out: &mut Vec<f32>) {
        append_scaled(&self.residual, self.roots.as_deref(), out);
    }

    /// The newest direction, weighted once more: its product with the atoms is their share of it.
    #[inline(always)]
    pub fn append_direction(&self, out: &mut Vec<f32>) {
        let start = self.basis.len() - self.residual.len();
        append_scaled(&self.basis[start..], self.roots.as_deref(), out);
    }

    /// The atom chosen last.
    #[inline(always)]
    pub fn last_atom(&self) -> Option<u32> {
        self.atoms.last().copied()
    }

    /// The atom chosen last in the basis: how much of each earlier direction, then of its own.
    #[inline(always)]
    pub fn last_column(&self) -> &[f64] {
        &self.triangle[self.triangle.len() - self.atoms.len()..]
    }

    /// The signal's share of the newest direction.
    #[inline(always)]
    pub fn last_projection(&self) -> f32 {
        self.projections.last().map_or(0.0, |&y| y as f32)
    }

    /// Adds `atom` to the support, or returns false and changes nothing when the support spans it already.
    #[inline(always)]
    pub fn extend(&mut self, index: usize, atom: &[f32]) -> bool {
        let n = self.residual.len();
        let start = self.basis.len();
        append_scaled(atom, self.roots.as_deref(), &mut self.basis);
        let (earlier, direction) = self.basis.split_at_mut(start);
        let before = dot(direction, direction);
        let column = self.triangle.len();
        self.triangle.resize(column + self.atoms.len(), 0.0);
        let mut squared = before;
        // Once leaves an error of the order of what was taken away, so a second time where that was most of it.
        for _ in 0..2 {
            for (q, share) in earlier.chunks_exact(n).zip(&mut self.triangle[column..]) {
                let overlap = dot(q, direction);
                add_multiple(direction, -overlap as f32, q);
                *share += overlap;
            }
            squared = dot(direction, direction);
            if squared > 0.25 * before {
                break;
            }
        }
        if squared <= f64::from(0.25 * self.min_squared_length) {
            self.triangle.truncate(column);
            self.basis.truncate(start);
            return false;
        }
        let length = squared.sqrt();
        let inverse = (1.0 / length) as f32;
        for v in direction.iter_mut() {
            *v *= inverse;
        }
        self.triangle.push(length);
        let projection = dot(direction, &self.residual);
        add_multiple(&mut self.residual, -projection as f32, direction);
        self.energy = dot(&self.residual, &self.residual);
        self.projections.push(projection);
        // Dictionaries are checked to have fewer than 2^32 atoms.
        self.atoms.push(index as u32);
        true
    }

    /// Chosen atoms and their least-squares coefficients.
    pub fn finish(self) -> (Vec<u32>, Vec<f32>) {
        let mut x = self.projections;
        let mut end = self.triangle.len();
        for t in (0..x.len()).rev() {
            let column = &self.triangle[end - t - 1..end];
            x[t] /= column[t];
            let solved = x[t];
            for (x, share) in x[..t].iter_mut().zip(column) {
                *x -= share * solved;
            }
            end -= t + 1;
        }
        (self.atoms, x.iter().map(|x| (x * self.scale) as f32).collect())
    }
}

#[inline(always)]
fn append_scaled(values: &[f32], factors: Option<&[f32]>, out: &mut Vec<f32>) {
    match factors {
        None => out.extend_from_slice(values),
        Some(factors) => out.extend(values.iter().zip(factors).map(|(v, f)| v * f)),
    }
}

/// Scalar product; the partial sums of 16 lanes keep it fast and its error small.
#[inline(always)]
pub fn dot(a: &[f32], b: &[f32]) -> f64 {
    let (a, a_rest) = a.as_chunks::<16>();
    let (b, b_rest) = b.as_chunks::<16>();
    let mut lanes = [0.0f32; 16];
    for (a, b) in a.iter().zip(b) {
        for l in 0..16 {
            lanes[l] += a[l] * b[l];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
    lanes.iter().map(|&l| f64::from(l)).sum::<f64>() + rest
}

#[inline(always)]
fn add_multiple(out: &mut [f32], factor: f32, values: &[f32]) {
    for (o, v) in out.iter_mut().zip(values) {
        *o += factor * v;
    }
}
