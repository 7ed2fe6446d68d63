//! Normal equations solved for more and more shapes.

use crate::patches::constants::MAX_SHAPES;

/// Products that are added up in pairs, as many as [`dot`] takes at once.
const UNROLLED: usize = 8;

/// Cholesky's decomposition `G = L L'` of the equations so far, and `y` with `L y = r`. One more unknown adds a row, so that those
/// before stay as they are.
pub(super) struct Solution {
    n: usize,
    /// Rows of L up to the diagonal.
    factor: [[f64; MAX_SHAPES]; MAX_SHAPES],
    forward: [f64; MAX_SHAPES],
}

impl Solution {
    /// Without unknowns.
    pub fn new() -> Self {
        Self { n: 0, factor: [[0.0; MAX_SHAPES]; MAX_SHAPES], forward: [0.0; MAX_SHAPES] }
    }

    /// The solution with one more unknown, of at most [`MAX_SHAPES`]: `entry` gives its row of G, the last at the diagonal, and `right`
    /// is its part of r. `None` where the equations do not determine it.
    pub fn with(&mut self, entry: impl Fn(usize) -> f64, right: f64) -> Option<[f32; MAX_SHAPES]> {
        let n = self.n;
        let mut row = [0.0; MAX_SHAPES];
        for j in 0..=n {
            let other = if j < n { self.factor[j] } else { row };
            row[j] = (0..j).fold(entry(j), |left, k| left - other[k] * row[k]);
            if j < n {
                row[j] /= other[j];
            }
        }
        if row[n].is_nan() || row[n] <= 0.0 {
            return None;
        }
        row[n] = row[n].sqrt();
        let left = (0..n).fold(right, |left, k| left - self.forward[k] * row[k]);
        self.forward[n] = left / row[n];
        self.factor[n] = row;
        self.n += 1;
        Some(self.backward())
    }

    /// `c` with `L' c = y`.
    fn backward(&self) -> [f32; MAX_SHAPES] {
        let n = self.n;
        let mut solution = [0.0; MAX_SHAPES];
        for i in (0..n).rev() {
            let products = |m: usize| self.factor[m][i] * solution[m];
            solution[i] = (self.forward[i] - dot(i + 1, n, products)) / self.factor[i][i];
        }
        solution.map(|c| c as f32)
    }
}

/// Sum of the products from `first` to `end`, in the order in which nalgebra adds them up, so that files stay as they were.
fn dot(mut first: usize, end: usize, product: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    while end - first >= UNROLLED {
        for m in first..first + UNROLLED / 2 {
            sum += product(m) + product(m + UNROLLED / 2);
        }
        first += UNROLLED;
    }
    (first..end).fold(sum, |sum, m| sum + product(m))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn solutions_are_those_of_nalgebra_to_the_bit(
            rows in prop::collection::vec(prop::array::uniform12(-1.0_f64..1.0), 12..20),
            right in prop::array::uniform12(-9.0_f64..9.0),
        ) {
            let gram = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
            let mut solution = Solution::new();
            for n in 1..=MAX_SHAPES {
                let found = solution.with(|j| gram(n - 1, j), right[n - 1]);
                let matrix = nalgebra::DMatrix::from_fn(n, n, gram);
                let vector = nalgebra::DVector::from_fn(n, |i, _| right[i]);
                let wanted = matrix.cholesky().map(|factor| factor.solve(&vector));
                prop_assert_eq!(found.is_some(), wanted.is_some());
                let (Some(found), Some(wanted)) = (found, wanted) else { return Ok(()) };
                let wanted: Vec<f32> = wanted.iter().map(|&c| c as f32).collect();
                prop_assert_eq!(&found[..n], &wanted[..]);
            }
        }
    }

    #[test]
    fn what_the_equations_do_not_determine_has_no_solution() {
        let mut solution = Solution::new();
        assert_eq!(solution.with(|_| 4.0, 2.0).map(|c| c[0]), Some(0.5));
        assert_eq!(solution.with(|_| 4.0, 2.0), None);
        assert_eq!(Solution::new().with(|_| f64::NAN, 1.0), None);
        assert_eq!(Solution::new().with(|_| -1.0, 1.0), None);
    }
}
