//! Vectors in space.

use std::ops::{Add, Mul, Sub};

pub(crate) fn dot<T: Copy + Mul<Output = T> + Add<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross<T: Copy + Mul<Output = T> + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn minus<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

/// The axis with the smallest component; the first of equal ones.
pub(crate) fn least_axis(v: [f64; 3]) -> [f64; 3] {
    let least = (1..3).fold(0, |m, a| if v[a].abs() < v[m].abs() { a } else { m });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    axis
}
