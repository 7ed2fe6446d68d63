//! Coordinates that were rounded to a coarse step: of a map projection in single precision, of a file in whole metres.

/// Points whose coordinates are looked at.
const MAX_POINTS: usize = 1 << 16;

/// Different coordinates along an axis that show a step: fewer may be those of walls and floors.
const LEAST_COORDINATES: usize = 64;

/// How far differences may be from multiples of the step, steps: they are themselves rounded to single precision.
const EXACTNESS: f64 = 0.05;

/// The largest step along an axis that the coordinates of all points are multiples of, but for one offset, metres; zero
/// where there is none.
pub(super) fn rounding(positions: &[[f32; 3]]) -> f64 {
    let every = positions.len().div_ceil(MAX_POINTS).max(1);
    let along = |axis: usize| {
        let mut values: Vec<f32> = positions.iter().step_by(every).map(|p| p[axis]).collect();
        values.sort_by(f32::total_cmp);
        values.dedup();
        step_of(&values)
    };
    (0..3).map(along).fold(0.0, f64::max)
}

/// The step that all differences of ascending values are multiples of, the smallest difference; zero where they are not.
fn step_of(values: &[f32]) -> f64 {
    if values.len() < LEAST_COORDINATES {
        return 0.0;
    }
    let differences = || values.windows(2).map(|w| f64::from(w[1]) - f64::from(w[0]));
    let step = differences().fold(f64::INFINITY, f64::min);
    let is_multiple = |difference: f64| {
        let steps = difference / step;
        (steps - steps.round()).abs() <= EXACTNESS
    };
    if differences().all(is_multiple) { step } else { 0.0 }
}
