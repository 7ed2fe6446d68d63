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

/// `v` at unit length; zero stays zero.
pub(crate) fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { v }
}

/// `a + s * b`.
pub(crate) fn add_scaled(a: [f32; 3], s: f32, b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// The axis with the smallest component; the first of equal ones.
pub(crate) fn least_axis(v: [f64; 3]) -> [f64; 3] {
    let least = (1..3).fold(0, |m, a| if v[a].abs() < v[m].abs() { a } else { m });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    axis
}
