//! The Laplacian of Gaussian of a range image.
//!
//! The image holds the logarithm of the range, so that a response is a relative depth and does not depend on how far
//! away a structure is. Pixels without a point are left out of every sum (normalised convolution, H. Knutsson and
//! C.-F. Westin, CVPR 1993).

use crate::bic_alphabet::constants::LEAST_WEIGHT;

/// Sum of weighted values, and of their weights.
type Weighted = [f32; 2];

/// `scale^2 L(G * ln r)`: the Laplacian L of the logarithm of the range r smoothed by a Gaussian G of `scale` pixels,
/// times its square so that responses compare across scales; zero where too little is known. Azimuth goes around.
pub(super) fn response(ranges: &[f32], shape: [usize; 2], scale: f64) -> Vec<f32> {
    let kernel = gaussian_kernel(scale);
    let along_rows = smooth_rows(ranges, shape, &kernel);
    let smooth = smooth_columns(&along_rows, shape, &kernel);
    laplacian(&smooth, shape, scale)
}

/// `exp(-k^2 / (2 scale^2))` for k within three scales, with sum one.
fn gaussian_kernel(scale: f64) -> Vec<f32> {
    let reach = (3.0 * scale).ceil() as usize;
    let kernel: Vec<f32> = (0..=2 * reach)
        .map(|k| (-0.5 * ((k as f64 - reach as f64) / scale).powi(2)).exp() as f32)
        .collect();
    let total: f32 = kernel.iter().sum();
    kernel.iter().map(|k| k / total).collect()
}

/// Smooths the logarithm of the range along rows; unknown pixels have no weight.
fn smooth_rows(ranges: &[f32], [_, columns]: [usize; 2], kernel: &[f32]) -> Vec<Weighted> {
    let reach = kernel.len() / 2;
    let given: Vec<Weighted> =
        ranges.iter().map(|&r| if r > 0.0 { [r.ln(), 1.0] } else { [0.0; 2] }).collect();
    let mut across = vec![[0.0_f32; 2]; given.len()];
    for (smooth, line) in across.chunks_mut(columns).zip(given.chunks(columns)) {
        for (column, smooth) in smooth.iter_mut().enumerate() {
            for (k, weight) in kernel.iter().enumerate() {
                // `reach` may exceed the width of a very coarse image.
                let at = (column + k + reach * columns - reach) % columns;
                let of = line[at];
                smooth[0] += weight * of[0];
                smooth[1] += weight * of[1];
            }
        }
    }
    across
}

/// Smooths along columns and divides by the weights; not a number where less than [`LEAST_WEIGHT`] is known.
fn smooth_columns(
    along_rows: &[Weighted],
    [rows, columns]: [usize; 2],
    kernel: &[f32],
) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut smooth = vec![f32::NAN; along_rows.len()];
    for row in 0..rows {
        for column in 0..columns {
            let mut sum = [0.0_f32; 2];
            for (k, weight) in kernel.iter().enumerate() {
                let Some(at) = (row + k).checked_sub(reach).filter(|&r| r < rows) else { continue };
                let of = along_rows[at * columns + column];
                sum[0] += weight * of[0];
                sum[1] += weight * of[1];
            }
            if sum[1] >= LEAST_WEIGHT {
                smooth[row * columns + column] = sum[0] / sum[1];
            }
        }
    }
    smooth
}

/// `scale^2` times the five-point Laplacian; zero where one of the five is unknown.
fn laplacian(smooth: &[f32], [rows, columns]: [usize; 2], scale: f64) -> Vec<f32> {
    let mut laplacian = vec![0.0; smooth.len()];
    for row in 1..rows.saturating_sub(1) {
        for column in 0..columns {
            let at = |r: usize, c: usize| smooth[r * columns + c % columns];
            let sum = at(row - 1, column)
                + at(row + 1, column)
                + at(row, column + columns - 1)
                + at(row, column + 1)
                - 4.0 * at(row, column);
            if sum.is_finite() {
                laplacian[row * columns + column] = (scale * scale) as f32 * sum;
            }
        }
    }
    laplacian
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_of_a_quadratic_is_its_laplacian() {
        // ln r = c + (x^2 + y^2) / 2, whose Laplacian is 2 at every scale.
        let (rows, columns) = (41, 41);
        let value = |k: usize| {
            let (y, x) = ((k / columns) as f32 - 20.0, (k % columns) as f32 - 20.0);
            (0.5 * 1e-3 * (x * x + y * y)).exp()
        };
        let ranges: Vec<f32> = (0..rows * columns).map(value).collect();
        for scale in [1.0, 2.0] {
            let found = response(&ranges, [rows, columns], scale);
            let middle = found[20 * columns + 20] / (scale * scale) as f32;
            assert!((middle - 2e-3).abs() < 1e-4, "{middle}");
        }
    }
}
