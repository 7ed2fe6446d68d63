//! Orthogonal matching pursuit with missing and weighted values, many signals at a time.
//!
//! Batch-OMP (Rubinstein, Zibulevsky, Elad 2008) avoids the product of the dictionary with the residual in
//! every step by the dictionary's Gram matrix. With weights every signal has a Gram matrix of its own, and the
//! one column of it that a step needs costs such a product again; so here a step orthogonalises the chosen atom
//! and makes that product for a whole block of signals as one matrix product. Signals without weights of their
//! own take the shared Gram matrix.

use pulp::Arch;
use surfabet_base::Progress;
use surfabet_base::parallel;

use crate::codes::SparseCodes;
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::linalg::product;
use crate::pursuit::Pursuit;
use crate::signals::Signals;

/// Which atom joins the support next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Selection {
    /// The atom that lowers the error most once all coefficients are solved for again (order-recursive
    /// matching pursuit, also called orthogonal least squares). Same cost, usually the smaller error.
    #[default]
    LeastSquares,
    /// The atom whose observed part has the largest cosine with the residual (classical orthogonal matching
    /// pursuit, as scikit-learn's `orthogonal_mp`).
    Correlation,
}

/// When a code is complete, and how its atoms are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OmpOptions {
    /// Most atoms in a code: `k` of HSCSM eq. 1.
    pub max_atoms: usize,
    /// A code is complete when the root of the weighted mean of its squared errors,
    /// `sqrt(Σ w r² / Σ w)` (over the observed values, in their unit), falls to this; 0 to go by atoms alone.
    pub tolerance: f32,
    /// Which atom joins next.
    pub selection: Selection,
}

impl Default for OmpOptions {
    fn default() -> Self {
        Self { max_atoms: 5, tolerance: 0.0, selection: Selection::default() }
    }
}

impl OmpOptions {
    pub(crate) fn check(&self) -> Result<()> {
        if self.max_atoms == 0 {
            return Err(Error::invalid("max_atoms", 0, "at least 1"));
        }
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return Err(Error::invalid("tolerance", self.tolerance, "finite and not negative"));
        }
        Ok(())
    }
}

/// Sparse codes of `signals` over `dictionary`: greedy minimisation, for every signal, of
/// `Σ_i w_i (s_i − (D x)_i)²` over codes `x` of at most `max_atoms` entries.
///
/// With weights 0 and 1 this is HSCSM eq. 1, `‖S − W ∘ (D X)‖²_F`. A code ends early when the error is within
/// the tolerance or below what single precision resolves, or when no further atom adds a new direction to
/// the observed values. Signals that are zero, or of which nothing is observed, get empty codes.
///
/// Parallel over blocks of signals that do not depend on the number of threads: neither do the codes.
/// `progress` is asked every few milliseconds whether to give up.
///
/// # Errors
/// Options out of range, a dictionary with other features than the signals, or [`Error::Cancelled`].
pub fn omp(
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    options: &OmpOptions,
    progress: &dyn Progress,
) -> Result<SparseCodes> {
    options.check()?;
    if signals.n_features() != dictionary.n_features() {
        return Err(Error::FeatureMismatch {
            dictionary: dictionary.n_features(),
            signals: signals.n_features(),
        });
    }
    let coder = Coder::new(dictionary, signals, options, progress)?;
    let size = coder.block_size();
    let blocks: Vec<SparseCodes> =
        parallel::try_map_range(signals.len().div_ceil(size), |block| {
            coder.code_block(block * size, ((block + 1) * size).min(signals.len()))
        })?;
    let mut codes = SparseCodes::default();
    for block in &blocks {
        codes.append(block);
    }
    Ok(codes)
}

/// What all blocks of signals share.
struct Coder<'a> {
    dictionary: &'a Dictionary,
    signals: &'a Signals<'a>,
    options: &'a OmpOptions,
    progress: &'a dyn Progress,
    /// The atoms feature-major: all atoms' values of feature 0, then of feature 1, ...
    by_feature: Vec<f32>,
    /// Squares of `by_feature`, for the weighted norms; only with weights.
    squares: Option<Vec<f32>>,
    /// Squared norms of the atoms: 1 but for rounding.
    squared_norms: Vec<f32>,
    /// `DᵀD`, symmetric.
    gram: Vec<f32>,
}

impl<'a> Coder<'a> {
    fn new(
        dictionary: &'a Dictionary,
        signals: &'a Signals<'a>,
        options: &'a OmpOptions,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let k = dictionary.n_atoms();
        let by_feature = by_feature(dictionary);
        let squares =
            signals.has_weights().then(|| by_feature.iter().map(|v| v * v).collect::<Vec<f32>>());
        let squared_norms = (0..k)
            .map(|a| crate::pursuit::dot(dictionary.atom(a), dictionary.atom(a)) as f32)
            .collect();
        let mut coder = Self {
            dictionary,
            signals,
            options,
            progress,
            by_feature,
            squares,
            squared_norms,
            gram: Vec::new(),
        };
        if coder.most_atoms() > 1 && (0..signals.len()).any(|i| signals.is_evenly_weighted(i)) {
            coder.gram = gram(dictionary, &coder.by_feature, progress)?;
        }
        Ok(coder)
    }

    /// The longest code there can be.
    fn most_atoms(&self) -> usize {
        let longest = self.dictionary.n_atoms().min(self.dictionary.n_features());
        self.options.max_atoms.min(longest)
    }

    /// Signals per block: enough to make matrix products fast, few enough that a block's state stays near the
    /// cache and that an interrupt is heard within a few hundredths of a second.
    fn block_size(&self) -> usize {
        let (k, n) = (self.dictionary.n_atoms().max(1), self.dictionary.n_features());
        let by_work = (1usize << 28) / k.saturating_mul(n);
        let by_memory = (1usize << 24) / (4 * k + (self.most_atoms() + 3) * n);
        by_work.min(by_memory).clamp(8, 128)
    }

    fn code_block(&self, first: usize, end: usize) -> Result<SparseCodes> {
        let mut pursuits: Vec<Option<Pursuit>> = (first..end)
            .map(|i| Pursuit::start(self.signals, i, self.options.tolerance, self.most_atoms()))
            .collect();
        if self.most_atoms() > 0 {
            let open = pursuits.iter_mut().filter_map(Option::as_mut).collect();
            let block = SignalBlock::new(self, open)?;
            Arch::new().dispatch(|| block.run())?;
        }
        let mut codes = SparseCodes::default();
        for pursuit in pursuits {
            let (atoms, coefficients) = pursuit.map(Pursuit::finish).unwrap_or_default();
            codes.push(&atoms, &coefficients);
        }
        Ok(codes)
    }

    fn check(&self) -> Result<()> {
        Ok(self.progress.check()?)
    }
}

/// The atoms feature-major: all atoms' values of feature 0, then of feature 1, ...
pub(crate) fn by_feature(dictionary: &Dictionary) -> Vec<f32> {
    let (k, n) = (dictionary.n_atoms(), dictionary.n_features());
    let mut by_feature = vec![0.0; k * n];
    for a in 0..k {
        for (f, &v) in dictionary.atom(a).iter().enumerate() {
            by_feature[f * k + a] = v;
        }
    }
    by_feature
}

/// `DᵀD`, a block of columns at a time.
pub(crate) fn gram(
    dictionary: &Dictionary,
    by_feature: &[f32],
    progress: &dyn Progress,
) -> Result<Vec<f32>> {
    const COLUMNS: usize = 64;
    let (k, n) = (dictionary.n_atoms(), dictionary.n_features());
    let mut gram = vec![0.0; k * k];
    if k == 0 {
        return Ok(gram);
    }
    let chunks = gram.chunks_mut(COLUMNS * k).zip(dictionary.atoms().chunks(COLUMNS * n));
    parallel::try_for_each(chunks, |_, (out, atoms)| {
        product(by_feature, atoms, out, k, n);
        progress.check()
    })?;
    Ok(gram)
}

/// Signals that take their steps together.
struct SignalBlock<'a, 'b> {
    coder: &'b Coder<'a>,
    pursuits: Vec<&'b mut Pursuit>,
    /// Correlation of every atom with the residual, a column per signal.
    correlations: Vec<f32>,
    /// Squared length of what every atom would add to the support (for [`Selection::Correlation`]: of its
    /// observed part), a column per signal; 0 once it was tried.
    squared_lengths: Vec<f32>,
    /// Shares of the atoms in the directions so far, for signals that take the shared Gram matrix.
    shares: Vec<Vec<f32>>,
}

impl<'a, 'b> SignalBlock<'a, 'b> {
    fn new(coder: &'b Coder<'a>, pursuits: Vec<&'b mut Pursuit>) -> Result<Self> {
        let (k, n) = (coder.dictionary.n_atoms(), coder.dictionary.n_features());
        let mut columns = Vec::with_capacity(pursuits.len() * n);
        for pursuit in &pursuits {
            pursuit.append_residual(&mut columns);
        }
        coder.check()?;
        let mut correlations = vec![0.0; pursuits.len() * k];
        product(&coder.by_feature, &columns, &mut correlations, k, n);
        columns.clear();
        for pursuit in &pursuits {
            pursuit.append_weights(&mut columns);
        }
        let mut weighted = vec![0.0; columns.len() / n * k];
        if let Some(squares) = &coder.squares {
            coder.check()?;
            product(squares, &columns, &mut weighted, k, n);
        }
        let mut weighted = weighted.chunks_exact(k);
        let mut squared_lengths = Vec::with_capacity(pursuits.len() * k);
        for pursuit in &pursuits {
            let own = if pursuit.is_weighted() { weighted.next() } else { None };
            squared_lengths.extend_from_slice(own.unwrap_or(&coder.squared_norms));
        }
        let shares = vec![Vec::new(); pursuits.len()];
        Ok(Self { coder, pursuits, correlations, squared_lengths, shares })
    }

    #[inline(always)]
    fn run(mut self) -> Result<()> {
        let (k, n) = (self.coder.dictionary.n_atoms(), self.coder.dictionary.n_features());
        let mut open: Vec<usize> = (0..self.pursuits.len()).collect();
        let mut scores = vec![0.0; k];
        let (mut columns, mut products) = (Vec::new(), Vec::new());
        for step in 1..=self.coder.most_atoms() {
            self.coder.check()?;
            columns.clear();
            // A loop and not `retain`, whose closure would be compiled for the oldest machine.
            let mut kept = 0;
            for at in 0..open.len() {
                let s = open[at];
                let chosen = self.choose(s, &mut scores);
                if !chosen || self.pursuits[s].is_done() || step == self.coder.most_atoms() {
                    continue;
                }
                if self.pursuits[s].is_weighted() {
                    self.pursuits[s].append_direction(&mut columns);
                } else {
                    self.share_by_gram(s);
                }
                open[kept] = s;
                kept += 1;
            }
            open.truncate(kept);
            if open.is_empty() {
                break;
            }
            products.resize(columns.len() / n * k, 0.0);
            product(&self.coder.by_feature, &columns, &mut products, k, n);
            let mut products = products.chunks_exact(k);
            for &s in &open {
                let weighted = if self.pursuits[s].is_weighted() { products.next() } else { None };
                let share = weighted.unwrap_or_else(|| &self.shares[s][self.shares[s].len() - k..]);
                let projection = self.pursuits[s].last_projection();
                for (c, share) in self.correlations[s * k..].iter_mut().zip(share) {
                    *c -= projection * share;
                }
                if self.coder.options.selection == Selection::LeastSquares {
                    for (l, share) in self.squared_lengths[s * k..].iter_mut().zip(share) {
                        *l -= share * share;
                    }
                }
            }
        }
        Ok(())
    }

    /// Adds the best atom to the support of pursuit `s`; false when none adds anything.
    #[inline(always)]
    fn choose(&mut self, s: usize, scores: &mut [f32]) -> bool {
        let k = scores.len();
        let pursuit = &mut *self.pursuits[s];
        let squared_lengths = &mut self.squared_lengths[s * k..][..k];
        let correlations = &self.correlations[s * k..][..k];
        while let Some(best) =
            best_atom(correlations, squared_lengths, pursuit.min_squared_length(), scores)
        {
            squared_lengths[best] = 0.0;
            if pursuit.extend(best, self.coder.dictionary.atom(best)) {
                return true;
            }
        }
        false
    }

    /// Appends every atom's share of the newest direction of pursuit `s`, from the shared Gram matrix: the
    /// Gram column of the chosen atom less what the earlier directions explain of it.
    #[inline(always)]
    fn share_by_gram(&mut self, s: usize) {
        let k = self.coder.dictionary.n_atoms();
        let pursuit = &self.pursuits[s];
        let (Some(atom), Some((length, column))) =
            (pursuit.last_atom(), pursuit.last_column().split_last())
        else {
            return;
        };
        let shares = &mut self.shares[s];
        let start = shares.len();
        shares.extend_from_slice(&self.coder.gram[atom as usize * k..][..k]);
        let (earlier, newest) = shares.split_at_mut(start);
        for (earlier, &overlap) in earlier.chunks_exact(k).zip(column) {
            for (v, e) in newest.iter_mut().zip(earlier) {
                *v -= overlap as f32 * e;
            }
        }
        let inverse = (1.0 / length) as f32;
        for v in newest {
            *v *= inverse;
        }
    }
}

/// The atom that explains most of the residual, the first of equals; `None` when none explains anything.
#[inline(always)]
fn best_atom(
    correlations: &[f32],
    squared_lengths: &[f32],
    min_squared_length: f32,
    scores: &mut [f32],
) -> Option<usize> {
    for ((score, &c), &length) in scores.iter_mut().zip(correlations).zip(squared_lengths) {
        *score = if length > min_squared_length { c * c / length } else { 0.0 };
    }
    let (chunks, rest) = scores.as_chunks::<16>();
    let mut lanes = [0.0f32; 16];
    for chunk in chunks {
        for l in 0..16 {
            lanes[l] = if chunk[l] > lanes[l] { chunk[l] } else { lanes[l] };
        }
    }
    let best = lanes.iter().chain(rest).copied().fold(0.0, f32::max);
    if best > 0.0 { scores.iter().position(|&s| s == best) } else { None }
}

#[cfg(test)]
// Dense algebra reads best by its indices.
#[allow(clippy::needless_range_loop)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::codes::squared_errors;
    use surfabet_base::{Cancelled, Silent};

    use crate::testing::{Impatient, mask, noise, planted, random_dictionary, rng};

    fn options(max_atoms: usize) -> OmpOptions {
        OmpOptions { max_atoms, ..OmpOptions::default() }
    }

    fn sorted(codes: &SparseCodes, i: usize) -> Vec<u32> {
        let mut atoms = codes.code(i).0.to_vec();
        atoms.sort_unstable();
        atoms
    }

    /// Weighted least squares on a support by normal equations in double precision: coefficients and error.
    fn dense_fit(
        dictionary: &Dictionary,
        support: &[usize],
        values: &[f32],
        weights: &[f32],
    ) -> Option<(Vec<f64>, f64)> {
        let t = support.len();
        let w = |i: usize| f64::from(weights[i]);
        let d = |a: usize, i: usize| f64::from(dictionary.atom(support[a])[i]);
        let all = 0..values.len();
        let mut m = vec![vec![0.0; t + 1]; t];
        for a in 0..t {
            for b in 0..t {
                m[a][b] = all.clone().map(|i| w(i) * d(a, i) * d(b, i)).sum();
            }
            m[a][t] = all.clone().map(|i| w(i) * d(a, i) * f64::from(values[i])).sum();
        }
        for p in 0..t {
            let best = (p..t).max_by(|&a, &b| m[a][p].abs().total_cmp(&m[b][p].abs()))?;
            m.swap(p, best);
            if m[p][p].abs() < 1e-6 {
                return None;
            }
            for r in (0..t).filter(|&r| r != p) {
                let factor = m[r][p] / m[p][p];
                for c in p..=t {
                    m[r][c] -= factor * m[p][c];
                }
            }
        }
        let x: Vec<f64> = (0..t).map(|p| m[p][t] / m[p][p]).collect();
        let error = all
            .map(|i| {
                let model: f64 = (0..t).map(|a| x[a] * d(a, i)).sum();
                w(i) * (f64::from(values[i]) - model).powi(2)
            })
            .sum();
        Some((x, error))
    }

    /// What each unchosen atom would leave as error (least squares), or its negated squared cosine.
    fn scores(
        dictionary: &Dictionary,
        support: &[usize],
        values: &[f32],
        weights: &[f32],
        selection: Selection,
    ) -> Vec<Option<f64>> {
        let model = dense_fit(dictionary, support, values, weights).unwrap().0;
        (0..dictionary.n_atoms())
            .map(|a| {
                if support.contains(&a) {
                    return None;
                }
                let mut extended = support.to_vec();
                extended.push(a);
                let (_, error) = dense_fit(dictionary, &extended, values, weights)?;
                if selection == Selection::LeastSquares {
                    return Some(error);
                }
                let (mut product, mut squared) = (0.0, 0.0);
                for i in 0..values.len() {
                    let (w, d) = (f64::from(weights[i]), f64::from(dictionary.atom(a)[i]));
                    let shares = support.iter().zip(&model);
                    let explained: f64 =
                        shares.map(|(&s, x)| x * f64::from(dictionary.atom(s)[i])).sum();
                    product += w * d * (f64::from(values[i]) - explained);
                    squared += w * d * d;
                }
                Some(-product * product / squared)
            })
            .collect()
    }

    #[test]
    fn orthonormal_dictionary_gives_the_largest_projections() {
        let identity = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.0 }).collect();
        let dictionary = Dictionary::new(4, identity).unwrap();
        let signals = Signals::new(4, &[0.5, -3.0, 2.0, 0.0], None).unwrap();
        let codes = omp(&dictionary, &signals, &options(2), &Silent).unwrap();
        assert_eq!(codes.code(0).0, [1, 2]);
        for (x, expected) in codes.code(0).1.iter().zip([-3.0, 2.0]) {
            assert!((x - expected).abs() < 1e-6);
        }
        let codes = omp(&dictionary, &signals, &options(9), &Silent).unwrap();
        assert_eq!(codes.code(0).0, [1, 2, 0], "nothing is left after three atoms");
    }

    #[test]
    fn a_missing_value_does_not_count() {
        // Seen at its first two values only, the signal is exactly twice the second atom.
        let dictionary =
            Dictionary::normalized(3, vec![0.0, 0.0, 1.0, 3.0, 4.0, 0.0, 1.0, 1.0, 1.0]).unwrap();
        let (values, weights) = ([1.2, 1.6, 50.0], [1.0, 1.0, 0.0]);
        let signals = Signals::new(3, &values, Some(&weights)).unwrap();
        let codes = omp(&dictionary, &signals, &options(3), &Silent).unwrap();
        assert_eq!(codes.code(0).0, [1]);
        assert!((codes.code(0).1[0] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn planted_supports_are_found() {
        for (missing, selection) in [0.0, 0.2, 0.5]
            .into_iter()
            .zip([Selection::LeastSquares, Selection::Correlation].into_iter().cycle())
        {
            let mut rng = rng(1);
            let dictionary = random_dictionary(&mut rng, 60, 100);
            let (values, supports) = planted(&mut rng, &dictionary, 300, 3);
            let weights = mask(&mut rng, values.len(), missing);
            let signals = Signals::new(100, &values, Some(&weights)).unwrap();
            let options = OmpOptions { max_atoms: 3, selection, ..OmpOptions::default() };
            let codes = omp(&dictionary, &signals, &options, &Silent).unwrap();
            let found = (0..300).filter(|&i| sorted(&codes, i) == supports[i]).count();
            assert!(found >= 290, "{found} of 300 with {missing} missing");
        }
    }

    #[test]
    fn weights_of_one_are_no_weights() {
        let mut rng = rng(2);
        let dictionary = random_dictionary(&mut rng, 40, 30);
        let values = noise(&mut rng, 30 * 50);
        let plain = Signals::new(30, &values, None).unwrap();
        let ones = vec![7.5; values.len()];
        let weighted = Signals::new(30, &values, Some(&ones)).unwrap();
        let expected = omp(&dictionary, &plain, &options(6), &Silent).unwrap();
        assert_eq!(omp(&dictionary, &weighted, &options(6), &Silent).unwrap(), expected);
        // The block product must agree with the shared Gram matrix: a weight that is all but 1 takes it.
        let mut nearly = vec![1.0; values.len()];
        nearly.iter_mut().step_by(30).for_each(|w| *w = 1.0 - f32::EPSILON);
        let weighted = Signals::new(30, &values, Some(&nearly)).unwrap();
        let other = omp(&dictionary, &weighted, &options(6), &Silent).unwrap();
        assert_eq!(other.atoms(), expected.atoms());
        for (a, b) in other.coefficients().iter().zip(expected.coefficients()) {
            assert!((a - b).abs() < 1e-4);
        }
    }

    #[test]
    fn residual_is_orthogonal_to_the_chosen_atoms_and_falls_with_each() {
        let mut rng = rng(3);
        let dictionary = random_dictionary(&mut rng, 80, 50);
        let values = noise(&mut rng, 50 * 20);
        let weights: Vec<f32> = noise(&mut rng, 50 * 20).iter().map(|v| v.abs()).collect();
        let signals = Signals::new(50, &values, Some(&weights)).unwrap();
        let mut before = vec![f64::INFINITY; 20];
        for max_atoms in 1..12 {
            let codes = omp(&dictionary, &signals, &options(max_atoms), &Silent).unwrap();
            let model = crate::reconstruct(&dictionary, &codes).unwrap();
            let errors = squared_errors(&dictionary, &signals, &codes).unwrap();
            for i in 0..20 {
                assert_eq!(codes.code(i).0.len(), max_atoms);
                assert!(errors[i] <= before[i]);
                for &atom in codes.code(i).0 {
                    let product: f64 = (0..50)
                        .map(|f| {
                            let r = f64::from(values[i * 50 + f]) - f64::from(model[i * 50 + f]);
                            f64::from(weights[i * 50 + f])
                                * r
                                * f64::from(dictionary.atom(atom as usize)[f])
                        })
                        .sum();
                    assert!(product.abs() < 1e-4, "{product}");
                }
            }
            before = errors;
        }
    }

    #[test]
    fn tolerance_ends_a_code_at_the_first_error_within_it() {
        let mut rng = rng(4);
        let dictionary = random_dictionary(&mut rng, 60, 40);
        let values = noise(&mut rng, 40 * 30);
        let weights = mask(&mut rng, values.len(), 0.3);
        let signals = Signals::new(40, &values, Some(&weights)).unwrap();
        let tolerance = 0.4;
        let options = OmpOptions { max_atoms: 40, tolerance, ..OmpOptions::default() };
        let codes = omp(&dictionary, &signals, &options, &Silent).unwrap();
        let errors = squared_errors(&dictionary, &signals, &codes).unwrap();
        for i in 0..30 {
            let observed: f32 = signals.weights(i).unwrap().iter().sum();
            let rms = |error: f64| (error / f64::from(observed)).sqrt();
            assert!(rms(errors[i]) <= f64::from(tolerance) * (1.0 + 1e-5));
            let shorter = codes.code(i).0.len() - 1;
            let one = Signals::new(40, signals.values(i), signals.weights(i)).unwrap();
            let options = OmpOptions { max_atoms: shorter, ..OmpOptions::default() };
            let codes = omp(&dictionary, &one, &options, &Silent).unwrap();
            let errors = squared_errors(&dictionary, &one, &codes).unwrap();
            assert!(rms(errors[0]) > f64::from(tolerance));
        }
        let loose = OmpOptions { tolerance: 1e9, ..options };
        assert!(omp(&dictionary, &signals, &loose, &Silent).unwrap().atoms().is_empty());
    }

    #[test]
    fn nothing_observed_gives_empty_codes() {
        let mut rng = rng(5);
        let dictionary = random_dictionary(&mut rng, 8, 4);
        let values = [1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 5.0, 6.0, 0.0, 0.0];
        let weights = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0];
        let signals = Signals::new(4, &values, Some(&weights)).unwrap();
        let codes = omp(&dictionary, &signals, &options(3), &Silent).unwrap();
        assert_eq!((codes.len(), codes.atoms().len()), (3, 0));
        let none = Signals::new(4, &[], None).unwrap();
        assert!(omp(&dictionary, &none, &options(3), &Silent).unwrap().is_empty());
        let no_atoms = Dictionary::new(4, vec![]).unwrap();
        assert_eq!(omp(&no_atoms, &signals, &options(3), &Silent).unwrap().len(), 3);
    }

    #[test]
    fn repeated_and_opposite_atoms_are_used_once() {
        let atoms = vec![1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0];
        let dictionary = Dictionary::normalized(3, atoms).unwrap();
        let values = [2.0, 1.0, 0.5, 1.0, 1.5, 0.0];
        for weights in [None, Some(&[1.0, 0.5, 1.0, 1.0, 1.0, 0.0][..])] {
            let signals = Signals::new(3, &values, weights).unwrap();
            let codes = omp(&dictionary, &signals, &options(4), &Silent).unwrap();
            assert_eq!(sorted(&codes, 0), [0, 3], "the first of equals, and what else helps");
            assert_eq!(sorted(&codes, 1), [0]);
        }
    }

    #[test]
    fn scale_does_not_matter() {
        let mut rng = rng(6);
        let dictionary = random_dictionary(&mut rng, 30, 20);
        let values = noise(&mut rng, 20 * 10);
        let weights = mask(&mut rng, values.len(), 0.2);
        let signals = Signals::new(20, &values, Some(&weights)).unwrap();
        let expected = omp(&dictionary, &signals, &options(4), &Silent).unwrap();
        for (factor, weight) in
            [(2.0f32.powi(-80), 2.0f32.powi(40)), (2.0f32.powi(45), 2.0f32.powi(-90))]
        {
            let scaled: Vec<f32> = values.iter().map(|v| v * factor).collect();
            let reweighted: Vec<f32> = weights.iter().map(|w| w * weight).collect();
            let signals = Signals::new(20, &scaled, Some(&reweighted)).unwrap();
            let codes = omp(&dictionary, &signals, &options(4), &Silent).unwrap();
            assert_eq!(codes.atoms(), expected.atoms());
            for (a, b) in codes.coefficients().iter().zip(expected.coefficients()) {
                assert!((a / factor - b).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let mut rng = rng(7);
        let dictionary = random_dictionary(&mut rng, 50, 40);
        let values = noise(&mut rng, 40 * 1000);
        let mut weights = mask(&mut rng, values.len(), 0.3);
        weights[..40 * 300].fill(1.0);
        let signals = Signals::new(40, &values, Some(&weights)).unwrap();
        let coded = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| omp(&dictionary, &signals, &options(5), &Silent).unwrap())
        };
        let one = coded(1);
        assert_eq!(one, coded(2));
        assert_eq!(one, coded(8));
    }

    #[test]
    fn cancelling_and_wrong_options_are_errors() {
        let mut rng = rng(8);
        let dictionary = random_dictionary(&mut rng, 5, 4);
        let values = noise(&mut rng, 8);
        let signals = Signals::new(4, &values, None).unwrap();
        assert_eq!(
            omp(&dictionary, &signals, &options(2), &Impatient),
            Err(Error::Cancelled(Cancelled))
        );
        assert!(omp(&dictionary, &signals, &options(0), &Silent).is_err());
        for tolerance in [-1.0, f32::NAN, f32::INFINITY] {
            let options = OmpOptions { tolerance, ..OmpOptions::default() };
            assert!(omp(&dictionary, &signals, &options, &Silent).is_err());
        }
        let other = Signals::new(2, &values, None).unwrap();
        assert_eq!(
            omp(&dictionary, &other, &options(2), &Silent),
            Err(Error::FeatureMismatch { dictionary: 4, signals: 2 })
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

        /// Every step of a code is the best step there is, judged by dense double-precision algebra, and the
        /// coefficients are the least-squares ones.
        #[test]
        fn every_step_is_the_best_one(
            seed in any::<u64>(),
            n_features in 2usize..24,
            n_atoms in 1usize..30,
            max_atoms in 1usize..6,
            kind in 0usize..3,
            by_correlation in any::<bool>(),
        ) {
            let mut rng = rng(seed);
            let dictionary = random_dictionary(&mut rng, n_atoms, n_features);
            let values = noise(&mut rng, n_features * 4);
            let weights = match kind {
                0 => vec![1.0; values.len()],
                1 => mask(&mut rng, values.len(), 0.3),
                _ => noise(&mut rng, values.len()).iter().map(|v| v * v).collect(),
            };
            let signals = Signals::new(n_features, &values, Some(&weights)).unwrap();
            let selection =
                if by_correlation { Selection::Correlation } else { Selection::LeastSquares };
            let options = OmpOptions { max_atoms, tolerance: 0.0, selection };
            let codes = omp(&dictionary, &signals, &options, &Silent).unwrap();
            let errors = squared_errors(&dictionary, &signals, &codes).unwrap();
            for i in 0..4 {
                let (values, weights) = (signals.values(i), signals.weights(i).unwrap());
                let energy = dense_fit(&dictionary, &[], values, weights).unwrap().1;
                let support: Vec<usize> = codes.code(i).0.iter().map(|&a| a as usize).collect();
                prop_assert!(support.len() <= max_atoms.min(n_features).min(n_atoms));
                for step in 0..support.len() {
                    let offered = scores(&dictionary, &support[..step], values, weights, selection);
                    let best = offered.iter().flatten().copied().fold(f64::INFINITY, f64::min);
                    let Some(taken) = offered[support[step]] else { continue };
                    prop_assert!(taken <= best + 1e-3 * energy, "{taken} instead of {best}");
                }
                if let Some((_, error)) = dense_fit(&dictionary, &support, values, weights) {
                    prop_assert!((errors[i] - error).abs() <= 1e-4 * energy);
                }
            }
        }
    }
}
