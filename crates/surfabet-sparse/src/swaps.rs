//! Ways out of local minima of K-SVD: which atoms earn least, and what would earn more in their place.
//!
//! A dictionary that alternation no longer improves typically has one atom where there should be two, and an atom
//! elsewhere that is hardly needed (Pali and Schnass, Dictionary learning - from local towards global and adaptive,
//! 2018, describe these points of rest). Two kinds of successors mend that: directions which the residuals of many
//! signals share, and the two lines that fit the signals of an atom better than it does alone. Each comes with what it
//! is expected to take off the objective, and takes the place of an atom that is worth less.

use pulp::Arch;
use surfabet_base::Progress;
use surfabet_base::parallel;

use crate::codes::SparseCodes;
use crate::dictionary::{Dictionary, normalize};
use crate::error::Result;
use crate::omp::{by_feature, gram};
use crate::pursuit::dot;
use crate::rank_one::{dot3, leading_atom};

/// One candidate from shared residuals is sought for this many atoms.
const SHARED_PART: usize = 10;

/// Rounds in which candidates are fitted and signals choose between them: K-SVD goes on with what is right.
const SHARED_ROUNDS: usize = 2;

/// As [`SHARED_ROUNDS`] for the two lines of a split, which have to come apart.
const SPLIT_ROUNDS: usize = 4;

/// Signals handed to a thread at a time.
const SIGNALS: usize = 64;

/// A signal as lines are fitted to it.
struct Row<'a> {
    values: &'a [f32],
    weights: Option<&'a [f32]>,
    /// What a line has to explain of it before it counts.
    spare: f64,
}

impl Row<'_> {
    /// Best coefficient for a line, and what that explains of the row.
    #[inline(always)]
    fn fit(&self, line: &[f32], squares: &[f32]) -> (f64, f64) {
        let (share, length) = match self.weights {
            None => (dot(self.values, line), 1.0),
            Some(w) => (dot3(w, self.values, line), dot(w, squares)),
        };
        if length > 1e-12 { (share / length, share * share / length) } else { (0.0, 0.0) }
    }
}

/// A line that signals have chosen, and what all of them gain by it.
struct Line {
    atom: Vec<f32>,
    gain: f64,
}

/// What learning has reached, as swaps are sought in it.
pub struct State<'a> {
    pub dictionary: &'a Dictionary,
    pub codes: &'a SparseCodes,
    /// What the codes leave of every signal.
    pub residuals: &'a [f32],
    /// Weights, at most 1.
    pub weights: Option<&'a [f32]>,
    /// Weighted squared residual of every signal, with those weights.
    pub errors: &'a [f64],
    /// The error at which each signal needs nothing more.
    pub budgets: &'a [f64],
    /// Most entries of a code.
    pub max_atoms: usize,
    /// Least cosine between candidates that count as the same.
    pub max_coherence: f32,
}

/// Atoms with their successors.
#[derive(Default)]
pub struct Swaps {
    /// In a split the atom that gives way to two is among them.
    pub successors: Vec<(usize, Vec<f32>)>,
    /// How many atoms make room.
    pub count: usize,
}

/// What could be put into the dictionary.
struct Offer {
    atom: Vec<f32>,
    /// In a split the atom that gives way to two, and the other of them.
    split: Option<(usize, Vec<f32>)>,
    /// What it is expected to take off the objective.
    gain: f64,
}

/// What atoms are worth.
struct Worth {
    /// What the objective would lose with each atom, if the one most like it took over.
    losses: Vec<f64>,
    /// The atom most like each.
    nearest: Vec<usize>,
    /// What each signal would lose with the least entry of its code; nothing where there is room for another.
    spares: Vec<f64>,
}

/// At most `limit` swaps of atoms for what is worth more, the largest gains for the smallest losses. With `splits` atoms
/// may also give way to two.
pub fn swaps(
    state: &State<'_>,
    limit: usize,
    splits: bool,
    progress: &dyn Progress,
) -> Result<Swaps> {
    if state.dictionary.n_atoms() == 0 || limit == 0 {
        return Ok(Swaps::default());
    }
    let worth = state.worth(progress)?;
    let unused = worth.losses.iter().filter(|&&loss| loss == 0.0).count();
    let count = worth.losses.len().div_ceil(SHARED_PART).max(unused);
    let mut offers: Vec<Offer> = (state.shared(&worth.spares, count, progress)?.into_iter())
        .map(|line| Offer { atom: line.atom, split: None, gain: line.gain })
        .collect();
    if splits {
        let least = worth.losses.iter().copied().fold(f64::INFINITY, f64::min);
        let users = users(state.codes, worth.losses.len());
        let split = |a: usize| state.split(a, &users[a], least, progress);
        let found: Vec<Option<Offer>> = parallel::try_map_range(users.len(), split)?;
        offers.extend(found.into_iter().flatten());
    }
    offers.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Ok(worth.assign(offers, limit))
}

/// For every atom the signals that use it.
fn users(codes: &SparseCodes, n_atoms: usize) -> Vec<Vec<usize>> {
    let mut users = vec![Vec::new(); n_atoms];
    for i in 0..codes.len() {
        for &a in codes.code(i).0 {
            users[a as usize].push(i);
        }
    }
    users
}

impl Worth {
    /// Gives the offers, the largest gain first, the places of the atoms with the smallest losses, as long as it pays.
    fn assign(&self, offers: Vec<Offer>, limit: usize) -> Swaps {
        let mut places: Vec<usize> = (0..self.losses.len()).collect();
        places.sort_by(|&a, &b| self.losses[a].total_cmp(&self.losses[b]).then(a.cmp(&b)));
        let mut places = places.into_iter().peekable();
        // A loss stands for as long as the atom that would take over is there as it was.
        let (mut gone, mut needed) =
            (vec![false; self.losses.len()], vec![false; self.losses.len()]);
        let mut swaps = Swaps::default();
        for Offer { atom, split, gain } in offers {
            if swaps.count == limit {
                break;
            }
            let parent = split.as_ref().map(|(parent, _)| *parent);
            if parent.is_some_and(|p| gone[p] || needed[p]) {
                continue;
            }
            while places.next_if(|&p| gone[p] || needed[p] || gone[self.nearest[p]]).is_some() {}
            let Some(&place) = places.peek() else { break };
            if gain <= self.losses[place] {
                break;
            }
            if parent.is_some_and(|p| p == place || p == self.nearest[place]) {
                continue;
            }
            gone[place] = true;
            needed[self.nearest[place]] = true;
            swaps.count += 1;
            swaps.successors.push((place, atom));
            if let Some((parent, other)) = split {
                gone[parent] = true;
                swaps.successors.push((parent, other));
            }
        }
        swaps
    }
}

impl State<'_> {
    fn n(&self) -> usize {
        self.dictionary.n_features()
    }

    fn row(&self, i: usize, spare: f64) -> Row<'_> {
        let n = self.n();
        Row {
            values: &self.residuals[i * n..][..n],
            weights: self.weights.map(|w| &w[i * n..][..n]),
            spare,
        }
    }

    fn worth(&self, progress: &dyn Progress) -> Result<Worth> {
        let (k, n) = (self.dictionary.n_atoms(), self.n());
        let squares: Vec<f32> = self.dictionary.atoms().iter().map(|d| d * d).collect();
        let (mut losses, mut nearest) = (vec![0.0; k], Vec::with_capacity(k));
        let mut spares = vec![0.0; self.codes.len()];
        for (i, spare) in spares.iter_mut().enumerate() {
            let (atoms, coefficients) = self.codes.code(i);
            let weights = self.weights.map(|w| &w[i * n..][..n]);
            let mut least = f64::INFINITY;
            for (&a, &x) in atoms.iter().zip(coefficients) {
                let a = a as usize;
                let length = weights.map_or(1.0, |w| dot(w, &squares[a * n..][..n]));
                let share = f64::from(x).powi(2) * length;
                losses[a] += share;
                least = least.min(share);
            }
            *spare = if atoms.len() < self.max_atoms { 0.0 } else { least };
        }
        let gram = gram(self.dictionary, &by_feature(self.dictionary), progress)?;
        for (a, loss) in losses.iter_mut().enumerate() {
            let (mut most, mut like) = (0.0, a);
            for b in (0..k).filter(|&b| b != a) {
                let squared = gram[a * k + b].powi(2);
                if squared > most {
                    (most, like) = (squared, b);
                }
            }
            *loss *= 1.0 - f64::from(most.min(1.0));
            nearest.push(like);
        }
        Ok(Worth { losses, nearest, spares })
    }

    /// At most `count` directions that the residuals of many signals share.
    fn shared(&self, spares: &[f64], count: usize, progress: &dyn Progress) -> Result<Vec<Line>> {
        let n = self.n();
        let gain = |i: usize| self.errors[i] - spares[i];
        let mut open: Vec<usize> = (0..spares.len())
            .filter(|&i| gain(i) > 0.0 && self.errors[i] > self.budgets[i])
            .collect();
        open.sort_by(|&a, &b| gain(b).total_cmp(&gain(a)).then(a.cmp(&b)));
        let mut lines: Vec<Vec<f32>> = Vec::new();
        for &i in &open {
            if lines.len() == count {
                break;
            }
            let row = self.row(i, 0.0);
            let mut atom = vec![0.0; n];
            for (j, a) in atom.iter_mut().enumerate() {
                *a = if row.weights.is_none_or(|w| w[j] > 0.0) { row.values[j] } else { 0.0 };
            }
            if !normalize(&mut atom) {
                continue;
            }
            let unlike = |l: &Vec<f32>| dot(l, &atom).abs() <= f64::from(self.max_coherence);
            if lines.iter().all(unlike) {
                lines.push(atom);
            }
        }
        let rows: Vec<Row<'_>> = open.iter().map(|&i| self.row(i, spares[i])).collect();
        fit_lines(&rows, lines, SHARED_ROUNDS, progress)
    }

    /// The two lines that fit the signals of an atom best; `None` if they cannot explain more than it by `least`.
    fn split(
        &self,
        atom: usize,
        users: &[usize],
        least: f64,
        progress: &dyn Progress,
    ) -> Result<Option<Offer>> {
        let possible: f64 = users.iter().map(|&i| self.errors[i]).sum();
        let worst = users.iter().max_by(|&&a, &&b| self.errors[a].total_cmp(&self.errors[b]));
        let Some(&worst) = worst.filter(|_| users.len() > 1 && possible > least) else {
            return Ok(None);
        };
        let n = self.n();
        let own = self.dictionary.atom(atom);
        let weighted = |i: usize| {
            let row = self.row(i, 0.0);
            let w = move |j: usize| row.weights.map_or(1.0, |w| w[j]);
            row.values.iter().enumerate().map(move |(j, r)| r * w(j))
        };
        let mut start: Vec<f32> = weighted(worst).collect();
        if !normalize(&mut start) {
            return Ok(None);
        }
        let residuals: Vec<f32> = users.iter().flat_map(|&i| weighted(i)).collect();
        let across = leading_atom(&residuals, &start, progress)?;
        let mut values = Vec::with_capacity(users.len() * n);
        for &i in users {
            let (atoms, coefficients) = self.codes.code(i);
            let entry = atoms.iter().position(|&a| a as usize == atom);
            let x = entry.map_or(0.0, |e| coefficients[e]);
            values.extend(self.row(i, 0.0).values.iter().zip(own).map(|(r, d)| r + x * d));
        }
        let rows: Vec<Row<'_>> = (users.iter().zip(values.chunks_exact(n)))
            .map(|(&i, values)| Row { values, ..self.row(i, 0.0) })
            .collect();
        let towards = |sign: f32| {
            let mut line: Vec<f32> = own.iter().zip(&across).map(|(d, c)| d + sign * c).collect();
            normalize(&mut line).then_some(line)
        };
        let (Some(first), Some(second)) = (towards(1.0), towards(-1.0)) else { return Ok(None) };
        let alone = fit_lines(&rows, vec![own.to_vec()], 0, progress)?;
        let mut lines = fit_lines(&rows, vec![first, second], SPLIT_ROUNDS, progress)?;
        let before: f64 = alone.iter().map(|l| l.gain).sum();
        let gain = lines.iter().map(|l| l.gain).sum::<f64>() - before;
        let (Some(second), Some(first)) = (lines.pop(), lines.pop()) else { return Ok(None) };
        let split = Some((atom, first.atom));
        Ok((gain > least).then_some(Offer { atom: second.atom, split, gain }))
    }
}

/// Fits lines through the origin to the rows as k-means fits points: each row counts for the line that explains most of
/// it, and every line becomes the best for its rows.
fn fit_lines(
    rows: &[Row<'_>],
    mut lines: Vec<Vec<f32>>,
    rounds: usize,
    progress: &dyn Progress,
) -> Result<Vec<Line>> {
    let n = lines.first().map_or(0, Vec::len);
    for _ in 0..rounds {
        let choices = choose_lines(rows, &lines, progress)?;
        let mut sums = vec![(vec![0.0f64; n], vec![0.0f64; n]); lines.len()];
        for (row, choice) in rows.iter().zip(&choices) {
            let &Some((k, x, _)) = choice else { continue };
            let (numerators, denominators) = &mut sums[k];
            for j in 0..n {
                let wx = row.weights.map_or(1.0, |w| f64::from(w[j])) * x;
                numerators[j] += wx * f64::from(row.values[j]);
                denominators[j] += wx * x;
            }
        }
        for (line, (numerators, denominators)) in lines.iter_mut().zip(sums) {
            let largest = denominators.iter().copied().fold(0.0, f64::max);
            let ratios = numerators.iter().zip(&denominators);
            let mut next: Vec<f32> = ratios
                .map(|(a, b)| if *b > 1e-12 * largest { (a / b) as f32 } else { 0.0 })
                .collect();
            if normalize(&mut next) {
                *line = next;
            }
        }
    }
    let mut gains = vec![0.0; lines.len()];
    for (k, _, gain) in choose_lines(rows, &lines, progress)?.into_iter().flatten() {
        gains[k] += gain;
    }
    Ok(lines.into_iter().zip(gains).map(|(atom, gain)| Line { atom, gain }).collect())
}

/// The line that a row chooses, its coefficient and what is gained.
type Choice = Option<(usize, f64, f64)>;

/// For every row the line that explains most of it beyond its spare; none if no line does.
fn choose_lines(
    rows: &[Row<'_>],
    lines: &[Vec<f32>],
    progress: &dyn Progress,
) -> Result<Vec<Choice>> {
    let squares: Vec<Vec<f32>> = lines.iter().map(|l| l.iter().map(|d| d * d).collect()).collect();
    let mut choices = vec![None; rows.len()];
    let chunks = rows.chunks(SIGNALS).zip(choices.chunks_mut(SIGNALS));
    parallel::try_for_each(chunks, |_, (rows, choices)| {
        progress.check()?;
        Arch::new().dispatch(|| {
            for (row, choice) in rows.iter().zip(choices) {
                let mut most = 0.0;
                for (k, (line, squares)) in lines.iter().zip(&squares).enumerate() {
                    let (x, explained) = row.fit(line, squares);
                    if explained - row.spare > most {
                        most = explained - row.spare;
                        *choice = Some((k, x, most));
                    }
                }
            }
        });
        Ok::<(), crate::Error>(())
    })?;
    Ok(choices)
}

/// Which atoms repeat another: of two whose absolute cosine exceeds `max_coherence` the one used less, of
/// equals the later.
pub fn duplicates(
    dictionary: &Dictionary,
    usage: &[usize],
    max_coherence: f32,
    progress: &dyn Progress,
) -> Result<Vec<bool>> {
    let k = dictionary.n_atoms();
    let gram = gram(dictionary, &by_feature(dictionary), progress)?;
    let mut by_usage: Vec<usize> = (0..k).collect();
    by_usage.sort_by_key(|&a| (std::cmp::Reverse(usage[a]), a));
    let mut repeats = vec![false; k];
    for (rank, &a) in by_usage.iter().enumerate() {
        if repeats[a] {
            continue;
        }
        for &b in &by_usage[rank + 1..] {
            if gram[a * k + b].abs() > max_coherence {
                repeats[b] = true;
            }
        }
    }
    Ok(repeats)
}

#[cfg(test)]
mod tests {
    use surfabet_base::Silent;

    use super::*;
    use crate::coded::Coded;
    use crate::signals::Signals;

    const N: usize = 4;

    /// 20 signals along each of the first three axes, coded over the diagonal of the first two, the third and nearly the
    /// third.
    fn stalled(weights: Option<&[f32]>) -> Swaps {
        let mut values = vec![0.0; 60 * N];
        let mut codes = SparseCodes::default();
        let half = 0.5f32.sqrt();
        for i in 0..60u8 {
            let (axis, x) = (usize::from(i % 3), f32::from(i) + 1.0);
            values[usize::from(i) * N + axis] = x;
            if axis < 2 {
                codes.push(&[0], &[half * x]);
            } else {
                codes.push(&[1 + u32::from(i % 2)], &[x]);
            }
        }
        let atoms = vec![half, half, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.1];
        let dictionary = Dictionary::normalized(N, atoms).unwrap();
        let signals = Signals::new(N, &values, weights).unwrap();
        let coded = Coded::new(&dictionary, &signals, codes);
        let state = State {
            dictionary: &dictionary,
            codes: &coded.codes,
            residuals: &coded.residuals,
            weights,
            errors: &coded.errors,
            budgets: &[0.0; 60],
            max_atoms: 1,
            max_coherence: 0.9,
        };
        assert_eq!(swaps(&state, 0, true, &Silent).unwrap().count, 0);
        // The residuals lie along the other diagonal; taking it up would cost as much as it gains.
        assert_eq!(swaps(&state, 9, false, &Silent).unwrap().count, 0);
        swaps(&state, 9, true, &Silent).unwrap()
    }

    #[test]
    fn an_atom_for_two_lines_is_split_where_another_is_nearly_there_twice() {
        // The last axis is not observed.
        let mask: Vec<f32> = (0..60 * N).map(|v| if v % N == 3 { 0.0 } else { 1.0 }).collect();
        for weights in [None, Some(&mask[..])] {
            let Swaps { successors, count } = stalled(weights);
            assert_eq!(count, 1);
            let (places, mut lines): (Vec<usize>, Vec<Vec<f32>>) = successors.into_iter().unzip();
            assert_eq!(places, [1, 0]);
            lines.sort_by(|a, b| b[0].abs().total_cmp(&a[0].abs()));
            assert!((lines[0][0].abs() - 1.0).abs() < 1e-6, "{lines:?}");
            assert!((lines[1][1].abs() - 1.0).abs() < 1e-6, "{lines:?}");
        }
    }
}
