//! The shapes that a patch's depth is made of: constant, tilt and cosines, at any position of the patch.
//!
//! Shape (i, j) is P_i(x) P_j(y) over the square [-1, 1]^2 with P_0 = 1, P_1 = sqrt(3) x and, for k of 2 and more,
//! P_k = sqrt(2) cos(k pi (x + 1) / 2), the functions of the discrete cosine transform. Each has a mean square of
//! one over the square. The straight line stands in for the first cosine, whose ends are flat: planes are what
//! rooms are made of.
//!
//! Positions are multiples of half a pixel of the finest level, values integers: the decoder derives from depths
//! what it reads next, so they must not depend on the platform.

use crate::patches::model::PATCH_PIXELS;

/// Highest order i + j.
const ORDER: usize = 5;

/// Number of shapes.
pub(in crate::patches) const N_SHAPES: usize = (ORDER + 1) * (ORDER + 2) / 2;

/// Fractional bits of the values of shapes and depths.
pub(in crate::patches) const FRACTION: u32 = 12;

/// Degrees (i, j) of the shapes, by order.
pub(in crate::patches) const DEGREES: [(u8, u8); N_SHAPES] = {
    let mut degrees = [(0, 0); N_SHAPES];
    let (mut k, mut order) = (0, 0);
    while order <= ORDER {
        let mut j = 0;
        while j <= order {
            degrees[k] = ((order - j) as u8, j as u8);
            k += 1;
            j += 1;
        }
        order += 1;
    }
    degrees
};

/// cos(pi t) for t in [0, 1], from sums and products alone, which are the same everywhere.
fn cosine(t: f64) -> f64 {
    let (t, sign) = if t > 0.5 { (1.0 - t, -1.0) } else { (t, 1.0) };
    let x = core::f64::consts::PI * t;
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..14 {
        let n = f64::from(n);
        term *= -x * x / ((2.0 * n - 1.0) * (2.0 * n));
        sum += term;
    }
    sign * sum
}

/// Derivative of P_k at x in [-1, 1].
pub(in crate::patches) fn derivative(k: usize, x: f64) -> f64 {
    match k {
        0 => 0.0,
        1 => 3.0_f64.sqrt(),
        _ => {
            let half_pi = 0.5 * core::f64::consts::PI;
            -(2.0_f64.sqrt()) * k as f64 * half_pi * (k as f64 * half_pi * (x + 1.0)).sin()
        }
    }
}

/// P_k at x in [-1, 1].
pub(in crate::patches) fn value(k: usize, x: f64) -> f64 {
    match k {
        0 => 1.0,
        1 => 3.0_f64.sqrt() * x,
        _ => {
            // k (x + 1) / 2 half turns, brought to [0, 1].
            let turns = 0.5 * k as f64 * (x + 1.0);
            let t = turns - 2.0 * (0.5 * turns).floor();
            2.0_f64.sqrt() * cosine(if t > 1.0 { 2.0 - t } else { t })
        }
    }
}

/// Values of the P_k at the half pixels of a patch of a given width.
#[derive(Debug, Clone)]
pub(in crate::patches) struct Basis {
    /// Half pixels per side.
    halves: usize,
    /// Values with `FRACTION` fractional bits: of the factors of all shapes along columns, and along rows.
    values: Vec<[[i32; N_SHAPES]; 2]>,
}

impl Basis {
    /// For patches that are `pixels` finest pixels wide.
    pub fn new(pixels: usize) -> Self {
        let halves = 2 * pixels;
        let values = (0..=halves)
            .map(|h| {
                let x = 2.0 * h as f64 / halves as f64 - 1.0;
                let of_degree: [i32; ORDER + 1] = std::array::from_fn(|k| {
                    (value(k, x) * f64::from(1 << FRACTION)).round() as i32
                });
                [DEGREES.map(|(i, _)| i), DEGREES.map(|(_, j)| j)]
                    .map(|degrees| degrees.map(|degree| of_degree[usize::from(degree)]))
            })
            .collect();
        Self { halves, values }
    }

    /// Those of all levels, coarsest first.
    pub fn of_levels(levels: u32) -> Vec<Self> {
        let of_doublings = |doublings: u32| Self::new((PATCH_PIXELS << doublings) as usize);
        (0..levels).rev().map(of_doublings).collect()
    }

    /// Depth of a patch at a half-pixel position, in steps with fraction.
    pub fn depth(&self, coefficients: &[i32; N_SHAPES], [hu, hv]: [usize; 2]) -> i64 {
        let shapes = self.at(hu, hv);
        coefficients.iter().zip(shapes).map(|(&c, shape)| i64::from(c) * i64::from(shape)).sum()
    }

    /// All shapes at half-pixel position `(hu, hv)` from the corner of the patch, 0 to `2 * pixels`.
    #[inline]
    pub fn at(&self, hu: usize, hv: usize) -> [i32; N_SHAPES] {
        let (x, y) = (&self.values[hu.min(self.halves)][0], &self.values[hv.min(self.halves)][1]);
        // Each factor takes 13 bits and a sign.
        std::array::from_fn(|k| (x[k] * y[k]) >> FRACTION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_has_a_mean_square_of_one() {
        let n = 400;
        for k in 0..=ORDER {
            let square =
                (0..n).map(|i| value(k, (2 * i + 1) as f64 / n as f64 - 1.0).powi(2)).sum::<f64>();
            assert!((square / f64::from(n) - 1.0).abs() < 1e-4, "{k}");
        }
    }

    #[test]
    fn cosines_are_those_of_the_library_and_slopes_their_derivatives() {
        for i in 0..=200 {
            let x = f64::from(i) / 100.0 - 1.0;
            for k in 2..=ORDER {
                let exact =
                    2.0_f64.sqrt() * (k as f64 * core::f64::consts::PI * (x + 1.0) / 2.0).cos();
                assert!((value(k, x) - exact).abs() < 1e-12);
                let h = 1e-6;
                let slope = (value(k, x + h) - value(k, x - h)) / (2.0 * h);
                assert!((derivative(k, x) - slope).abs() < 1e-5 || x.abs() > 0.99);
            }
        }
    }

    #[test]
    fn integer_values_are_those_of_the_shapes() {
        let basis = Basis::new(16);
        for (hu, hv) in [(0, 0), (1, 7), (16, 16), (32, 5)] {
            let (x, y) = (f64::from(hu) / 16.0 - 1.0, f64::from(hv) / 16.0 - 1.0);
            for (k, integer) in basis.at(hu as usize, hv as usize).into_iter().enumerate() {
                let exact = value(DEGREES[k].0.into(), x) * value(DEGREES[k].1.into(), y);
                assert!((f64::from(integer) / f64::from(1 << FRACTION) - exact).abs() < 2e-3);
            }
        }
    }
}
