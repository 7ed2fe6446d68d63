//! Signals as their codes stand for them.

use surfabet_base::parallel;

use crate::codes::{SIGNALS_PER_TASK, SparseCodes, add_code};
use crate::dictionary::Dictionary;
use crate::signals::Signals;

/// Codes with what they leave of the signals.
pub struct Coded {
    pub codes: SparseCodes,
    /// `s − D x`, signal-major; also where nothing is observed.
    pub residuals: Vec<f32>,
    /// `Σ w (s − D x)²` of every signal.
    pub errors: Vec<f64>,
}

impl Coded {
    /// Codes of `signals` over `dictionary`.
    pub fn new(dictionary: &Dictionary, signals: &Signals<'_>, codes: SparseCodes) -> Self {
        let n = signals.n_features();
        let mut coded = Self { codes, residuals: vec![0.0; signals.len() * n], errors: Vec::new() };
        coded.refresh(dictionary, signals);
        coded
    }

    /// Computes residuals and errors from the codes again.
    pub fn refresh(&mut self, dictionary: &Dictionary, signals: &Signals<'_>) {
        let n = signals.n_features();
        parallel::for_each(self.residuals.chunks_mut(SIGNALS_PER_TASK * n), |task, rows| {
            for (i, row) in (task * SIGNALS_PER_TASK..).zip(rows.chunks_mut(n)) {
                row.fill(0.0);
                let (atoms, coefficients) = self.codes.code(i);
                add_code(dictionary, atoms, coefficients, row);
                for (r, &s) in row.iter_mut().zip(signals.values(i)) {
                    *r = s - *r;
                }
            }
        });
        self.measure(signals);
    }

    /// Computes the errors from the residuals.
    pub fn measure(&mut self, signals: &Signals<'_>) {
        let square = |r: f32| f64::from(r).powi(2);
        let n = signals.n_features();
        self.errors = parallel::map_range(signals.len(), |i| {
            let row = &self.residuals[i * n..(i + 1) * n];
            match signals.weights(i) {
                None => row.iter().map(|&r| square(r)).sum(),
                Some(w) => row.iter().zip(w).map(|(&r, &w)| f64::from(w) * square(r)).sum(),
            }
        });
    }

    /// Sum of the errors.
    pub fn objective(&self) -> f64 {
        self.errors.iter().sum()
    }
}
