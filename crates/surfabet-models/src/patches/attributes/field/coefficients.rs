//! The coefficients of a field, in the order in which they are coded.

/// Coefficients of the butterflies of a cell, by channel.
pub(super) type Coefficients<const N: usize> = [[i32; 7]; N];

/// All coefficients so far: the mean of all cells by channel, then cell by cell those of each butterfly by channel.
pub(super) struct Coded<const N: usize> {
    pub all: Vec<i32>,
}

impl<const N: usize> Coded<N> {
    /// None yet, with room for those of so many cells.
    pub fn with_capacity(cells: usize) -> Self {
        Self { all: Vec::with_capacity(N * cells) }
    }

    /// Of the coefficients of a model those of the next cell, which has `n` butterflies.
    pub fn next_of(&self, model: &[i32], n: usize) -> Coefficients<N> {
        let mut coefficients = [[0; 7]; N];
        let from = self.all.len();
        for (i, of) in model[from..from + N * n].chunks(N).enumerate() {
            (0..N).for_each(|c| coefficients[c][i] = of[c]);
        }
        coefficients
    }

    /// Adds those of the next cell, which has `n` butterflies. Gives the activity of the cell, 0 to 4: the sum of their
    /// magnitudes.
    pub fn add(&mut self, coefficients: &Coefficients<N>, n: usize) -> u8 {
        for i in 0..n {
            self.all.extend(coefficients.iter().map(|of| of[i]));
        }
        let sum: u32 = coefficients.iter().flatten().map(|c| c.unsigned_abs().min(4)).sum();
        sum.min(4) as u8
    }
}
