//! The adaptive models of a field, and the contexts that choose between them.
//!
//! Each decision is made by several models at once, which depend on different things: the level and how much was coded
//! around, how much the prediction changes, what was coded along the same axis beside and before. Estimates of small networks count
//! beside them (`estimates`). Which of them pay was
//! found on coefficients of a kitchen and of a simulated room (docs/benchmarks/patches.md).

use surfabet_entropy::{Bit, Coder, Mantissa, MixedBits, MixedContext, SInt};

use super::coefficients::Coefficients;
use super::estimate_weights::{ANY, EXPONENT, NONZERO};
use super::estimates::{OF_ANY, OF_COEFFICIENT, length};

/// Largest coefficient.
pub(super) const MAX_COEFFICIENT: i32 = 1 << MAX_EXPONENT;
const MAX_EXPONENT: u32 = 24;

/// Levels of the pyramid with models of their own, from the cells up.
const LEVELS: usize = 12;

/// The same where a model depends on something else as well.
const FEW_LEVELS: usize = 5;

/// Classes of how many coefficients are coded around a cell.
const ACTIVITIES: usize = 7;

/// Classes of how much the prediction changes, without its sign.
const CHANGES: usize = 7;

/// Classes of the sum of the sizes of coefficients before, each counted as 2 at most.
const BEFORE: usize = 3;

/// Exponents with models of their own.
const EXPONENTS: usize = 12;

/// Weights of two, three and five models at first, in units of 2^-16: 0.5, 0.4 and 0.3.
const OF_TWO: i32 = 32_768;
const OF_THREE: i32 = 26_214;
const OF_FIVE: i32 = 19_661;

/// The same beside an estimate, and that of the estimate: 0.2, 0.1 and 0.8. Of given coefficients of two simulated rooms and half of a
/// kitchen 0.3, 0.15 and 0.7 took 0.03 percent more bits, 0.5, 0.3 and 0.5 took 0.4 more.
const OF_TWO_BESIDE: i32 = 13_107;
const OF_FIVE_BESIDE: i32 = 6_554;
const OF_ESTIMATE: i32 = 52_429;

/// Sizes, each counted as 2 at most, and signs of the coefficients of a cell along each axis, by channel; or sums of these over
/// some cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside<const N: usize> {
    sizes: [[u8; N]; 3],
    signs: [[i8; N]; 3],
}

impl<const N: usize> Default for Beside<N> {
    fn default() -> Self {
        Self { sizes: [[0; N]; 3], signs: [[0; N]; 3] }
    }
}

impl<const N: usize> Beside<N> {
    /// What lies beside a cell across each axis: `below` are the cells one down along each, and what those along the
    /// other two axes have along an axis goes on in the cell.
    pub fn along(below: [Option<&Self>; 3]) -> Self {
        let mut sum = Self::default();
        for (b, other) in below.iter().enumerate() {
            let Some(other) = other else { continue };
            for axis in (0..3).filter(|&axis| axis != b) {
                for c in 0..N {
                    // At most 4 coefficients along an axis, of two cells: 16 and 8.
                    sum.sizes[axis][c] += other.sizes[axis][c];
                    sum.signs[axis][c] += other.signs[axis][c];
                }
            }
        }
        sum
    }

    fn add(&mut self, axis: usize, channel: usize, coefficient: i32) {
        self.sizes[axis][channel] += coefficient.unsigned_abs().min(2) as u8;
        self.signs[axis][channel] += coefficient.signum() as i8;
    }

    /// Class of the sizes, 0 to `most`.
    fn size(&self, axis: usize, channel: usize, most: u8) -> usize {
        usize::from(self.sizes[axis][channel].min(most))
    }

    /// Sum of the sizes of a channel.
    fn sum(&self, channel: usize) -> i32 {
        self.sizes.iter().map(|of_axis| i32::from(of_axis[channel])).sum()
    }

    /// Class of the signs, 0 to 4.
    fn sign(&self, axis: usize, channel: usize) -> usize {
        (self.signs[axis][channel].clamp(-2, 2) + 2) as usize
    }
}

/// What estimates depend on beside the models' contexts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around<const N: usize> {
    /// Activity of the cell at the level above.
    pub activity: u8,
    /// Sum of that of the cells that lie ahead, and of those beside that are coded.
    pub ahead: usize,
    pub behind: usize,
    /// Number of these.
    pub n_behind: usize,
    /// Cells of the first level in the cell.
    pub weight: u32,
    /// What was missed at the children of the cells beside that are coded, in eighths of a step, by channel.
    pub missed: [u64; N],
}

impl<const N: usize> Default for Around<N> {
    fn default() -> Self {
        Self { activity: 0, ahead: 0, behind: 0, n_behind: 0, weight: 0, missed: [0; N] }
    }
}

/// What the models of a cell depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellContext<const N: usize> {
    /// Level of the children in the pyramid.
    pub level: usize,
    parent: usize,
    around: usize,
    beside: Beside<N>,
    all: Around<N>,
    /// Number of coefficients per channel.
    n: usize,
    /// Axis of each coefficient, and the class of the weights of its two slots.
    axes: [usize; 7],
    weights: [u8; 7],
    /// How much the prediction changes where each coefficient is, with sign.
    changes: [[i8; N]; 7],
}

impl<const N: usize> CellContext<N> {
    /// Context of a cell: what is around it, and what the cells beside it have which are coded already.
    pub fn new(level: usize, all: Around<N>, beside: Beside<N>) -> Self {
        let most = ACTIVITIES - 1;
        let parent = usize::from(all.activity) + all.ahead.div_ceil(2);
        Self {
            level: level.min(LEVELS - 1),
            parent: parent.min(most),
            around: all.behind.min(most),
            beside,
            all,
            n: 0,
            axes: [0; 7],
            weights: [0; 7],
            changes: [[0; N]; 7],
        }
    }

    /// Sets how much the prediction changes where a coefficient is.
    pub fn set_change(&mut self, i: usize, channel: usize, class: i8) {
        self.changes[i][channel] = class;
    }

    /// Sets the axis of coefficient i of n, and the class of the weights of its two slots.
    pub fn set_axis(&mut self, i: usize, axis: usize, weights: u8, n: usize) {
        self.axes[i] = axis;
        self.weights[i] = weights;
        self.n = n;
    }

    fn change(&self, i: usize, channel: usize) -> usize {
        usize::from(self.changes[i][channel].unsigned_abs())
    }

    /// Context of whether any coefficient of the cell is not zero.
    fn any(&self) -> MixedContext<2> {
        let largest = |channels: std::ops::Range<usize>| {
            let all = (0..self.n).flat_map(|i| channels.clone().map(move |c| self.change(i, c)));
            all.max().unwrap_or(0)
        };
        let activity = (self.level * ACTIVITIES + self.parent) * ACTIVITIES + self.around;
        let changes = (self.level * CHANGES + largest(0..1)) * CHANGES + largest(1..N);
        MixedContext { mixer: self.level, models: [activity, changes] }
    }

    /// What all estimates of the cell depend on.
    fn inputs(&self) -> [i32; 9] {
        let level = |l: usize| i32::from(self.level.min(3) == l);
        let Around { activity, ahead, behind, weight, .. } = self.all;
        let [ahead, behind, n] = [ahead, behind, self.n].map(|x| x as i32);
        let weight = i32::from(length(u64::from(weight)));
        [level(0), level(1), level(2), level(3), i32::from(activity), ahead, behind, n, weight]
    }

    /// Sizes of the changes of some channels: the largest, and their sum.
    fn changes(&self, channels: std::ops::Range<usize>) -> [i32; 2] {
        let all = (0..self.n).flat_map(|i| channels.clone().map(move |c| self.change(i, c) as i32));
        [all.clone().max().unwrap_or(0), all.sum()]
    }

    /// Class of what was missed in some channels at the cells beside, 0 to 12: its number of binary digits.
    fn missed(&self, channels: std::ops::Range<usize>) -> i32 {
        i32::from(length(self.all.missed[channels].iter().sum()).min(12))
    }

    /// The estimate of whether any coefficient of the cell is not zero.
    fn any_estimate(&self) -> i64 {
        let mut inputs = [0; OF_ANY];
        inputs[..9].copy_from_slice(&self.inputs());
        inputs[9] = self.all.n_behind as i32;
        inputs[10..12].copy_from_slice(&self.changes(0..1));
        inputs[12..14].copy_from_slice(&self.changes(1..N));
        (inputs[14], inputs[15]) = (self.missed(0..1), self.missed(1..N));
        inputs[16] = self.beside.sum(0).min(12);
        inputs[17] = (1..N).map(|c| self.beside.sum(c)).sum::<i32>().min(12);
        ANY.log_odds(&inputs)
    }
}

/// What the models of a coefficient depend on beside the cell: those of the cell before it.
struct Before<const N: usize> {
    /// Sum of their sizes, each counted as 2 at most.
    size: u32,
    /// Sum of their sizes, by channel; at most 2^27.
    sizes: [u32; N],
    along: Beside<N>,
}

impl<const N: usize> Before<N> {
    fn new() -> Self {
        Self { size: 0, sizes: [0; N], along: Beside::default() }
    }

    fn add(&mut self, axis: usize, channel: usize, coefficient: i32) {
        self.size += coefficient.unsigned_abs().min(2);
        self.sizes[channel] += coefficient.unsigned_abs();
        self.along.add(axis, channel, coefficient);
    }
}

/// The contexts of a coefficient.
struct CoefficientContext {
    nonzero: MixedContext<5>,
    negative: MixedContext<3>,
    /// Of the first exponent; those of the next follow.
    exponent: MixedContext<2>,
    /// What estimates depend on, where there are any, and that of whether it is not zero.
    inputs: Option<[i32; OF_COEFFICIENT]>,
    estimate: i64,
}

impl CoefficientContext {
    /// Contexts of coefficient `i` of a channel; `others` are those of the same butterfly.
    fn new<const N: usize>(
        cell: &CellContext<N>,
        before: &Before<N>,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> Self {
        // Mixed radix: (digit, base), the first the most significant.
        let number = |digits: &[(usize, usize)]| {
            digits.iter().fold(channel, |all, &(digit, base)| all * base + digit)
        };
        let axis = cell.axes[i];
        let level = (cell.level, LEVELS);
        let few = |most: usize| (cell.level.min(most - 1), most);
        let size = (before.size.min(2) as usize, BEFORE);
        let change = cell.change(i, channel);
        // Channels before this one, at the same butterfly: luma, and the first of two chromas.
        let other = |c: usize| if c < channel { others[c] } else { 0 };
        let size_of = |c: usize| (other(c).unsigned_abs().min(2) as usize, 3);
        let sign_of = |c: usize| ((other(c).signum() + 1) as usize, 3);
        let nonzero = [
            number(&[level, size]),
            number(&[few(FEW_LEVELS), (axis, 3), (change, CHANGES)]),
            number(&[few(FEW_LEVELS), size_of(0), size_of(1), (before.size.min(3) as usize, 4)]),
            number(&[
                (axis, 3),
                (cell.beside.size(axis, channel, 4), 5),
                (before.along.size(axis, channel, 3), 4),
            ]),
            number(&[(cell.n - 1 - i, 7), (cell.n, 8), size]),
        ];
        let signed = (i32::from(cell.changes[i][channel]) + CHANGES as i32 - 1) as usize;
        let negative = [
            number(&[(signed, 2 * CHANGES - 1)]),
            number(&[sign_of(0), sign_of(1)]),
            number(&[(cell.beside.sign(axis, channel), 5), (before.along.sign(axis, channel), 5)]),
        ];
        let exponent = [
            number(&[level, size, (0, EXPONENTS)]),
            number(&[few(4), (change, CHANGES), (0, EXPONENTS)]),
        ];
        Self {
            nonzero: MixedContext { mixer: number(&[size]), models: nonzero },
            negative: MixedContext { mixer: channel, models: negative },
            exponent: MixedContext { mixer: number(&[(0, EXPONENTS)]), models: exponent },
            inputs: None,
            estimate: 0,
        }
    }

    /// The same with estimates.
    fn with_estimates<const N: usize>(
        self,
        cell: &CellContext<N>,
        before: &Before<N>,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> Self {
        let mut inputs = [0; OF_COEFFICIENT];
        inputs[..9].copy_from_slice(&cell.inputs());
        let axis = cell.axes[i];
        let other = |c: usize| if c < channel { others[c].abs().min(3) } else { 0 };
        let [_, sum_of_changes] = cell.changes(channel..channel + 1);
        inputs[9..].copy_from_slice(&[
            i32::from(axis == 1),
            i32::from(axis == 2),
            i32::from(channel == 1),
            i32::from(channel == 2),
            i as i32,
            i32::from(cell.weights[i]),
            cell.change(i, channel) as i32,
            cell.change(i, 0) as i32,
            sum_of_changes,
            i32::from(cell.beside.sizes[axis][channel].min(8)),
            cell.beside.sum(channel).min(12),
            before.size.min(8) as i32,
            i32::from(length(u64::from(before.sizes[channel]))),
            i32::from(before.along.sizes[axis][channel].min(8)),
            other(0),
            other(1),
            cell.missed(channel..channel + 1),
            cell.missed(0..1),
            // The exponent that is asked for, when it is.
            0,
            i32::from(before.size == 0 && i + 1 == cell.n),
        ]);
        Self { inputs: Some(inputs), estimate: NONZERO.log_odds(&inputs), ..self }
    }

    /// The estimate of whether the exponent is above `e`.
    fn exponent_estimate(&self, e: u32) -> i64 {
        self.inputs.map_or(0, |mut inputs| {
            inputs[OF_COEFFICIENT - 2] = (e as i32).min(EXPONENTS as i32 - 1);
            EXPONENT.log_odds(&inputs)
        })
    }

    /// Context of whether the exponent is above `e`.
    fn exponent(&self, e: u32) -> MixedContext<2> {
        let e = (e as usize).min(EXPONENTS - 1);
        let MixedContext { mixer, models } = self.exponent;
        MixedContext { mixer: mixer + e, models: models.map(|of| of + e) }
    }
}

/// Adaptive models of a field of N channels.
#[derive(Debug, Clone)]
pub(super) struct FieldModels<const N: usize> {
    /// Whether estimates count beside the models.
    with_estimates: bool,
    /// Mean of all cells, by channel.
    pub mean: [SInt; N],
    /// Is any coefficient of the cell not zero?
    any: MixedBits<2>,
    /// Is a coefficient not zero?
    nonzero: MixedBits<5>,
    negative: MixedBits<3>,
    /// Is the exponent of its size, `floor(log2)`, above another?
    exponent: MixedBits<2>,
    /// The bits of the size below the highest, by exponent.
    mantissa: Vec<Mantissa>,
}

impl<const N: usize> FieldModels<N> {
    /// Models that know nothing, with estimates or without.
    pub fn new(with_estimates: bool) -> Self {
        let beside = |weight: i32, beside: i32| if with_estimates { beside } else { weight };
        let of_estimate = beside(0, OF_ESTIMATE);
        let [of_two, of_five] = [beside(OF_TWO, OF_TWO_BESIDE), beside(OF_FIVE, OF_FIVE_BESIDE)];
        let memory = Bit::MAX_MEMORY;
        let any = [LEVELS * ACTIVITIES * ACTIVITIES, LEVELS * CHANGES * CHANGES];
        let nonzero = [
            N * LEVELS * BEFORE,
            N * FEW_LEVELS * 3 * CHANGES,
            N * FEW_LEVELS * 3 * 3 * 4,
            N * 3 * 5 * 4,
            N * 7 * 8 * BEFORE,
        ];
        let negative = [N * (2 * CHANGES - 1), N * 3 * 3, N * 5 * 5];
        let exponent = [N * LEVELS * BEFORE * EXPONENTS, N * 4 * CHANGES * EXPONENTS];
        let nonzero = MixedBits::new(nonzero, memory, N * BEFORE, of_five);
        let exponent = MixedBits::new(exponent, memory, N * EXPONENTS, of_two);
        Self {
            with_estimates,
            mean: [const { SInt::new() }; N],
            any: MixedBits::new(any, memory, LEVELS, of_two).with_given(of_estimate),
            nonzero: nonzero.with_given(of_estimate),
            negative: MixedBits::new(negative, memory, N, OF_THREE),
            exponent: exponent.with_given(of_estimate),
            mantissa: vec![Mantissa::with_memory(memory); MAX_EXPONENT as usize + 1],
        }
    }

    /// The estimate of whether any coefficient of a cell is not zero; 0 without.
    fn any_estimate(&self, cell: &CellContext<N>) -> i64 {
        if self.with_estimates { cell.any_estimate() } else { 0 }
    }

    /// Contexts of coefficient `i` of a channel; `others` are those of the same butterfly.
    fn context(
        &self,
        cell: &CellContext<N>,
        before: &Before<N>,
        at: (usize, usize),
        others: [i32; N],
    ) -> CoefficientContext {
        let context = CoefficientContext::new(cell, before, at, others);
        match self.with_estimates {
            true => context.with_estimates(cell, before, at, others),
            false => context,
        }
    }

    /// Writes, reads or prices the coefficients of a cell: whether any is not zero, then all, channel by channel within
    /// each butterfly. Gives what the contexts of the cells beside it depend on.
    ///
    /// # Errors
    /// Whatever the coder finds wrong with what it reads.
    pub fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        cell: &CellContext<N>,
        coefficients: &mut Coefficients<N>,
    ) -> Result<Beside<N>, C::Error> {
        let any = coefficients.iter().flatten().any(|&c| c != 0);
        let estimate = self.any_estimate(cell);
        if !self.any.bit_given(coder, cell.any(), estimate, any)? {
            return Ok(Beside::default());
        }
        let mut before = Before::new();
        for (i, &axis) in cell.axes[..cell.n].iter().enumerate() {
            for c in 0..N {
                let others = std::array::from_fn(|c| coefficients[c][i]);
                let context = self.context(cell, &before, (i, c), others);
                let coded = self.coefficient(coder, &context, coefficients[c][i])?;
                coefficients[c][i] = coded;
                before.add(axis, c, coded);
            }
        }
        Ok(before.along)
    }

    fn coefficient<C: Coder>(
        &mut self,
        coder: &mut C,
        context: &CoefficientContext,
        wanted: i32,
    ) -> Result<i32, C::Error> {
        if !self.nonzero.bit_given(coder, context.nonzero, context.estimate, wanted != 0)? {
            return Ok(0);
        }
        let negative = self.negative.bit(coder, context.negative, wanted < 0)?;
        let wanted = wanted.unsigned_abs();
        let (wanted_exponent, mut exponent) = (wanted.max(1).ilog2(), 0);
        while exponent < MAX_EXPONENT {
            let above = exponent < wanted_exponent;
            let (at, estimate) = (context.exponent(exponent), context.exponent_estimate(exponent));
            if !self.exponent.bit_given(coder, at, estimate, above)? {
                break;
            }
            exponent += 1;
        }
        let size =
            1_u32 << exponent | self.mantissa[exponent as usize].code(coder, wanted, exponent)?;
        // Below 2^25, then at most 2^24.
        let size = (size as i32).min(MAX_COEFFICIENT);
        Ok(if negative { -size } else { size })
    }

    /// Bits that a coefficient takes now.
    fn cost(&self, context: &CoefficientContext, coefficient: i32) -> f32 {
        let cost = self.nonzero.cost_given(context.nonzero, context.estimate, coefficient != 0);
        if coefficient == 0 {
            return cost;
        }
        let size = coefficient.unsigned_abs();
        let exponent = size.ilog2();
        let at = |e: u32, above: bool| {
            self.exponent.cost_given(context.exponent(e), context.exponent_estimate(e), above)
        };
        let sum: f32 = (0..exponent).map(|e| at(e, true)).sum();
        let end = at(exponent, false);
        let cost = cost + self.negative.cost(context.negative, coefficient < 0) + sum + end;
        cost + self.mantissa[exponent as usize].cost(size, exponent)
    }
}

/// The prices of the coefficients of a cell, one after another.
pub(super) struct Prices<'a, const N: usize> {
    models: &'a FieldModels<N>,
    cell: &'a CellContext<N>,
    before: Before<N>,
}

impl<'a, const N: usize> Prices<'a, N> {
    pub fn new(models: &'a FieldModels<N>, cell: &'a CellContext<N>) -> Self {
        Self { models, cell, before: Before::new() }
    }

    /// Bits of whether any coefficient is not zero.
    pub fn any(&self, any: bool) -> f32 {
        self.models.any.cost_given(self.cell.any(), self.models.any_estimate(self.cell), any)
    }

    /// Bits of each value of coefficient `i` of a channel; `others` are those of the same butterfly.
    pub fn coefficient(
        &self,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> impl Fn(i32) -> f32 {
        let context = self.models.context(self.cell, &self.before, (i, channel), others);
        move |coefficient| self.models.cost(&context, coefficient)
    }

    /// Goes on to the next one.
    pub fn add(&mut self, (i, channel): (usize, usize), coefficient: i32) {
        self.before.add(self.cell.axes[i], channel, coefficient);
    }
}
