//! Accumulated errors of all neurons, which decay with every signal, and the largest of them.
//!
//! Step 10 multiplies all errors E by `1 - beta`. Stored is `E s` with a common scale s that grows by `1 / (1 - beta)` with
//! every signal instead: a signal costs one addition. The largest is known per group of neurons; additions can only raise
//! it.

/// Neurons per group: the largest of n neurons is found among `n / GROUP` groups and in one of them.
const GROUP: usize = 64;

/// Scale at which the stored numbers are divided by it, far from the largest `f64`.
const LARGEST_SCALE: f64 = 1e100;

/// In place of the error of a neuron that does not exist: below every error, whatever it is multiplied with.
const NO_NEURON: f64 = f64::NEG_INFINITY;

/// Accumulated errors by neuron.
#[derive(Debug, Clone)]
pub(in crate::gas) struct AccumulatedErrors {
    /// `E s` of every neuron.
    scaled: Vec<f64>,
    /// Largest of each group.
    largest: Vec<f64>,
    /// s.
    scale: f64,
    /// Factor by which `scale` grows with a signal: `1 / (1 - beta)`.
    growth: f64,
}

impl AccumulatedErrors {
    /// No neurons.
    pub(in crate::gas) fn new(beta: f64) -> Self {
        Self { scaled: Vec::new(), largest: Vec::new(), scale: 1.0, growth: 1.0 / (1.0 - beta) }
    }

    /// The accumulated error of a neuron.
    pub(in crate::gas) fn get(&self, id: u32) -> f64 {
        self.scaled[id as usize] / self.scale
    }

    /// Step 5: adds to the error of a neuron.
    #[inline]
    pub(in crate::gas) fn add(&mut self, id: u32, error: f64) {
        let id = id as usize;
        let sum = self.scaled[id] + error * self.scale;
        self.scaled[id] = sum;
        let largest = &mut self.largest[id / GROUP];
        if sum > *largest {
            *largest = sum;
        }
    }

    /// Sets the error of a neuron, which may be new.
    pub(in crate::gas) fn set(&mut self, id: u32, error: f64) {
        let value = error * self.scale;
        self.put(id as usize, value);
    }

    /// Removes a neuron.
    pub(in crate::gas) fn remove(&mut self, id: u32) {
        self.put(id as usize, NO_NEURON);
    }

    /// Sets the stored number of a neuron, which may be new.
    fn put(&mut self, id: usize, value: f64) {
        if id >= self.scaled.len() {
            self.scaled.resize((id + 1).next_multiple_of(GROUP), NO_NEURON);
            self.largest.resize(self.scaled.len() / GROUP, NO_NEURON);
        }
        self.scaled[id] = value;
        self.renew(id / GROUP);
    }

    /// Computes the largest of a group.
    fn renew(&mut self, group: usize) {
        let of = &self.scaled[group * GROUP..(group + 1) * GROUP];
        self.largest[group] = of.iter().fold(NO_NEURON, |m, &e| if e > m { e } else { m });
    }

    /// Step 10: all errors decay.
    #[inline]
    pub(in crate::gas) fn decay(&mut self) {
        self.scale *= self.growth;
        if self.scale > LARGEST_SCALE {
            let shrink = 1.0 / self.scale;
            self.scaled.iter_mut().for_each(|e| *e *= shrink);
            (0..self.largest.len()).for_each(|group| self.renew(group));
            self.scale = 1.0;
        }
    }

    /// The neuron with the largest error, of equal ones the one with the smallest id; `None` without neurons.
    pub(in crate::gas) fn largest(&self) -> Option<u32> {
        let (group, &largest) = self
            .largest
            .iter()
            .enumerate()
            .reduce(|best, next| if next.1 > best.1 { next } else { best })?;
        let first = group * GROUP;
        let at = self.scaled[first..first + GROUP].iter().position(|&e| e == largest)?;
        (largest > NO_NEURON).then_some((first + at) as u32)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn lazy_decay_is_decay(
            steps in prop::collection::vec((0_u32..150, 0.0_f64..4.0, 0_u8..12), 1..60),
            beta in prop_oneof![Just(0.0), 0.0001_f64..0.5],
        ) {
            let mut lazy = AccumulatedErrors::new(beta);
            let mut eager = [None; 150];
            for (id, error, kind) in steps {
                match (kind, eager[id as usize]) {
                    (0, Some(_)) => {
                        lazy.remove(id);
                        eager[id as usize] = None;
                    }
                    (1, _) | (_, None) => {
                        lazy.set(id, error);
                        eager[id as usize] = Some(error);
                    }
                    (_, Some(before)) => {
                        lazy.add(id, error);
                        eager[id as usize] = Some(before + error);
                    }
                }
                // Many signals at a time, so that the scale is taken in on the way.
                for _ in 0..100 {
                    lazy.decay();
                    eager.iter_mut().flatten().for_each(|e| *e *= 1.0 - beta);
                }
                let mut largest = 0.0;
                for (id, e) in eager.iter().enumerate().filter_map(|(i, e)| Some((i, (*e)?))) {
                    prop_assert!((lazy.get(id as u32) - e).abs() <= 1e-9 * e + 1e-60);
                    largest = f64::max(largest, e);
                }
                if let Some(found) = lazy.largest() {
                    prop_assert!(lazy.get(found) >= largest * (1.0 - 1e-9) - 1e-60);
                }
            }
        }
    }

    #[test]
    fn ties_go_to_the_smallest_id_and_nobody_has_no_largest() {
        let mut errors = AccumulatedErrors::new(0.1);
        assert_eq!(errors.largest(), None);
        for id in [130, 7, 70] {
            errors.set(id, 2.0);
        }
        assert_eq!(errors.largest(), Some(7));
        errors.remove(7);
        assert_eq!(errors.largest(), Some(70));
        errors.add(130, 0.5);
        assert_eq!(errors.largest(), Some(130));
        for id in [70, 130] {
            errors.remove(id);
        }
        assert_eq!(errors.largest(), None);
    }
}
