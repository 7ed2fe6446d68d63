//! Weighted K-SVD: learns the dictionary `D` and the codes `X` of HSCSM eq. 1 (section III-B) together.
//!
//! K-SVD (Aharon, Elad, Bruckstein 2006) alternates sparse coding with an update of one atom at a time, each
//! with the coefficients of the signals that use it. Both halves here minimise the weighted error, so that
//! values which were not observed neither shape atoms nor codes.

use surfabet_base::Progress;

use crate::coded::Coded;
use crate::codes::SparseCodes;
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::initial::initial_dictionary;
use crate::omp::{OmpOptions, Selection, omp};
use crate::rank_one::{self, Member};
use crate::signals::Signals;
use crate::swaps::{State, Swaps, duplicates, swaps};

/// Splits of atoms are tried when an iteration lowers the objective by less than this part: before, alternation finds
/// better use for them by itself, and splits cost as much time as coding.
const PLATEAU: f64 = 0.1;

/// Share of the signals' energy that single precision cannot distinguish from zero.
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
    /// Atoms whose absolute cosine exceeds this count as the same: new ones are less alike, and of two that remain one
    /// is dropped at the end if the objective stands it.
    pub max_coherence: f32,
    /// Most updates of every atom between two codings of the signals.
    pub update_iterations: usize,
    /// Least relative decrease of the objective by an update of all atoms for another one.
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
            update_iterations: 8,
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
    /// Atoms replaced by others that earn more.
    pub replaced: usize,
}

/// What was learned.
#[derive(Debug, Clone, PartialEq)]
pub struct Ksvd {
    /// The atoms that are in use.
    pub dictionary: Dictionary,
    /// One code per signal.
    pub codes: SparseCodes,
    /// `Σ w (s − D x)²` over all signals: of the first dictionary, then after every iteration. The codes of the first
    /// three values are shorter than `max_atoms`, unless iterations end there. Never rises when the tolerance is 0 (but
    /// for rounding); otherwise a shorter code within the tolerance may raise it.
    pub objective: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
    /// Atoms replaced by others that earn more, over all iterations.
    pub replaced: usize,
    /// Atoms dropped at the end: no code uses them, or others can stand in for them.
    pub cropped: usize,
    /// Why learning ended.
    pub stop_reason: StopReason,
}

/// Learns a dictionary for `signals`, and their codes: `min Σ w (s − D x)²` with at most `max_atoms` entries
/// in a code. With weights of 0 and 1 that is HSCSM eq. 1; without weights it is plain K-SVD.
///
/// Starts from signals drawn with `random_state`, each by what those before leave of it, and from codes of two fifths of
/// `max_atoms`, a fifth more in each of the first iterations. An iteration updates all atoms up to `update_iterations`
/// times, each with the coefficients that use it; replaces atoms; and codes the signals. Where new codes as a whole are
/// worse than those of the iteration before, each signal keeps the better of its two. Atoms without which the objective would lose little (unused ones, and those for which another can stand
/// in) give way to directions that residuals of many signals share and, once the objective falls slowly, to the second of
/// two lines into which the signals of an atom fall. Replacements that raise the objective are undone, and fewer are
/// tried next. At the end unused atoms are cropped, and duplicates if that does not raise the objective, so the
/// dictionary can be smaller than asked for.
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
    let dictionary = initial_dictionary(signals, options.n_atoms, options.random_state, progress)?;
    let mut learner = Learner::new(signals, options, progress, dictionary)?;
    let mut objective = vec![learner.coded.objective()];
    let (mut replaced, mut stop_reason) = (0, StopReason::Iterations);
    let mut fit = f64::INFINITY;
    for iteration in 1..=options.iterations {
        learner.update_atoms()?;
        let fit_before = std::mem::replace(&mut fit, learner.coded.objective());
        learner.sparsity = sparsity(options, iteration);
        let swapped = learner.code(fit > (1.0 - PLATEAU) * fit_before)?;
        replaced += swapped.count;
        let (before, after) = (objective[iteration - 1], learner.coded.objective());
        objective.push(after);
        on_iteration(&KsvdIteration { iteration, objective: after, replaced: swapped.count });
        let final_length = learner.sparsity == options.max_atoms;
        let converged = final_length && before - after <= options.convergence * before;
        if options.convergence > 0.0 && converged && !swapped.retry {
            stop_reason = StopReason::Converged;
            break;
        }
    }
    let n_atoms = learner.dictionary.n_atoms();
    learner.drop_duplicates()?;
    let iterations = objective.len() - 1;
    objective[iterations] = learner.coded.objective();
    let (dictionary, codes) = crop(&learner.dictionary, learner.coded.codes);
    let cropped = n_atoms - dictionary.n_atoms();
    Ok(Ksvd { dictionary, codes, objective, iterations, replaced, cropped, stop_reason })
}

/// Most atoms of a code after `iteration`: two, three and four fifths of what is asked for before the last, then all.
///
/// Short codes are quick, and atoms that have to do with few others find their directions sooner.
fn sparsity(options: &KsvdOptions, iteration: usize) -> usize {
    match iteration {
        0..3 if iteration < options.iterations => {
            options.max_atoms.saturating_mul(iteration + 2).div_ceil(5).min(options.max_atoms)
        }
        _ => options.max_atoms,
    }
}

/// The weights scaled so that the largest of all is 1, and the factor.
fn unit_weights(signals: &Signals<'_>) -> (Option<Vec<f32>>, f64) {
    if !signals.has_weights() {
        return (None, 1.0);
    }
    let all = || (0..signals.len()).filter_map(|i| signals.weights(i)).flatten().copied();
    let largest = all().fold(0.0, f32::max);
    let scale = if largest > 0.0 { 1.0 / f64::from(largest) } else { 0.0 };
    (Some(all().map(|w| (f64::from(w) * scale) as f32).collect()), scale)
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
    /// Weights, the largest of all 1.
    weights: Option<Vec<f32>>,
    /// What the weights were multiplied by.
    scale: f64,
    /// The error at which each signal meets the tolerance.
    budgets: Vec<f64>,
    dictionary: Dictionary,
    coded: Coded,
    /// Most atoms of a code at present.
    sparsity: usize,
    /// Most atoms to replace at once: fewer after an attempt that was undone.
    most_swaps: usize,
    /// [`Learner::excess`] after the coding before.
    reached: f64,
}

/// What became of an attempt to replace atoms.
struct Swapped {
    /// How many were replaced.
    count: usize,
    /// The attempt was undone, and one with fewer will follow.
    retry: bool,
}

impl<'a> Learner<'a> {
    fn new(
        signals: &'a Signals<'a>,
        options: &'a KsvdOptions,
        progress: &'a dyn Progress,
        dictionary: Dictionary,
    ) -> Result<Self> {
        let sparsity = sparsity(options, 0);
        let omp_options = OmpOptions { max_atoms: sparsity, ..options.omp_options() };
        let codes = omp(&dictionary, signals, &omp_options, progress)?;
        let coded = Coded::new(&dictionary, signals, codes);
        let (weights, scale) = unit_weights(signals);
        let mut learner = Self {
            signals,
            options,
            progress,
            weights,
            scale,
            budgets: budgets(signals, options.tolerance),
            dictionary,
            coded,
            sparsity,
            most_swaps: usize::MAX,
            reached: f64::INFINITY,
        };
        learner.reached = learner.excess(&learner.coded.errors);
        Ok(learner)
    }

    /// Updates every atom in turn, with the coefficients of the codes that use it, and that several times.
    fn update_atoms(&mut self) -> Result<()> {
        let n = self.signals.n_features();
        let all_uses = uses(&self.coded.codes, self.dictionary.n_atoms());
        let mut before = self.coded.objective();
        for _ in 0..self.options.update_iterations.max(1) {
            for (atom, uses) in all_uses.iter().enumerate() {
                if uses.is_empty() {
                    continue;
                }
                self.progress.check()?;
                let mut members = members(
                    uses,
                    &mut self.coded.residuals,
                    self.weights.as_deref(),
                    self.coded.codes.coefficients(),
                    n,
                );
                rank_one::update(&mut members, self.dictionary.atom_mut(atom));
                let solved: Vec<f32> = members.iter().map(|m| m.coefficient).collect();
                let all = self.coded.codes.coefficients_mut();
                for (used, x) in uses.iter().zip(solved) {
                    all[used.entry] = x;
                }
            }
            self.coded.measure(self.signals);
            let after = self.coded.objective();
            if before - after <= self.options.update_tolerance * before {
                break;
            }
            before = after;
        }
        self.coded.refresh(&self.dictionary, self.signals);
        Ok(())
    }

    /// Replaces atoms by what earns more, and codes all signals again.
    fn code(&mut self, splits: bool) -> Result<Swapped> {
        let swapped = self.swap_and_code(splits)?;
        self.reached = self.excess(&self.coded.errors);
        Ok(swapped)
    }

    fn swap_and_code(&mut self, splits: bool) -> Result<Swapped> {
        let Swaps { successors, count } = self.swaps(splits)?;
        let mut dictionary = self.dictionary.clone();
        let mut replaced = vec![false; dictionary.n_atoms()];
        for (atom, successor) in &successors {
            dictionary.atom_mut(*atom).copy_from_slice(successor);
            replaced[*atom] = true;
        }
        let coded = self.recode(&dictionary, &replaced)?;
        if count > 0 && self.excess(&coded.errors) > self.excess(&self.coded.errors) {
            replaced.fill(false);
            self.coded = self.recode(&self.dictionary, &replaced)?;
            self.most_swaps = count / 2;
            return Ok(Swapped { count: 0, retry: count > 1 });
        }
        (self.dictionary, self.coded) = (dictionary, coded);
        self.most_swaps = if self.most_swaps == 0 { 1 } else { usize::MAX };
        Ok(Swapped { count, retry: false })
    }

    fn swaps(&self, splits: bool) -> Result<Swaps> {
        let scaled = |values: &[f64]| values.iter().map(|v| v * self.scale).collect::<Vec<f64>>();
        let state = State {
            dictionary: &self.dictionary,
            codes: &self.coded.codes,
            residuals: &self.coded.residuals,
            weights: self.weights.as_deref(),
            errors: &scaled(&self.coded.errors),
            budgets: &scaled(&self.budgets),
            max_atoms: self.sparsity,
            max_coherence: self.options.max_coherence,
        };
        swaps(&state, self.most_swaps, splits, self.progress)
    }

    /// The objective, where errors within the tolerance all count as that: the shorter codes that it allows are no loss.
    fn excess(&self, errors: &[f64]) -> f64 {
        errors.iter().zip(&self.budgets).map(|(e, b)| e.max(*b)).sum()
    }

    /// All signals coded over `dictionary`. Where that is no step forward from the coding before, a signal keeps its code
    /// if the new one is worse and its atoms are still there: always, and atoms would follow codes that no coder finds
    /// again. On 2000 patches of depth the error of new codes over the dictionary was 940 that way, of the old ones 497.
    fn recode(&self, dictionary: &Dictionary, replaced: &[bool]) -> Result<Coded> {
        let n = self.signals.n_features();
        let options = OmpOptions { max_atoms: self.sparsity, ..self.options.omp_options() };
        let fresh = omp(dictionary, self.signals, &options, self.progress)?;
        let mut coded = Coded::new(dictionary, self.signals, fresh);
        if self.excess(&coded.errors) <= self.reached {
            return Ok(coded);
        }
        let mut codes = SparseCodes::default();
        for i in 0..self.coded.codes.len() {
            let (old, new) = (self.coded.codes.code(i), coded.codes.code(i));
            let lost = old.0.iter().any(|&a| replaced[a as usize]);
            let shorter = coded.errors[i] <= self.budgets[i] && new.0.len() < old.0.len();
            if lost || shorter || coded.errors[i] <= self.coded.errors[i] {
                codes.push(new.0, new.1);
            } else {
                codes.push(old.0, old.1);
                coded.errors[i] = self.coded.errors[i];
                let row = &self.coded.residuals[i * n..][..n];
                coded.residuals[i * n..][..n].copy_from_slice(row);
            }
        }
        coded.codes = codes;
        Ok(coded)
    }

    /// Codes the signals without duplicate atoms, and keeps to that if the objective stands it.
    fn drop_duplicates(&mut self) -> Result<()> {
        let usage = self.coded.codes.usage(self.dictionary.n_atoms());
        let unused: Vec<bool> = usage.iter().map(|&u| u == 0).collect();
        let repeats =
            duplicates(&self.dictionary, &usage, self.options.max_coherence, self.progress)?;
        if unused.iter().zip(&repeats).all(|(unused, repeats)| *unused || !*repeats) {
            return Ok(());
        }
        let keep: Vec<bool> = repeats.iter().map(|r| !r).collect();
        let dictionary = self.dictionary.retain(&keep);
        let codes = omp(&dictionary, self.signals, &self.options.omp_options(), self.progress)?;
        let coded = Coded::new(&dictionary, self.signals, codes);
        let energy: f64 = (0..self.signals.len()).map(|i| self.signals.energy(i)).sum();
        if coded.objective() <= self.coded.objective() + ROUNDING * energy {
            (self.dictionary, self.coded) = (dictionary, coded);
        }
        Ok(())
    }
}

/// The signals that use an atom, with their rows of `residuals` and `weights`.
fn members<'a>(
    uses: &[Use],
    residuals: &'a mut [f32],
    weights: Option<&'a [f32]>,
    coefficients: &[f32],
    n: usize,
) -> Vec<Member<'a>> {
    let (mut rest, mut next) = (residuals, 0);
    let mut members = Vec::with_capacity(uses.len());
    for used in uses {
        let (_, from) = std::mem::take(&mut rest).split_at_mut((used.signal - next) * n);
        let (residual, after) = from.split_at_mut(n);
        members.push(Member {
            residual,
            weights: weights.map(|all| &all[used.signal * n..][..n]),
            coefficient: coefficients[used.entry],
        });
        (rest, next) = (after, used.signal + 1);
    }
    members
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
    use crate::codes::squared_errors;
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

    /// Share of the planted atoms that are within a cosine of 0.99 of a learned one, over three seeds; `signals` of 48
    /// values are mixtures of three of 32 atoms.
    fn recovered(n_signals: usize, missing: f64, iterations: usize) -> f64 {
        let options = KsvdOptions {
            n_atoms: 32,
            max_atoms: 3,
            iterations,
            convergence: 1e-6,
            ..KsvdOptions::default()
        };
        let mut found = 0;
        for seed in 0..3 {
            let mut rng = rng(seed);
            let truth = random_dictionary(&mut rng, 32, 48);
            let (mut values, _) = planted(&mut rng, &truth, n_signals, 3);
            let weights = mask(&mut rng, values.len(), missing);
            values.iter_mut().zip(&weights).for_each(|(v, w)| *v *= w);
            let signals = Signals::new(48, &values, Some(&weights)).unwrap();
            let learned = learn(&signals, &options);
            check_invariants(&signals, &learned, &options);
            found += cosines(&truth, &learned.dictionary).iter().filter(|&&c| c > 0.99).count();
        }
        found as f64 / 96.0
    }

    #[test]
    fn planted_atoms_are_recovered_although_values_are_missing() {
        for missing in [0.0, 0.2, 0.5] {
            let found = recovered(1200, missing, 40);
            assert!(found >= 0.99, "{found} recovered with {missing} missing");
        }
        // Five values do not determine three atoms, nor 40 signals 32: whatever fits them is found.
        for (n_signals, missing) in [(1200, 0.9), (40, 0.0)] {
            let found = recovered(n_signals, missing, 5);
            assert!(found < 0.5, "{found} recovered of {n_signals} with {missing} missing");
        }
    }

    #[test]
    fn zeros_for_missing_values_bias_the_atoms() {
        let mut rng = rng(11);
        let truth = random_dictionary(&mut rng, 32, 48);
        let (clean, _) = planted(&mut rng, &truth, 1200, 3);
        let options =
            KsvdOptions { n_atoms: 32, max_atoms: 3, iterations: 20, ..KsvdOptions::default() };
        for missing in [0.2, 0.5] {
            let weights = mask(&mut rng, clean.len(), missing);
            let zero_filled: Vec<f32> = clean.iter().zip(&weights).map(|(v, w)| v * w).collect();
            let weighted =
                learn(&Signals::new(48, &zero_filled, Some(&weights)).unwrap(), &options);
            let plain = learn(&Signals::new(48, &zero_filled, None).unwrap(), &options);
            let median = |learned: &Ksvd| cosines(&truth, &learned.dictionary)[16];
            let (weighted, plain) = (median(&weighted), median(&plain));
            assert!(1.0 - weighted < 0.2 * (1.0 - plain), "{weighted} against {plain}");
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
