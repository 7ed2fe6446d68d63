//! Choice of the coefficients of a cell: of least Lagrangian cost `J = D + lambda R`.

use super::Steps;
use super::coefficients::Coefficients;
use super::contexts::CellContext;
use super::models::{FieldModels, MAX_COEFFICIENT, Prices};
use crate::patches::constants::LEVEL_RATES;

/// Coefficients q of a cell that cost least; coefficient `i` of `residuals` is in slot `slots[i]`.
///
/// The transform is orthonormal, so the squared error is that of the transformed residuals r:
/// `D = sum of (r - q step)^2`, in squares of the unit of the values. One after another each q is zero, the nearest to `r / step`, or
/// the next nearer to zero, whichever has the least `(r - q step)^2 + lambda bits(q)`, with the share of `lambda` that is that of
/// the level; in the end all of them are compared with none.
pub(super) fn choose<const N: usize>(
    models: &FieldModels<N>,
    context: &CellContext<N>,
    slots: &[usize],
    residuals: &[[f32; 8]; N],
    steps: Steps<N>,
    lambda: f32,
) -> Coefficients<N> {
    let mut coefficients = [[0; 7]; N];
    let steps = steps.of_level(context.level);
    let lambda = lambda * LEVEL_RATES[context.level.min(LEVEL_RATES.len() - 1)];
    let reach = |c: usize| slots.iter().any(|&s| residuals[c][s].abs() >= 0.5 * steps[c]);
    if !(0..N).any(reach) {
        return coefficients;
    }
    let mut prices = Prices::new(models, context);
    let (mut distortion_of_none, mut cost) = (0.0, lambda * prices.any(true));
    for (i, &slot) in slots.iter().enumerate() {
        for channel in 0..N {
            let (step, residual) = (steps[channel], residuals[channel][slot]);
            let limit = MAX_COEFFICIENT as f32;
            let nearest = (residual / step).round().clamp(-limit, limit) as i32;
            let others = std::array::from_fn(|c| coefficients[c][i]);
            let bits = prices.coefficient((i, channel), others);
            let cost_of = |q: i32| (residual - q as f32 * step).powi(2) + lambda * bits(q);
            let mut best = (0, cost_of(0));
            if nearest != 0 {
                for q in [nearest, nearest - nearest.signum()] {
                    let cost = cost_of(q);
                    if cost < best.1 {
                        best = (q, cost);
                    }
                }
            }
            coefficients[channel][i] = best.0;
            cost += best.1;
            distortion_of_none += residual * residual;
            drop(bits);
            prices.add((i, channel), best.0, others);
        }
    }
    if distortion_of_none + lambda * prices.any(false) <= cost {
        return [[0; 7]; N];
    }
    coefficients
}
