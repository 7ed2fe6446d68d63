//! Small vectors as arrays, which clouds, models and files hold.
//!
//! Poses, decompositions and small systems are nalgebra's; these functions are for loops over points, where an array
//! needs no conversion. Sums run over x, y, z in this order, so that results are the same wherever they are computed.

use std::ops::{Add, Mul, Sub};

/// `a . b`.
#[inline]
pub fn dot<T: Copy + Mul<Output = T> + Add<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
#[inline]
pub fn cross<T: Copy + Mul<Output = T> + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a - b`.
#[inline]
pub fn minus<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + s b`.
#[inline]
pub fn add_scaled<T: Copy + Mul<Output = T> + Add<Output = T>>(
    a: [T; 3],
    s: T,
    b: [T; 3],
) -> [T; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// `|a - b|^2`.
#[inline]
pub fn squared_distance<T>(a: [T; 3], b: [T; 3]) -> T
where
    T: Copy + Mul<Output = T> + Add<Output = T> + Sub<Output = T>,
{
    let d = minus(a, b);
    dot(d, d)
}

/// `|v|`.
#[inline]
pub fn length<T: nalgebra::RealField + Copy>(v: [T; 3]) -> T {
    dot(v, v).sqrt()
}

/// `|a - b|`.
#[inline]
pub fn distance<T: nalgebra::RealField + Copy>(a: [T; 3], b: [T; 3]) -> T {
    squared_distance(a, b).sqrt()
}

/// `v / |v|`; zero stays zero.
#[inline]
pub fn unit<T: nalgebra::RealField + Copy>(v: [T; 3]) -> [T; 3] {
    let length = length(v);
    if length > T::zero() { v.map(|c| c / length) } else { v }
}

/// Number of the component of `v` that `better` prefers to all before it; the first of equal ones.
#[inline]
fn axis<T: Copy>(v: [T; 3], better: impl Fn(T, T) -> bool) -> usize {
    (1..3).fold(0, |best, a| if better(v[a], v[best]) { a } else { best })
}

/// Number of the largest component; the first of equal ones.
#[inline]
pub fn largest<T: Copy + PartialOrd>(v: [T; 3]) -> usize {
    axis(v, |a, b| a > b)
}

/// The axis along which the magnitude of `v` is smallest, as a unit vector; the first of equal ones.
#[inline]
pub fn least_axis<T: nalgebra::RealField + Copy>(v: [T; 3]) -> [T; 3] {
    let mut unit = [T::zero(); 3];
    unit[axis(v, |a, b| a.abs() < b.abs())] = T::one();
    unit
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_vector() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-10.0_f64..10.0)
    }

    proptest! {
        #[test]
        fn they_are_those_of_nalgebra(a in any_vector(), b in any_vector(), s in -3.0_f64..3.0) {
            let (v, w) = (nalgebra::Vector3::from(a), nalgebra::Vector3::from(b));
            let close = |a: [f64; 3], b: nalgebra::Vector3<f64>| (nalgebra::Vector3::from(a) - b).norm() < 1e-12;
            prop_assert!((dot(a, b) - v.dot(&w)).abs() < 1e-12);
            prop_assert!(close(cross(a, b), v.cross(&w)));
            prop_assert!(close(minus(a, b), v - w));
            prop_assert!(close(add_scaled(a, s, b), v + w * s));
            prop_assert!((squared_distance(a, b) - (v - w).norm_squared()).abs() < 1e-12);
            prop_assert!((distance(a, b) - (v - w).norm()).abs() < 1e-12);
            prop_assert!((length(a) - v.norm()).abs() < 1e-12);
            prop_assert!(close(unit(a), v.normalize()));
            prop_assert_eq!(largest(a), v.imax());
            prop_assert_eq!(least_axis(a)[v.iamin()], 1.0);
        }
    }

    #[test]
    fn zero_has_no_direction_and_equal_components_give_the_first_axis() {
        assert_eq!(unit([0.0_f32; 3]), [0.0; 3]);
        assert_eq!(largest([2, 2, 1]), 0);
        assert_eq!(least_axis([-1.0, 1.0, 1.0]), [1.0, 0.0, 0.0]);
        assert_eq!(least_axis([2.0, 1.0, -1.0]), [0.0, 1.0, 0.0]);
    }
}
