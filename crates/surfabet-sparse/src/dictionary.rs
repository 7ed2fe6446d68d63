//! The dictionary `D` of HSCSM section III-B.

use crate::error::{Error, Result};
use crate::signals::{check_numbers, check_rows};

/// How far the norm of an atom may be from 1: what rounding a stored dictionary to 16 bits can do.
const NORM_TOLERANCE: f64 = 1e-3;

/// Unit-norm atoms of `n_features` values each, stored one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Dictionary {
    n_features: usize,
    atoms: Vec<f32>,
}

impl Dictionary {
    /// A dictionary of atoms that have norm 1 already (to within 1e-3), atom-major.
    ///
    /// # Errors
    /// `n_features` is 0, the length is no multiple of it, a number is not finite or an atom is not of norm 1.
    pub fn new(n_features: usize, atoms: Vec<f32>) -> Result<Self> {
        let dictionary = Self::checked(n_features, atoms)?;
        for k in 0..dictionary.n_atoms() {
            let norm = norm(dictionary.atom(k));
            if (norm - 1.0).abs() > NORM_TOLERANCE {
                return Err(Error::NotUnit { atom: k, norm });
            }
        }
        Ok(dictionary)
    }

    /// A dictionary of atoms scaled to norm 1.
    ///
    /// # Errors
    /// As [`Dictionary::new`], but only atoms of norm 0 are refused.
    pub fn normalized(n_features: usize, atoms: Vec<f32>) -> Result<Self> {
        let mut dictionary = Self::checked(n_features, atoms)?;
        for k in 0..dictionary.n_atoms() {
            if !normalize(dictionary.atom_mut(k)) {
                return Err(Error::NotUnit { atom: k, norm: 0.0 });
            }
        }
        Ok(dictionary)
    }

    fn checked(n_features: usize, atoms: Vec<f32>) -> Result<Self> {
        check_rows("atoms", n_features, &atoms)?;
        check_numbers("atom", n_features, &atoms, "finite", f32::is_finite)?;
        if u32::try_from(atoms.len() / n_features).is_err() {
            return Err(Error::invalid("n_atoms", atoms.len() / n_features, "below 2^32"));
        }
        Ok(Self { n_features, atoms })
    }

    /// Number of values of an atom.
    pub fn n_features(&self) -> usize {
        self.n_features
    }

    /// Number of atoms.
    pub fn n_atoms(&self) -> usize {
        self.atoms.len() / self.n_features
    }

    /// Atom `k`.
    ///
    /// # Panics
    /// If `k` is not below [`Dictionary::n_atoms`].
    pub fn atom(&self, k: usize) -> &[f32] {
        &self.atoms[k * self.n_features..][..self.n_features]
    }

    /// All atoms, one after the other.
    pub fn atoms(&self) -> &[f32] {
        &self.atoms
    }

    pub(crate) fn atom_mut(&mut self, k: usize) -> &mut [f32] {
        &mut self.atoms[k * self.n_features..][..self.n_features]
    }

    /// The atoms for which `keep` is true, in their order.
    pub(crate) fn retain(&self, keep: &[bool]) -> Self {
        let kept = (0..self.n_atoms()).filter(|&k| keep[k]);
        let atoms = kept.flat_map(|k| self.atom(k).iter().copied()).collect();
        Self { n_features: self.n_features, atoms }
    }
}

fn norm(atom: &[f32]) -> f64 {
    atom.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt()
}

/// Scales `atom` to norm 1; false, leaving it alone, when all of it is zero.
pub(crate) fn normalize(atom: &mut [f32]) -> bool {
    let norm = norm(atom);
    if norm == 0.0 {
        return false;
    }
    for v in atom {
        *v = (f64::from(*v) / norm) as f32;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atoms_are_scaled_to_norm_one() {
        let dictionary = Dictionary::normalized(2, vec![3.0, 4.0, 0.0, -1e-30]).unwrap();
        assert_eq!(dictionary.atom(0), [0.6, 0.8]);
        assert_eq!(dictionary.atom(1), [0.0, -1.0]);
        assert_eq!(dictionary.n_atoms(), 2);
    }

    #[test]
    fn what_is_no_dictionary_is_refused() {
        assert_eq!(
            Dictionary::new(2, vec![1.0, 0.0, 3.0, 4.0]),
            Err(Error::NotUnit { atom: 1, norm: 5.0 })
        );
        assert!(Dictionary::normalized(2, vec![0.0, 0.0]).is_err());
        assert!(Dictionary::new(2, vec![f32::NAN, 0.0]).is_err());
        assert!(Dictionary::new(2, vec![1.0]).is_err());
        assert!(Dictionary::new(0, vec![]).is_err());
        assert_eq!(Dictionary::new(3, vec![]).unwrap().n_atoms(), 0);
    }
}
