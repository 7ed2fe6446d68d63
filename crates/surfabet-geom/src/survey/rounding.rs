//! Coordinates that were rounded to a coarse step: of a map projection in single precision, of a file in whole metres.
//!
//! Half and double of each constant found the same on 40 clouds, one of which is rounded, to 0.5 m
//! (`docs/benchmarks/constants.md`): they guard against short and noisy columns of coordinates, and bound the time.

/// Points whose coordinates are compared.
const MAX_POINTS: usize = 1 << 16;

/// Of these one in so many is compared first.
const FIRST_OF: usize = 16;

/// Different coordinates along an axis that show a step: fewer may be those of walls and floors.
const LEAST_COORDINATES: usize = 64;

/// How far differences may be from multiples of the step, steps: they are themselves rounded to single precision.
const EXACTNESS: f64 = 0.05;

/// The largest step along an axis that the coordinates of all points are multiples of, but for one offset, metres; zero
/// where there is none above `least`.
pub(super) fn rounding(positions: &[[f32; 3]], least: f64) -> f64 {
    let every = positions.len().div_ceil(MAX_POINTS).max(1);
    let along = |axis: usize| {
        // No difference is smaller than the step: of most clouds a few of these points show that there is none.
        if closest(&some_values(positions, axis, FIRST_OF * every)) <= least {
            return 0.0;
        }
        step_of(&some_values(positions, axis, every))
    };
    let step = (0..3).map(along).fold(0.0, f64::max);
    if step > least { step } else { 0.0 }
}

/// Different coordinates of every so many points along an axis, ascending.
fn some_values(positions: &[[f32; 3]], axis: usize, every: usize) -> Vec<f32> {
    let mut values: Vec<f32> = positions.iter().step_by(every).map(|p| p[axis]).collect();
    values.sort_unstable_by(f32::total_cmp);
    values.dedup();
    values
}

/// The differences of ascending values.
fn differences(values: &[f32]) -> impl Iterator<Item = f64> {
    values.windows(2).map(|w| f64::from(w[1]) - f64::from(w[0]))
}

/// The smallest difference of ascending values; infinite without any.
fn closest(values: &[f32]) -> f64 {
    differences(values).fold(f64::INFINITY, f64::min)
}

/// The step that all differences of ascending values are multiples of, the smallest difference; zero where they are not.
fn step_of(values: &[f32]) -> f64 {
    if values.len() < LEAST_COORDINATES {
        return 0.0;
    }
    let step = closest(values);
    let is_multiple = |difference: f64| {
        let steps = difference / step;
        (steps - steps.round()).abs() <= EXACTNESS
    };
    if differences(values).all(is_multiple) { step } else { 0.0 }
}
