//! The butterflies of [`super::butterflies`] on whole numbers, for values that are not multiplied by the roots of their weights.
//!
//! With weights `v` and `w` of two slots, the orthonormal butterfly makes of their values `x` and `y` the mean `m` and the
//! coefficient `d = (y - x) / (f + g)`, and takes it back by `x = m - f d`, `y = m + g d`, where
//! `f = sqrt(w / ((v + w) v))` and `g = sqrt(v / ((v + w) w))`. All numbers that are computed here stay below 2^53, so that
//! double precision holds them too.

use super::estimates::length;

/// Fractional bits of a value.
pub(in crate::patches::attributes) const FRACTION: u32 = 6;

/// Fractional bits of the factors f and g.
const FACTOR_BITS: u32 = 20;

/// Fractional bits of a step: it is in 32nds.
const STEP_BITS: u32 = 5;

/// Fractional bits of a coefficient times its step times a factor, beyond those of a value.
const PRODUCT_BITS: u32 = STEP_BITS + FACTOR_BITS - FRACTION;

/// Largest value, in units of 2^-6: the difference of two fits 32 bits.
const MAX_VALUE: i64 = (1 << 30) - 1;

/// Largest coefficient times its step that is told apart, and the largest product of that and a factor; learned models
/// have none as large.
const MAX_SCALED: i64 = 1 << 41;
const MAX_PRODUCT: i64 = 1 << 51;

/// A value within its bounds.
pub(super) fn bounded(value: i64) -> i32 {
    value.clamp(-MAX_VALUE, MAX_VALUE) as i32
}

/// A butterfly: two of eight slots become their weighted mean and their difference.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct WholeButterfly {
    /// Slot of the first value, then of the mean.
    low: usize,
    /// Slot of the second value.
    high: usize,
    /// The axis along which the second value lies beyond the first.
    pub axis: usize,
    /// Share of the second weight in both, in units of 2^-16.
    share: i64,
    /// f and g, in units of 2^-20.
    factors: [i64; 2],
    /// Class of the weights: binary digits of `v w / (v + w)`.
    pub weights: u8,
}

impl WholeButterfly {
    fn new(low: usize, high: usize, axis: usize, [v, w]: [u64; 2]) -> Self {
        // Of weights below 2^26 the quotients take 26 and 40 bits.
        let share = |of: u64| (of << 26) / (v + w);
        let factor = |of: u64, by: u64| ((share(of) << 14) / by).isqrt() as i64;
        Self {
            low,
            high,
            axis,
            share: (share(w) >> 10) as i64,
            factors: [factor(w, v), factor(v, w)],
            weights: length(v * w / (v + w)),
        }
    }

    /// Size class of the coefficient of a difference of two values, in steps of so many 32nds: with its sign, 1 from an eighth of a
    /// step on, 2 from a quarter, up to 6 from four.
    pub fn change_class(&self, difference: i64, step: i64) -> i8 {
        let size = difference.abs() << PRODUCT_BITS;
        let one = (self.factors[0] + self.factors[1]) * step;
        let reached = [8 * size >= one, 4 * size >= one, 2 * size >= one, size >= one];
        let beyond = [size >= 2 * one, size >= 4 * one];
        let class = reached.iter().chain(&beyond).filter(|reached| **reached).count() as i8;
        if difference < 0 { -class } else { class }
    }
}

/// The butterflies of one cell with up to eight children: axis by axis, those of what is left.
pub(super) struct WholeButterflies {
    /// In the order of the forward transform.
    all: [WholeButterfly; 7],
    n: usize,
}

impl WholeButterflies {
    /// Those of at least two children in these octants, with the numbers of leaf cells below each as weights.
    pub fn new(octants: &[usize], weights: &[u32]) -> Self {
        let mut weight = [0_u64; 8];
        for (&o, &w) in octants.iter().zip(weights) {
            weight[o] = u64::from(w);
        }
        let mut found = Self { all: [WholeButterfly::default(); 7], n: 0 };
        // Slot that holds what remains of each octant.
        let mut slot: [usize; 8] = std::array::from_fn(|o| o);
        for axis in 0..3 {
            for low in (0..8).step_by(1 << (axis + 1)) {
                let (a, b) = (slot[low], slot[low + (1 << axis)]);
                let both = [weight[a], weight[b]];
                if both[0] > 0 && both[1] > 0 {
                    found.all[found.n] = WholeButterfly::new(a, b, axis, both);
                    found.n += 1;
                    weight[a] = both[0] + both[1];
                } else if both[1] > 0 {
                    slot[low] = b;
                }
            }
        }
        found
    }

    /// In the order of the forward transform.
    pub fn all(&self) -> &[WholeButterfly] {
        &self.all[..self.n]
    }

    /// The mean of the values in the slots, which are lost; `visit` gets the number of each butterfly, it, and the
    /// difference of its two values.
    pub fn forward(
        &self,
        slots: &mut [i32; 8],
        mut visit: impl FnMut(usize, &WholeButterfly, i64),
    ) -> i32 {
        let mut mean = 0;
        for (i, butterfly) in self.all().iter().enumerate() {
            let first = i64::from(slots[butterfly.low]);
            let difference = i64::from(slots[butterfly.high]) - first;
            visit(i, butterfly, difference);
            // Between the two values.
            mean = (first + ((difference * butterfly.share + (1 << 15)) >> 16)) as i32;
            slots[butterfly.low] = mean;
        }
        mean
    }

    /// The values of a mean and of coefficients in steps of so many 32nds, into the slots.
    pub fn inverse(&self, slots: &mut [i64; 8], mean: i64, coefficients: &[i32; 7], step: i64) {
        if let Some(last) = self.all().last() {
            slots[last.low] = mean;
        }
        for (butterfly, &q) in self.all().iter().zip(coefficients).rev() {
            let scaled = (i64::from(q) * step).clamp(-MAX_SCALED, MAX_SCALED);
            let part = |factor: i64| {
                let product = (scaled * factor).clamp(-MAX_PRODUCT, MAX_PRODUCT);
                (product + (1 << (PRODUCT_BITS - 1))) >> PRODUCT_BITS
            };
            let mean = slots[butterfly.low];
            slots[butterfly.low] = mean - part(butterfly.factors[0]);
            slots[butterfly.high] = mean + part(butterfly.factors[1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::butterflies::Butterflies;
    use super::*;
    use proptest::prelude::*;

    /// Different octants with weights and values.
    fn children() -> impl Strategy<Value = Vec<(usize, u32, i32)>> {
        let child = (1_u32..1000, -16_000_i32..16_000);
        let some = prop::collection::btree_map(0_usize..8, child, 2..9);
        some.prop_map(|all| all.into_iter().map(|(o, (w, v))| (o, w, v)).collect())
    }

    proptest! {
        /// Against the orthonormal transform in single precision.
        #[test]
        fn they_are_the_orthonormal_ones(
            children in children(),
            coefficients in prop::array::uniform7(-20_i32..20),
            step in 1_i64..2000,
        ) {
            let octants: Vec<usize> = children.iter().map(|c| c.0).collect();
            let weights: Vec<u32> = children.iter().map(|c| c.1).collect();
            let whole = WholeButterflies::new(&octants, &weights);
            let floats: Vec<f32> = weights.iter().map(|&w| w as f32).collect();
            let exact = Butterflies::new(&octants, &floats);
            prop_assert_eq!(whole.all().len(), children.len() - 1);

            // Forward: the mean, and each coefficient to its class.
            let (mut slots, mut values) = ([0; 8], [0.0_f32; 8]);
            for &(o, w, v) in &children {
                slots[o] = v;
                values[o] = (w as f32).sqrt() * v as f32 / 64.0;
            }
            exact.forward(&mut values);
            let mut classes = Vec::new();
            let mean = whole.forward(&mut slots, |_, b, d| classes.push(b.change_class(d, step)));
            let total: f32 = floats.iter().sum();
            let root = exact.all()[exact.all().len() - 1].mean;
            prop_assert!((mean as f32 / 64.0 - values[root] / total.sqrt()).abs() < 0.15);
            for (butterfly, class) in exact.all().iter().zip(classes) {
                let steps = values[butterfly.difference] / (step as f32 / 32.0);
                let bounds = [0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, f32::INFINITY];
                let at = class.unsigned_abs() as usize;
                // Rounded values are off by up to 3 units, of 2^-6, at each of two sides, weighed by up to 22.
                let off = 0.02 * steps.abs() + 3.0 * 22.0 / 64.0 * 32.0 / step as f32;
                prop_assert!(steps.abs() >= bounds[at] - off && steps.abs() <= bounds[at + 1] + off);
            }

            // Inverse.
            let mut slots = [0; 8];
            whole.inverse(&mut slots, 64 * 100, &coefficients, step);
            let mut values = [0.0_f32; 8];
            for (butterfly, &q) in exact.all().iter().zip(&coefficients) {
                values[butterfly.difference] = q as f32 * step as f32 / 32.0;
            }
            values[root] = total.sqrt() * 100.0;
            exact.inverse(&mut values);
            for &(o, w, _) in &children {
                let wanted = values[o] / (w as f32).sqrt();
                let found = slots[o] as f32 / 64.0;
                prop_assert!((found - wanted).abs() < 0.1 + 1e-3 * wanted.abs(), "{found} {wanted}");
            }
        }
    }

    #[test]
    fn the_largest_coefficients_stay_within_bounds() {
        let whole = WholeButterflies::new(&[0, 1, 7], &[1, (1 << 25) - 1, 1 << 25]);
        for q in [i32::MAX, i32::MIN] {
            let mut slots = [0; 8];
            whole.inverse(&mut slots, MAX_VALUE, &[q; 7], 37 * 4096);
            assert!(slots.iter().all(|s| s.abs() < 1 << 40), "{slots:?}");
        }
    }
}
