//! Dense products and decompositions: the only file that names faer.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// `out = atomsᵀ · columns` for `rows` atoms given feature-major: `lhs` is column-major `rows` x `inner`,
/// `rhs` column-major `inner` x `columns`, `out` column-major `rows` x `columns`.
///
/// Runs on the calling thread: callers are parallel over blocks already.
pub fn product(lhs: &[f32], rhs: &[f32], out: &mut [f32], rows: usize, inner: usize) {
    let columns = rhs.len() / inner;
    matmul(
        MatMut::from_column_major_slice_mut(out, rows, columns),
        Accum::Replace,
        MatRef::from_column_major_slice(lhs, rows, inner),
        MatRef::from_column_major_slice(rhs, inner, columns),
        1.0,
        Par::Seq,
    );
}

/// Leading right singular vector of a small square matrix given column-major; `None` when it is not finite.
pub fn leading_right_singular_vector(matrix: &[f64], size: usize) -> Option<Vec<f64>> {
    // faer sorts singular values from large to small.
    let svd = MatRef::from_column_major_slice(matrix, size, size).thin_svd().ok()?;
    Some(svd.V().col(0).iter().copied().collect())
}
