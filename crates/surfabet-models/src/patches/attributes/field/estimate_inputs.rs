//! What the estimates of a cell and of its coefficients depend on, in the order in which the networks take it.

use super::contexts::{Around, Before, CellContext, EXPONENTS};
use super::estimate_weights::{ANY, EXPONENT, NEGATIVE, NONZERO};
use super::estimates::{Sums, length};
use super::trace;

/// Inputs of the estimate of whether a cell has coefficients.
pub(super) const OF_ANY: usize = 18;

/// Those of a coefficient's that are the same for all of a cell and channel, and the others.
pub(super) const OF_CELL: usize = 16;
pub(super) const OF_COEFFICIENT: usize = 16;

/// Those of a sign's that stay when all turns round, and those that turn.
pub(super) const OF_EVEN: usize = 15;
pub(super) const OF_ODD: usize = 9;

/// Place of the exponent that is asked for.
const AT_EXPONENT: usize = 15;

/// What all estimates of a cell depend on.
fn of_all<const N: usize>(cell: &CellContext<N>) -> [i16; 9] {
    let level = |l: usize| i16::from(cell.level.min(3) == l);
    let Around { activity, ahead, behind, weight, .. } = cell.all;
    let [ahead, behind, n] = [ahead, behind, cell.n].map(|x| x as i16);
    let weight = i16::from(length(u64::from(weight)));
    [level(0), level(1), level(2), level(3), i16::from(activity), ahead, behind, n, weight]
}

/// Sizes of the changes of some channels: the largest, and their sum.
fn changes<const N: usize>(cell: &CellContext<N>, channels: std::ops::Range<usize>) -> [i16; 2] {
    let of = |i: usize| channels.clone().map(move |c| cell.change(i, c) as i16);
    let (mut largest, mut sum) = (0, 0);
    for size in (0..cell.n).flat_map(of) {
        largest = size.max(largest);
        sum += size;
    }
    [largest, sum]
}

/// Class of what was missed in some channels at the cells beside, 0 to 12: its number of binary digits.
fn missed<const N: usize>(cell: &CellContext<N>, channels: std::ops::Range<usize>) -> i16 {
    i16::from(length(cell.all.missed[channels].iter().sum()).min(12))
}

/// The estimate of whether any coefficient of a cell is not zero, and what it is of.
pub(super) fn any_estimate<const N: usize>(cell: &CellContext<N>) -> (i64, [i16; OF_ANY]) {
    let mut inputs = [0; OF_ANY];
    inputs[..9].copy_from_slice(&of_all(cell));
    inputs[9] = cell.all.n_behind as i16;
    inputs[10..12].copy_from_slice(&changes(cell, 0..1));
    inputs[12..14].copy_from_slice(&changes(cell, 1..N));
    (inputs[14], inputs[15]) = (missed(cell, 0..1), missed(cell, 1..N));
    inputs[16] = cell.beside.sum(0).min(12) as i16;
    inputs[17] = (1..N).map(|c| cell.beside.sum(c)).sum::<i32>().min(12) as i16;
    (ANY.log_odds(&ANY.begin(&inputs), &[]), inputs)
}

/// What the estimates of a cell's coefficients depend on that is the same for all in a channel, and the sums of that.
pub(super) struct CellEstimates<const N: usize> {
    of_channel: [ChannelEstimates; N],
}

struct ChannelEstimates {
    inputs: [i16; OF_CELL],
    nonzero: Sums,
    exponent: Sums,
}

impl<const N: usize> CellEstimates<N> {
    pub fn new(cell: &CellContext<N>) -> Self {
        let (of_all, missed_first) = (of_all(cell), missed(cell, 0..1));
        let of_channel = std::array::from_fn(|c| {
            let mut inputs = [0; OF_CELL];
            inputs[..9].copy_from_slice(&of_all);
            inputs[9..].copy_from_slice(&[
                missed_first,
                i16::from(c == 1),
                i16::from(c == 2),
                changes(cell, c..c + 1)[1],
                cell.beside.sum(c).min(12) as i16,
                missed(cell, c..c + 1),
                i16::from(N == 1),
            ]);
            let (nonzero, exponent) = (NONZERO.begin(&inputs), EXPONENT.begin(&inputs));
            ChannelEstimates { inputs, nonzero, exponent }
        });
        Self { of_channel }
    }

    /// Estimates of coefficient `i` of a channel; `others` are those of the same butterfly.
    pub fn of<'a>(
        &'a self,
        cell: &'a CellContext<N>,
        before: &'a Before<N>,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> Estimates<'a, N> {
        let axis = cell.axes[i];
        let of_channel = &self.of_channel[channel];
        let other = |c: usize| if c < channel { others[c] } else { 0 };
        let largest = (0..N).map(|c| cell.change(i, c)).max().unwrap_or(0);
        let last = i + 1 == cell.n;
        let inputs = [
            i16::from(axis == 1),
            i16::from(axis == 2),
            i as i16,
            i16::from(cell.weights[i]),
            cell.change(i, channel) as i16,
            cell.change(i, 0) as i16,
            largest as i16,
            cell.beside.size(axis, channel, 8) as i16,
            before.size.min(8) as i16,
            i16::from(length(u64::from(before.sizes[channel]))),
            i16::from(length(u64::from(before.sizes[0]))),
            before.along.size(axis, channel, 8) as i16,
            other(0).abs().min(3) as i16,
            other(1).abs().min(3) as i16,
            i16::from(before.size == 0 && last),
            0,
        ];
        let nonzero = NONZERO.log_odds(&of_channel.nonzero, &inputs);
        let others = [other(0), other(1)];
        Estimates { of_channel, inputs, nonzero, cell, before, at: (i, channel), others }
    }
}

/// The estimates of a coefficient.
pub(super) struct Estimates<'a, const N: usize> {
    of_channel: &'a ChannelEstimates,
    inputs: [i16; OF_COEFFICIENT],
    /// Is it not zero?
    pub nonzero: i64,
    // What the sign depends on beside, which few coefficients have.
    cell: &'a CellContext<N>,
    before: &'a Before<N>,
    at: (usize, usize),
    others: [i32; 2],
}

impl<const N: usize> Estimates<'_, N> {
    /// Is it negative?
    pub fn negative(&self) -> i64 {
        let (even, odd) = self.of_sign();
        NEGATIVE.odd_log_odds(&even, &odd)
    }

    /// What the estimate of the sign depends on: what stays when all turns round, and what turns.
    fn of_sign(&self) -> ([i16; OF_EVEN], [i16; OF_ODD]) {
        let Self { of_channel, cell, before, at: (i, channel), .. } = *self;
        let axis = cell.axes[i];
        let [first, second] = self.others.map(|q| q.clamp(-4, 4) as i16);
        let mut even = [0; OF_EVEN];
        even[..4].copy_from_slice(&of_channel.inputs[..4]);
        even[4..].copy_from_slice(&[
            i16::from(axis == 1),
            i16::from(axis == 2),
            i16::from(channel == 1),
            i16::from(channel == 2),
            i16::from(N == 1),
            i16::from(cell.weights[i]),
            first.abs(),
            second.abs(),
            cell.change(i, channel) as i16,
            i as i16,
            cell.n as i16,
        ]);
        let agreement = |k: usize| i16::from(cell.beside.agreements[k][channel].clamp(-8, 8));
        let odd = [
            i16::from(cell.changes[i][channel]),
            i16::from(cell.changes[i][0]),
            first,
            second,
            i16::from(cell.beside.signs[axis][channel]),
            i16::from(before.along.signs[axis][channel]),
            i16::from(cell.pulls[i][channel]),
            first.signum() * agreement(0),
            second.signum() * agreement(1),
        ];
        (even, odd)
    }

    /// Is its exponent above `e`?
    pub fn exponent(&self, e: u32) -> i64 {
        EXPONENT.log_odds(&self.of_channel.exponent, &self.at_exponent(e))
    }

    fn at_exponent(&self, e: u32) -> [i16; OF_COEFFICIENT] {
        let mut inputs = self.inputs;
        inputs[AT_EXPONENT] = (e as i16).min(EXPONENTS as i16 - 1);
        inputs
    }

    /// Records a coefficient for the training of the networks.
    pub fn trace(&self, coefficient: i32) {
        let of_cell = &self.of_channel.inputs;
        trace::record(trace::NONZERO, &[of_cell, &self.inputs], coefficient != 0);
        if coefficient != 0 {
            let (even, odd) = self.of_sign();
            trace::record(trace::NEGATIVE, &[&even, &odd], coefficient < 0);
            let exponent = coefficient.unsigned_abs().ilog2();
            for e in 0..=exponent.min(super::models::MAX_EXPONENT - 1) {
                trace::record(trace::EXPONENT, &[of_cell, &self.at_exponent(e)], e < exponent);
            }
        }
    }
}
