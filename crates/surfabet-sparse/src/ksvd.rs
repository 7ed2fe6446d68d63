//! Weighted K-SVD: learns the dictionary `D` and the codes `X` of HSCSM eq. 1 (section III-B) together.
//!
//! K-SVD (Aharon, Elad, Bruckstein 2006) alternates sparse coding with an update of one atom at a time, each
//! with the coefficients of the signals that use it. Both halves here minimise the weighted error, so that
//! values which were not observed neither shape atoms nor codes.

use rayon::prelude::*;
use surfabet_base::Progress;

use crate::codes::{SparseCodes, squared_errors};
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::omp::{OmpOptions, Selection, omp};
use crate::rank_one::{self, Convergence, Group};
use crate::replacement::{duplicates, initial_dictionary, replace_atoms};
use crate::signals::Signals;

/// Share of the signals' energy that single precision cannot tell from nothing.
const ROUNDING: f64 = 1e-9;

/// What to learn and for how long.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KsvdOptions {
    /// Most atoms of the dictionary; the number of signals limits it too.
    pub n_atoms: usize,
    /// Most atoms in a code: `k` of HSCSM eq. 1.
    pub max_atoms: usize,
    /// Weighted root mean square error at which a code is complete, as [`OmpOptions::tolerance`].
    pub tolerance: f32,
    /// How atoms are chosen for a code.
    pub selection: Selection,
    /// Most iterations.
    pub iterations: usize,
    /// Least relative decrease of the objective for another iteration; 0 to take all of them.
    pub convergence: f64,
    /// Seeds the choice of the signals that become the first atoms.
    pub random_state: u64,
    /// Of two atoms whose absolute cosine exceeds this, one is replaced.
    pub max_coherence: f32,
    /// Most alternations in an update of an atom from weighted signals.
    pub update_iterations: usize,
    /// Least relative gain for another alternation.
    pub update_tolerance: f64,
}

impl Default for KsvdOptions {
    fn default() -> Self {
        Self {
            n_atoms: 256,
            max_atoms: 5,
            tolerance: 0.0,
            selection: Selection::default(),
            iterations: 20,
            convergence: 1e-3,
            random_state: 0,
            max_coherence: 0.9,
            update_iterations: 10,
            update_tolerance: 1e-4,
        }
    }
}

impl KsvdOptions {
    fn omp_options(&self) -> OmpOptions {
        OmpOptions {
            max_atoms: self.max_atoms,
            tolerance: self.tolerance,
            selection: self.selection,
        }
    }

    fn check(&self) -> Result<()> {
        self.omp_options().check()?;
        if self.n_atoms == 0 {
            return Err(Error::invalid("n_atoms", 0, "at least 1"));
        }
        if !(0.0..1.0).contains(&self.convergence) {
            return Err(Error::invalid("convergence", self.convergence, "from 0 to below 1"));
        }
        if !(self.max_coherence > 0.0 && self.max_coherence <= 1.0) {
            return Err(Error::invalid("max_coherence", self.max_coherence, "above 0, at most 1"));
        }
        if !(0.0..1.0).contains(&self.update_tolerance) {
            let given = self.update_tolerance;
            return Err(Error::invalid("update_tolerance", given, "from 0 to below 1"));
        }
        Ok(())
    }
}

/// Why learning ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// All iterations were made.
    Iterations,
    /// The objective fell by less than [`KsvdOptions::convergence`] asks.
    Converged,
}

/// How an iteration went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KsvdIteration {
    /// Number of the iteration, from 1.
    pub iteration: usize,
    /// Weighted squared error after it.
    pub objective: f64,
    /// Atoms replaced by badly represented signals.
    pub replaced: usize,
}

/// What was learned.
#[derive(Debug, Clone, PartialEq)]
pub struct Ksvd {
    /// The atoms that are in use.
    pub dictionary: Dictionary,
    /// One code per signal.
    pub codes: SparseCodes,
    /// `Σ w (s − D x)²` over all signals: of the first dictionary, then after every iteration. Never rises
    /// when the tolerance is 0 (but for rounding); otherwise a shorter code within the tolerance may raise it.
    pub objective: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
    /// Unused and duplicate atoms replaced by badly represented signals, over all iterations.
    pub replaced: usize,
    /// Atoms dropped at the end: no code uses them, or others can stand in for them.
    pub cropped: usize,
    /// Why learning ended.
    pub stop_reason: StopReason,
}

/// Learns a dictionary for `signals`, and their codes: `min Σ w (s − D x)²` with at most `max_atoms` entries
/// in a code. With weights of 0 and 1 that is HSCSM eq. 1; without weights it is plain K-SVD.
///
/// Starts from signals chosen by `random_state`. After each round of atom updates, atoms that no code uses
/// and those that repeat another give way to the residuals of the worst represented signals; a replacement
/// that would raise the objective is undone. In sparse coding a signal keeps its code where the new one is worse. At the end
/// unused atoms are cropped, and duplicates if that does not raise the objective, so the dictionary can be
/// smaller than asked for.
///
/// An entry of an atom that none of its signals observes is 0. With few observations per entry the exact
/// minimum can still be wild there: small positive weights on filled-in values tame it.
///
/// Deterministic: the result does not depend on the number of threads. `on_iteration` hears of every
/// iteration; `progress` is asked every few milliseconds whether to give up.
///
/// # Errors
/// Options out of range, or [`Error::Cancelled`].
pub fn ksvd(
    signals: &Signals<'_>,
    options: &KsvdOptions,
    progress: &dyn Progress,
    on_iteration: &mut dyn FnMut(&KsvdIteration),
) -> Result<Ksvd> {
    options.check()?;
    let dictionary = initial_dictionary(signals, options.n_atoms, options.random_state)?;
    let codes = omp(&dictionary, signals, &options.omp_options(), progress)?;
    let errors = squared_errors(&dictionary, signals, &codes)?;
    let weights = unit_weights(signals);
    let mut learner = Learner {
        signals,
        options,
        progress,
        weights,
        budgets: budgets(signals, options.tolerance),
        dictionary,
        codes,
        errors,
    };
    let mut objective = vec![learner.objective()];
    let (mut replaced, mut stop_reason) = (0, StopReason::Iterations);
    for iteration in 1..=options.iterations {
        learner.update_atoms()?;
        let newly_replaced = learner.code()?;
        replaced += newly_replaced;
        let (before, after) = (objective[iteration - 1], learner.objective());
        objective.push(after);
        on_iteration(&KsvdIteration { iteration, objective: after, replaced: newly_replaced });
        if options.convergence > 0.0 && before - after <= options.convergence * before {
            stop_reason = StopReason::Converged;
            break;
        }
    }
    let n_atoms = learner.dictionary.n_atoms();
    learner.drop_duplicates()?;
    let iterations = objective.len() - 1;
    objective[iterations] = learner.objective();
    let (dictionary, codes) = crop(&learner.dictionary, learner.codes);
    let cropped = n_atoms - dictionary.n_atoms();
    Ok(Ksvd { dictionary, codes, objective, iterations, replaced, cropped, stop_reason })
}

/// The weights scaled so that the largest of all is 1.
fn unit_weights(signals: &Signals<'_>) -> Option<Vec<f32>> {
    let all = || (0..signals.len()).filter_map(|i| signals.weights(i)).flatten().copied();
    let largest = all().fold(0.0, f32::max);
    signals.has_weights().then(|| {
        let scale = if largest > 0.0 { 1.0 / f64::from(largest) } else { 0.0 };
        all().map(|w| (f64::from(w) * scale) as f32).collect()
    })
}

/// The weighted squared error within which each signal meets `tolerance`.
fn budgets(signals: &Signals<'_>, tolerance: f32) -> Vec<f64> {
    let squared = f64::from(tolerance).powi(2);
    let total = |i| match signals.weights(i) {
        None => signals.n_features() as f64,
        Some(weights) => weights.iter().map(|&w| f64::from(w)).sum(),
    };
    (0..signals.len()).map(|i| squared * total(i)).collect()
}

struct Learner<'a> {
    signals: &'a Signals<'a>,
    options: &'a KsvdOptions,
    progress: &'a dyn Progress,
    weights: Option<Vec<f32>>,
    budgets: Vec<f64>,
    dictionary: Dictionary,
    codes: SparseCodes,
    /// Weighted squared error of every signal.
    errors: Vec<f64>,
}

impl Learner<'_> {
    fn objective(&self) -> f64 {
        self.errors.iter().sum()
    }

    /// Updates every atom in turn, with the coefficients of the codes that use it.
    fn update_atoms(&mut self) -> Result<()> {
        let n = self.signals.n_features();
        let convergence = Convergence {
            iterations: self.options.update_iterations,
            tolerance: self.options.update_tolerance,
        };
        let (mut residuals, mut weights) = (Vec::new(), Vec::new());
        for (atom, uses) in uses(&self.codes, self.dictionary.n_atoms()).iter().enumerate() {
            if uses.is_empty() {
                continue;
            }
            self.progress.check()?;
            residuals.resize(uses.len() * n, 0.0);
            residuals.par_chunks_exact_mut(n).with_min_len(32).zip(uses).for_each(|(row, used)| {
                self.residual_without(used, row);
            });
            if let Some(all) = &self.weights {
                weights.clear();
                weights.extend(uses.iter().flat_map(|u| &all[u.signal * n..][..n]));
            }
            let group = Group {
                n_features: n,
                residuals: &residuals,
                weights: self.weights.is_some().then_some(&weights[..]),
            };
            let mut coefficients: Vec<f32> =
                uses.iter().map(|u| self.codes.coefficients()[u.entry]).collect();
            let improved = self.dictionary.atom_mut(atom);
            rank_one::update(&group, improved, &mut coefficients, &convergence, self.progress)?;
            let all = self.codes.coefficients_mut();
            for (used, x) in uses.iter().zip(coefficients) {
                all[used.entry] = x;
            }
        }
        self.errors = squared_errors(&self.dictionary, self.signals, &self.codes)?;
        Ok(())
    }

    /// The residual of a signal but for one entry of its code.
    fn residual_without(&self, used: &Use, row: &mut [f32]) {
        row.copy_from_slice(self.signals.values(used.signal));
        let start = self.codes.offsets()[used.signal];
        let (atoms, coefficients) = self.codes.code(used.signal);
        for (entry, (&atom, &x)) in (start..).zip(atoms.iter().zip(coefficients)) {
            if entry != used.entry {
                for (r, &d) in row.iter_mut().zip(self.dictionary.atom(atom as usize)) {
                    *r -= x * d;
                }
            }
        }
    }

    /// Replaces what does not earn its place and codes all signals again; returns how many atoms were replaced.
    fn code(&mut self) -> Result<usize> {
        let usage = self.codes.usage(self.dictionary.n_atoms());
        let unused: Vec<bool> = usage.iter().map(|&u| u == 0).collect();
        let repeats =
            duplicates(&self.dictionary, &usage, self.options.max_coherence, self.progress)?;
        let either: Vec<bool> = unused.iter().zip(&repeats).map(|(u, r)| *u || *r).collect();
        let before = self.objective();
        let (dictionary, codes, errors, replaced) = self.replace_and_code(&either)?;
        let after: f64 = errors.iter().sum();
        // Codes that used a duplicate may miss it more than the others gain from its successor.
        let undo = after > before && either != unused && self.options.tolerance == 0.0;
        let (dictionary, codes, errors, replaced) = if undo {
            self.replace_and_code(&unused)?
        } else {
            (dictionary, codes, errors, replaced)
        };
        (self.dictionary, self.codes, self.errors) = (dictionary, codes, errors);
        Ok(replaced)
    }

    /// Codes the signals without duplicate atoms, and keeps to that if the objective stands it.
    fn drop_duplicates(&mut self) -> Result<()> {
        let usage = self.codes.usage(self.dictionary.n_atoms());
        let unused: Vec<bool> = usage.iter().map(|&u| u == 0).collect();
        let repeats =
            duplicates(&self.dictionary, &usage, self.options.max_coherence, self.progress)?;
        if unused.iter().zip(&repeats).all(|(unused, repeats)| *unused || !*repeats) {
            return Ok(());
        }
        let keep: Vec<bool> = repeats.iter().map(|r| !r).collect();
        let dictionary = self.dictionary.retain(&keep);
        let codes = omp(&dictionary, self.signals, &self.options.omp_options(), self.progress)?;
        let errors = squared_errors(&dictionary, self.signals, &codes)?;
        let after: f64 = errors.iter().sum();
        let energy: f64 = (0..self.signals.len()).map(|i| self.signals.energy(i)).sum();
        if after <= self.objective() + ROUNDING * energy {
            (self.dictionary, self.codes, self.errors) = (dictionary, codes, errors);
        }
        Ok(())
    }

    /// Dictionary, codes and errors after replacing the marked atoms, and how many of them were replaced.
    fn replace_and_code(
        &self,
        replace: &[bool],
    ) -> Result<(Dictionary, SparseCodes, Vec<f64>, usize)> {
        let mut dictionary = self.dictionary.clone();
        let coherence = self.options.max_coherence;
        let replaced = replace_atoms(
            &mut dictionary,
            replace,
            self.signals,
            &self.codes,
            &self.errors,
            coherence,
            self.progress,
        )?;
        let fresh = omp(&dictionary, self.signals, &self.options.omp_options(), self.progress)?;
        let fresh_errors = squared_errors(&dictionary, self.signals, &fresh)?;
        let mut codes = SparseCodes::default();
        let mut errors = Vec::with_capacity(fresh_errors.len());
        for (i, &fresh_error) in fresh_errors.iter().enumerate() {
            let (old, new) = (self.codes.code(i), fresh.code(i));
            let lost = old.0.iter().any(|&a| replaced[a as usize]);
            let shorter = fresh_error <= self.budgets[i] && new.0.len() < old.0.len();
            if lost || shorter || fresh_error <= self.errors[i] {
                codes.push(new.0, new.1);
                errors.push(fresh_error);
            } else {
                codes.push(old.0, old.1);
                errors.push(self.errors[i]);
            }
        }
        let count = replaced.iter().filter(|r| **r).count();
        Ok((dictionary, codes, errors, count))
    }
}

/// An entry of a code.
struct Use {
    signal: usize,
    /// Where among the coefficients of all codes.
    entry: usize,
}

/// For every atom, the codes that use it.
fn uses(codes: &SparseCodes, n_atoms: usize) -> Vec<Vec<Use>> {
    let mut uses: Vec<Vec<Use>> = Vec::new();
    uses.resize_with(n_atoms, Vec::new);
    for signal in 0..codes.len() {
        let start = codes.offsets()[signal];
        for (entry, &atom) in (start..).zip(codes.code(signal).0) {
            uses[atom as usize].push(Use { signal, entry });
        }
    }
    uses
}

/// Drops the atoms that no code uses.
fn crop(dictionary: &Dictionary, codes: SparseCodes) -> (Dictionary, SparseCodes) {
    let used: Vec<bool> = codes.usage(dictionary.n_atoms()).iter().map(|&u| u > 0).collect();
    let mut new_index = Vec::with_capacity(used.len());
    let mut kept = 0u32;
    for &is_used in &used {
        new_index.push(kept);
        kept += u32::from(is_used);
    }
    (dictionary.retain(&used), codes.renumbered(&new_index))
}

#[cfg(test)]
mod tests {
    use super::*;
    use surfabet_base::{Cancelled, Silent};

    use crate::testing::{Impatient, mask, noise, planted, random_dictionary, rng};

    fn learn(signals: &Signals<'_>, options: &KsvdOptions) -> Ksvd {
        ksvd(signals, options, &Silent, &mut |_| {}).unwrap()
    }

    /// For every true atom the absolute cosine of the learned atom that is most like it, in rising order.
    fn cosines(truth: &Dictionary, learned: &Dictionary) -> Vec<f64> {
        let best = |t: usize| {
            let cosine = |k| {
                let pairs = truth.atom(t).iter().zip(learned.atom(k));
                pairs.map(|(a, b)| f64::from(a * b)).sum::<f64>().abs()
            };
            (0..learned.n_atoms()).map(cosine).fold(0.0, f64::max)
        };
        let mut cosines: Vec<f64> = (0..truth.n_atoms()).map(best).collect();
        cosines.sort_by(f64::total_cmp);
        cosines
    }

    fn check_invariants(signals: &Signals<'_>, learned: &Ksvd, options: &KsvdOptions) {
        let Ksvd { dictionary, codes, objective, .. } = learned;
        Dictionary::new(dictionary.n_features(), dictionary.atoms().to_vec()).unwrap();
        assert!(codes.usage(dictionary.n_atoms()).iter().all(|&u| u > 0));
        assert_eq!(codes.len(), signals.len());
        for i in 0..codes.len() {
            let mut atoms = codes.code(i).0.to_vec();
            assert!(atoms.len() <= options.max_atoms);
            atoms.sort_unstable();
            atoms.dedup();
            assert_eq!(atoms.len(), codes.code(i).0.len());
        }
        let energy: f64 = (0..signals.len()).map(|i| signals.energy(i)).sum();
        for pair in objective.windows(2) {
            assert!(pair[1] <= pair[0] + 1e-8 * energy, "{objective:?}");
        }
        let errors = squared_errors(dictionary, signals, codes).unwrap();
        let total: f64 = errors.iter().sum();
        let last = objective[objective.len() - 1];
        assert!((total - last).abs() <= 1e-9 * (1.0 + last));
        assert!(dictionary.n_atoms() + learned.cropped <= options.n_atoms);
    }

    #[test]
    fn planted_atoms_are_recovered_although_values_are_missing() {
        let mut rng = rng(11);
        let truth = random_dictionary(&mut rng, 32, 48);
        let (clean, _) = planted(&mut rng, &truth, 1200, 3);
        let options = KsvdOptions {
            n_atoms: 32,
            max_atoms: 3,
            iterations: 40,
            convergence: 0.0,
            ..KsvdOptions::default()
        };
        for (missing, least) in [(0.0, 0.9), (0.2, 0.9), (0.5, 0.8)] {
            let weights = mask(&mut rng, clean.len(), missing);
            let zero_filled: Vec<f32> = clean.iter().zip(&weights).map(|(v, w)| v * w).collect();
            let signals = Signals::new(48, &zero_filled, Some(&weights)).unwrap();
            let weighted = learn(&signals, &options);
            check_invariants(&signals, &weighted, &options);
            let cosines_weighted = cosines(&truth, &weighted.dictionary);
            let found = cosines_weighted.iter().filter(|&&c| c > 0.95).count() as f64 / 32.0;
            assert!(found >= least, "{found} recovered with {missing} missing");
            if missing > 0.0 {
                let plain = learn(&Signals::new(48, &zero_filled, None).unwrap(), &options);
                let (median, unweighted) =
                    (cosines_weighted[16], cosines(&truth, &plain.dictionary)[16]);
                // Zeros taken for values bias the atoms; left out, they do not.
                assert!(1.0 - median < 0.2 * (1.0 - unweighted), "{median} against {unweighted}");
            }
        }
    }

    #[test]
    fn real_weights_keep_the_objective_falling() {
        let mut rng = rng(12);
        let values = noise(&mut rng, 20 * 200);
        let weights: Vec<f32> = noise(&mut rng, values.len()).iter().map(|v| v * v).collect();
        let signals = Signals::new(20, &values, Some(&weights)).unwrap();
        for selection in [Selection::LeastSquares, Selection::Correlation] {
            let options = KsvdOptions {
                n_atoms: 40,
                max_atoms: 4,
                selection,
                convergence: 0.0,
                ..KsvdOptions::default()
            };
            let learned = learn(&signals, &options);
            check_invariants(&signals, &learned, &options);
            assert!(learned.objective[20] < 0.8 * learned.objective[0]);
        }
    }

    #[test]
    fn one_atom_without_weights_is_the_leading_singular_vector() {
        // Singular values 6 and 2 along (3, 4) / 5 and (-4, 3) / 5.
        let rows = [(6.0, 0.0, 0.6, 0.8), (0.0, 2.0, 0.0, 0.0)];
        let mut values = Vec::new();
        for (a, b, _, _) in rows {
            let (x, y): (f32, f32) = (a * 0.6 - b * 0.8, a * 0.8 + b * 0.6);
            values.extend([x, y]);
        }
        let options =
            KsvdOptions { n_atoms: 1, max_atoms: 1, random_state: 1, ..KsvdOptions::default() };
        let learned = learn(&Signals::new(2, &values, None).unwrap(), &options);
        let atom = learned.dictionary.atom(0);
        // From the other row as the first atom K-SVD cannot leave: that row is orthogonal to this one.
        let product = (atom[0] * 0.6 + atom[1] * 0.8).abs();
        assert!(!(1e-6..=1.0 - 1e-6).contains(&product));
        let mixed = [3.6, 4.8, -1.6 + 0.06, 1.2 + 0.08];
        let learned = learn(&Signals::new(2, &mixed, None).unwrap(), &options);
        // The exact value for these rows by their 2 x 2 Gram matrix.
        let (a, b, c) = (
            mixed[0] * mixed[0] + mixed[2] * mixed[2],
            mixed[0] * mixed[1] + mixed[2] * mixed[3],
            mixed[1] * mixed[1] + mixed[3] * mixed[3],
        );
        let smaller = (a + c) / 2.0 - (((a - c) / 2.0).powi(2) + b * b).sqrt();
        let last = *learned.objective.last().unwrap();
        assert!((last - f64::from(smaller)).abs() < 1e-4, "{last} {smaller}");
    }

    #[test]
    fn a_rank_one_matrix_with_holes_is_completed_exactly() {
        let mut rng = rng(13);
        let (rows, columns) = (noise(&mut rng, 40), noise(&mut rng, 30));
        let values: Vec<f32> =
            rows.iter().flat_map(|r| columns.iter().map(move |c| r * c)).collect();
        let weights = mask(&mut rng, values.len(), 0.5);
        let signals = Signals::new(30, &values, Some(&weights)).unwrap();
        let options = KsvdOptions {
            n_atoms: 1,
            max_atoms: 1,
            iterations: 50,
            convergence: 0.0,
            ..KsvdOptions::default()
        };
        let learned = learn(&signals, &options);
        let model = crate::reconstruct(&learned.dictionary, &learned.codes).unwrap();
        for (m, v) in model.iter().zip(&values) {
            assert!((m - v).abs() < 1e-3 * (1.0 + v.abs()), "{m} {v}");
        }
    }

    #[test]
    fn an_entry_that_no_signal_observes_is_zero() {
        let mut rng = rng(14);
        let values = noise(&mut rng, 6 * 50);
        let mut weights = mask(&mut rng, values.len(), 0.2);
        weights.iter_mut().skip(2).step_by(6).for_each(|w| *w = 0.0);
        let signals = Signals::new(6, &values, Some(&weights)).unwrap();
        let options = KsvdOptions { n_atoms: 4, max_atoms: 2, ..KsvdOptions::default() };
        let learned = learn(&signals, &options);
        check_invariants(&signals, &learned, &options);
        for k in 0..learned.dictionary.n_atoms() {
            assert_eq!(learned.dictionary.atom(k)[2], 0.0);
        }
    }

    #[test]
    fn atoms_that_nobody_needs_are_cropped() {
        let options = KsvdOptions { n_atoms: 50, max_atoms: 2, ..KsvdOptions::default() };
        // Three directions in 60 signals.
        let directions = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.6, 0.8, 0.0], [0.0, 0.0, 0.0, -1.0f32]];
        let values: Vec<f32> =
            (0..60).flat_map(|i| directions[i % 3].map(|v| v * (1.0 + i as f32))).collect();
        let signals = Signals::new(4, &values, None).unwrap();
        let learned = learn(&signals, &options);
        check_invariants(&signals, &learned, &options);
        assert_eq!((learned.dictionary.n_atoms(), learned.cropped), (3, 47));
        assert!(*learned.objective.last().unwrap() < 1e-6);
        // Fewer signals than atoms: each its own, nothing cropped but what repeats.
        let mut rng = rng(15);
        let values = noise(&mut rng, 4 * 3);
        let learned = learn(&Signals::new(4, &values, None).unwrap(), &options);
        assert_eq!(learned.dictionary.n_atoms() + learned.cropped, 3);
        assert!(*learned.objective.last().unwrap() < 1e-6);
    }

    #[test]
    fn nothing_to_learn_from_gives_an_empty_dictionary() {
        let options = KsvdOptions::default();
        for (values, weights) in
            [(vec![], vec![]), (vec![0.0; 8], vec![1.0; 8]), (vec![3.0; 8], vec![0.0; 8])]
        {
            let signals = Signals::new(4, &values, Some(&weights)).unwrap();
            let learned = learn(&signals, &options);
            assert_eq!(learned.dictionary.n_atoms(), 0);
            assert_eq!(learned.codes.len(), values.len() / 4);
        }
    }

    #[test]
    fn seed_and_not_threads_decide() {
        let mut rng = rng(16);
        let values = noise(&mut rng, 16 * 400);
        let weights = mask(&mut rng, values.len(), 0.3);
        let signals = Signals::new(16, &values, Some(&weights)).unwrap();
        let options =
            KsvdOptions { n_atoms: 24, max_atoms: 3, iterations: 5, ..KsvdOptions::default() };
        let learned = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ksvd(&signals, &options, &Silent, &mut |_| {}).unwrap())
        };
        let one = learned(1);
        assert_eq!(one, learned(2));
        assert_eq!(one, learned(8));
        let other = learn(&signals, &KsvdOptions { random_state: 1, ..options });
        assert_ne!(one.dictionary, other.dictionary);
    }

    #[test]
    fn iterations_are_reported_and_cancelling_is_heard() {
        let mut rng = rng(17);
        let values = noise(&mut rng, 8 * 60);
        let signals = Signals::new(8, &values, None).unwrap();
        let options =
            KsvdOptions { n_atoms: 10, iterations: 4, convergence: 0.0, ..KsvdOptions::default() };
        let mut seen = Vec::new();
        let learned = ksvd(&signals, &options, &Silent, &mut |i| seen.push(*i)).unwrap();
        assert_eq!(seen.iter().map(|i| i.iteration).collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert_eq!(seen[3].objective, learned.objective[4]);
        assert_eq!(seen.iter().map(|i| i.replaced).sum::<usize>(), learned.replaced);
        assert_eq!(learned.stop_reason, StopReason::Iterations);
        assert_eq!(
            ksvd(&signals, &options, &Impatient, &mut |_| {}).unwrap_err(),
            Error::Cancelled(Cancelled)
        );
        let hasty = KsvdOptions { iterations: 100, convergence: 0.5, ..options };
        let learned = learn(&signals, &hasty);
        assert_eq!(learned.stop_reason, StopReason::Converged);
        assert!(learned.iterations < 100);
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let signals = Signals::new(1, &[1.0], None).unwrap();
        let good = KsvdOptions::default();
        for bad in [
            KsvdOptions { n_atoms: 0, ..good },
            KsvdOptions { max_atoms: 0, ..good },
            KsvdOptions { tolerance: f32::NAN, ..good },
            KsvdOptions { convergence: 1.0, ..good },
            KsvdOptions { max_coherence: 0.0, ..good },
            KsvdOptions { update_tolerance: -1.0, ..good },
        ] {
            let refused = ksvd(&signals, &bad, &Silent, &mut |_| {});
            assert!(matches!(refused, Err(Error::InvalidParameter { .. })), "{bad:?}");
        }
    }
}
