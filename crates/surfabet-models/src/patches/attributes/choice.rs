//! Choice of the coefficients of a cell: of least Lagrangian cost `J = D + lambda R`.

use super::butterflies::Butterflies;
use super::field::{Coefficients, MAX_COEFFICIENT, Steps};
use super::models::{CellContext, FieldModels};

/// Coefficients q of a cell that cost least.
///
/// The transform is orthonormal, so the squared error is that of the transformed residuals r:
/// `D = sum of (r - q step)^2`, in squares of the unit of the values. One after another each q is zero, the nearest to `r / step`, or
/// the next nearer to zero, whichever has the least `(r - q step)^2 + lambda bits(q)`; in the end all of them are
/// compared with none.
pub(super) fn choose<const N: usize>(
    models: &FieldModels<N>,
    context: &CellContext,
    butterflies: &Butterflies,
    residuals: &[[f32; 8]; N],
    steps: Steps<N>,
    lambda: f32,
) -> Coefficients<N> {
    let mut coefficients = [[0; 7]; N];
    let any = &models.any[context.any()];
    let (mut distortion_of_none, mut cost) = (0.0, lambda * any.cost(true));
    let mut before = 0;
    for (i, butterfly) in butterflies.all().iter().enumerate() {
        for channel in 0..N {
            let step = steps.of(channel, context.level);
            let residual = residuals[channel][butterfly.difference];
            let model = &models.coefficients[context.coefficient(channel, before)];
            let limit = MAX_COEFFICIENT as f32;
            let nearest = (residual / step).round().clamp(-limit, limit) as i32;
            let cost_of = |q: i32| (residual - q as f32 * step).powi(2) + lambda * model.cost(q);
            let mut best = (0, cost_of(0));
            for q in [nearest, nearest - nearest.signum()] {
                let cost = cost_of(q);
                if cost < best.1 {
                    best = (q, cost);
                }
            }
            coefficients[channel][i] = best.0;
            cost += best.1;
            distortion_of_none += residual * residual;
            before += best.0.unsigned_abs().min(2);
        }
    }
    if distortion_of_none + lambda * any.cost(false) <= cost {
        return [[0; 7]; N];
    }
    coefficients
}
