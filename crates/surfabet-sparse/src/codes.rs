//! Sparse codes: `X` of HSCSM eq. 1, and back to signals by eq. 3.

use surfabet_base::parallel;

use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::signals::Signals;

/// Signals handed to a thread at a time where the work per signal is small.
pub(crate) const SIGNALS_PER_TASK: usize = 256;

/// One sparse code per signal: which atoms, and how much of each, in the order they were chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseCodes {
    offsets: Vec<usize>,
    atoms: Vec<u32>,
    coefficients: Vec<f32>,
}

impl Default for SparseCodes {
    fn default() -> Self {
        Self { offsets: vec![0], atoms: Vec::new(), coefficients: Vec::new() }
    }
}

impl SparseCodes {
    /// Codes from their parts: code `i` is `offsets[i]..offsets[i + 1]` of `atoms` and `coefficients`.
    ///
    /// # Errors
    /// `offsets` does not start at 0, falls, or does not end at the common length of the other two.
    pub fn from_parts(
        offsets: Vec<usize>,
        atoms: Vec<u32>,
        coefficients: Vec<f32>,
    ) -> Result<Self> {
        if atoms.len() != coefficients.len() {
            return Err(Error::InconsistentCodes("there must be one coefficient per atom"));
        }
        if offsets.first() != Some(&0) || offsets.last() != Some(&atoms.len()) {
            return Err(Error::InconsistentCodes("offsets must run from 0 to the number of atoms"));
        }
        if !offsets.is_sorted() {
            return Err(Error::InconsistentCodes("offsets must not fall"));
        }
        Ok(Self { offsets, atoms, coefficients })
    }

    /// Number of codes.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// True when there are no codes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Atoms and coefficients of code `i`.
    ///
    /// # Panics
    /// If `i` is not below [`SparseCodes::len`].
    pub fn code(&self, i: usize) -> (&[u32], &[f32]) {
        let range = self.offsets[i]..self.offsets[i + 1];
        (&self.atoms[range.clone()], &self.coefficients[range])
    }

    /// Where each code starts, and the end of the last.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The atoms of all codes, one code after the other.
    pub fn atoms(&self) -> &[u32] {
        &self.atoms
    }

    /// The coefficients of all codes, one code after the other.
    pub fn coefficients(&self) -> &[f32] {
        &self.coefficients
    }

    pub(crate) fn coefficients_mut(&mut self) -> &mut [f32] {
        &mut self.coefficients
    }

    pub(crate) fn push(&mut self, atoms: &[u32], coefficients: &[f32]) {
        self.atoms.extend_from_slice(atoms);
        self.coefficients.extend_from_slice(coefficients);
        self.offsets.push(self.atoms.len());
    }

    pub(crate) fn append(&mut self, other: &Self) {
        for i in 0..other.len() {
            let (atoms, coefficients) = other.code(i);
            self.push(atoms, coefficients);
        }
    }

    /// How many codes use each of `n_atoms` atoms.
    pub(crate) fn usage(&self, n_atoms: usize) -> Vec<usize> {
        let mut usage = vec![0; n_atoms];
        for &atom in &self.atoms {
            usage[atom as usize] += 1;
        }
        usage
    }

    /// The same codes with every atom `a` called `new_index[a]`.
    pub(crate) fn renumbered(mut self, new_index: &[u32]) -> Self {
        for atom in &mut self.atoms {
            *atom = new_index[*atom as usize];
        }
        self
    }

    fn check(&self, dictionary: &Dictionary) -> Result<()> {
        let n_atoms = dictionary.n_atoms();
        match self.atoms.iter().position(|&a| a as usize >= n_atoms) {
            None => Ok(()),
            Some(at) => Err(Error::UnknownAtom {
                code: self.offsets.partition_point(|&o| o <= at) - 1,
                atom: self.atoms[at],
                n_atoms,
            }),
        }
    }
}

/// `out += Σ coefficient · atom` over a code (HSCSM eq. 3).
pub(crate) fn add_code(
    dictionary: &Dictionary,
    atoms: &[u32],
    coefficients: &[f32],
    out: &mut [f32],
) {
    for (&atom, &x) in atoms.iter().zip(coefficients) {
        for (o, &d) in out.iter_mut().zip(dictionary.atom(atom as usize)) {
            *o += x * d;
        }
    }
}

/// The signals that `codes` stand for, `D · X`, signal-major with `dictionary.n_features()` values each
/// (HSCSM eq. 2 and 3).
///
/// # Errors
/// A code names an atom that the dictionary does not have.
pub fn reconstruct(dictionary: &Dictionary, codes: &SparseCodes) -> Result<Vec<f32>> {
    codes.check(dictionary)?;
    let n = dictionary.n_features();
    let mut out = vec![0.0; codes.len() * n];
    parallel::for_each(out.chunks_mut(SIGNALS_PER_TASK * n), |task, rows| {
        for (i, row) in (task * SIGNALS_PER_TASK..).zip(rows.chunks_mut(n)) {
            let (atoms, coefficients) = codes.code(i);
            add_code(dictionary, atoms, coefficients, row);
        }
    });
    Ok(out)
}

/// Weighted squared error of every signal, `Σ_i w_i (s_i − (D x)_i)²`, in double precision.
///
/// # Errors
/// Dictionary, signals and codes do not fit together.
pub fn squared_errors(
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    codes: &SparseCodes,
) -> Result<Vec<f64>> {
    codes.check(dictionary)?;
    if signals.n_features() != dictionary.n_features() {
        return Err(Error::FeatureMismatch {
            dictionary: dictionary.n_features(),
            signals: signals.n_features(),
        });
    }
    if codes.len() != signals.len() {
        return Err(Error::CodeCount { codes: codes.len(), signals: signals.len() });
    }
    let mut errors = vec![0.0; signals.len()];
    parallel::for_each(errors.chunks_mut(SIGNALS_PER_TASK), |task, errors| {
        let mut row = vec![0.0; signals.n_features()];
        for (i, error) in (task * SIGNALS_PER_TASK..).zip(errors) {
            row.fill(0.0);
            let (atoms, coefficients) = codes.code(i);
            add_code(dictionary, atoms, coefficients, &mut row);
            for (r, &s) in row.iter_mut().zip(signals.values(i)) {
                *r = s - *r;
            }
            *error = match signals.weights(i) {
                None => row.iter().map(|&r| f64::from(r).powi(2)).sum(),
                Some(w) => {
                    row.iter().zip(w).map(|(&r, &w)| f64::from(w) * f64::from(r).powi(2)).sum()
                }
            };
        }
    });
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_come_back() {
        let dictionary = Dictionary::normalized(2, vec![1.0, 0.0, 0.0, 1.0]).unwrap();
        let codes =
            SparseCodes::from_parts(vec![0, 2, 2, 3], vec![1, 0, 1], vec![2.0, 3.0, -1.0]).unwrap();
        assert_eq!(reconstruct(&dictionary, &codes).unwrap(), [3.0, 2.0, 0.0, 0.0, 0.0, -1.0]);
        let values = [3.0, 0.0, 1.0, 1.0, 5.0, -1.0];
        let weights = [1.0, 0.5, 1.0, 0.25, 0.0, 1.0];
        let signals = Signals::new(2, &values, Some(&weights)).unwrap();
        assert_eq!(squared_errors(&dictionary, &signals, &codes).unwrap(), [2.0, 1.25, 0.0]);
    }

    #[test]
    fn inconsistent_codes_are_refused() {
        assert!(SparseCodes::from_parts(vec![], vec![], vec![]).is_err());
        assert!(SparseCodes::from_parts(vec![0, 2, 1], vec![0], vec![1.0]).is_err());
        assert!(SparseCodes::from_parts(vec![0, 1], vec![0], vec![]).is_err());
        assert!(SparseCodes::from_parts(vec![0, 1], vec![0, 1], vec![1.0, 1.0]).is_err());
        let dictionary = Dictionary::normalized(1, vec![1.0]).unwrap();
        let codes = SparseCodes::from_parts(vec![0, 0, 1], vec![7], vec![1.0]).unwrap();
        assert_eq!(
            reconstruct(&dictionary, &codes),
            Err(Error::UnknownAtom { code: 1, atom: 7, n_atoms: 1 })
        );
        let signals = Signals::new(1, &[1.0], None).unwrap();
        let one = SparseCodes::from_parts(vec![0, 0, 0], vec![], vec![]).unwrap();
        assert!(squared_errors(&dictionary, &signals, &one).is_err());
    }
}
