//! The butterflies of the region-adaptive hierarchical transform: orthonormal for any set of children of a cell.

/// A butterfly: two of eight slots become their weighted mean and their difference.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Butterfly {
    /// Slot of the first value, then of the mean.
    pub mean: usize,
    /// Slot of the second value, then of the difference.
    pub difference: usize,
    /// `sqrt(w1 / (w1 + w2))` of the weights of the two.
    first: f32,
    /// `sqrt(w2 / (w1 + w2))`.
    second: f32,
}

/// The butterflies of one cell with up to eight children: axis by axis, those of what is left.
pub(super) struct Butterflies {
    /// In the order of the forward transform.
    all: [Butterfly; 7],
    n: usize,
}

impl Butterflies {
    /// Those of the children in these octants, with the numbers of leaf cells below each as weights.
    pub fn new(octants: &[usize], weights: &[f32]) -> Self {
        let mut weight = [0.0_f32; 8];
        for (&o, &w) in octants.iter().zip(weights) {
            weight[o] = w;
        }
        let mut found = Self { all: [Butterfly::default(); 7], n: 0 };
        // Slot that holds what remains of each octant.
        let mut slot: [usize; 8] = std::array::from_fn(|o| o);
        for axis in 0..3 {
            for low in (0..8).step_by(1 << (axis + 1)) {
                let (a, b) = (slot[low], slot[low + (1 << axis)]);
                let (wa, wb) = (weight[a], weight[b]);
                if wa > 0.0 && wb > 0.0 {
                    let total = wa + wb;
                    found.all[found.n] = Butterfly {
                        mean: a,
                        difference: b,
                        first: (wa / total).sqrt(),
                        second: (wb / total).sqrt(),
                    };
                    found.n += 1;
                    weight[a] = total;
                } else if wb > 0.0 {
                    slot[low] = b;
                }
            }
        }
        found
    }

    /// In the order of the forward transform.
    pub fn all(&self) -> &[Butterfly] {
        &self.all[..self.n]
    }

    /// From values times the roots of their weights to the mean of all, times the root of their sum, and differences:
    /// `m = s1 x + s2 y`, `d = s1 y - s2 x`.
    pub fn forward(&self, values: &mut [f32; 8]) {
        for &Butterfly { mean, difference, first, second } in self.all() {
            let (x, y) = (values[mean], values[difference]);
            values[mean] = first * x + second * y;
            values[difference] = first * y - second * x;
        }
    }

    /// Takes [`Butterflies::forward`] back: `x = s1 m - s2 d`, `y = s2 m + s1 d`.
    pub fn inverse(&self, values: &mut [f32; 8]) {
        for &Butterfly { mean, difference, first, second } in self.all().iter().rev() {
            let (m, d) = (values[mean], values[difference]);
            values[mean] = first * m - second * d;
            values[difference] = second * m + first * d;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn butterflies_are_orthonormal_and_keep_the_weighted_mean(
            present in 1_u8..=255,
            values in prop::array::uniform8(-200.0_f32..200.0),
            weights in prop::array::uniform8(1.0_f32..50.0),
        ) {
            let octants: Vec<usize> = (0..8).filter(|o| present >> o & 1 != 0).collect();
            let of: Vec<f32> = octants.iter().map(|&o| weights[o]).collect();
            let butterflies = Butterflies::new(&octants, &of);
            prop_assert_eq!(butterflies.all().len(), octants.len() - 1);
            let mut transformed = [0.0; 8];
            octants.iter().for_each(|&o| transformed[o] = values[o] * weights[o].sqrt());
            let before = transformed;
            butterflies.forward(&mut transformed);
            let energy = |v: &[f32; 8]| v.iter().map(|x| x * x).sum::<f32>();
            prop_assert!((energy(&before) - energy(&transformed)).abs() <= 1e-3 * energy(&before) + 1e-3);
            if let Some(last) = butterflies.all().last() {
                let total: f32 = of.iter().sum();
                let mean = octants.iter().map(|&o| weights[o] * values[o]).sum::<f32>() / total;
                prop_assert!((transformed[last.mean] - mean * total.sqrt()).abs() < 0.05);
            }
            butterflies.inverse(&mut transformed);
            for (a, b) in transformed.iter().zip(&before) {
                prop_assert!((a - b).abs() < 0.01);
            }
        }
    }
}
