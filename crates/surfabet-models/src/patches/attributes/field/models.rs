//! The adaptive models of a field, and the contexts that choose between them.
//!
//! Each decision is made by several models at once, which depend on different things: the level and how much was coded
//! around, how much the prediction changes, what was coded along the same axis beside and before. Which of them pay was
//! found on coefficients of a kitchen and of a simulated room (docs/benchmarks/patches.md).

use surfabet_entropy::{Bit, Coder, Mantissa, MixedBits, MixedContext, SInt};

use super::coefficients::Coefficients;

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

    /// Class of the signs, 0 to 4.
    fn sign(&self, axis: usize, channel: usize) -> usize {
        (self.signs[axis][channel].clamp(-2, 2) + 2) as usize
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
    /// Number of coefficients per channel.
    n: usize,
    /// Axis of each coefficient.
    axes: [usize; 7],
    /// How much the prediction changes where each coefficient is, with sign.
    changes: [[i8; N]; 7],
}

impl<const N: usize> CellContext<N> {
    /// Context of a cell: `parent` is the activity of its parent and of what lies ahead, `around` that of the cells
    /// beside it which are coded already, `beside` what these have.
    pub fn new(level: usize, parent: usize, around: usize, beside: Beside<N>) -> Self {
        let most = ACTIVITIES - 1;
        Self {
            level: level.min(LEVELS - 1),
            parent: parent.min(most),
            around: around.min(most),
            beside,
            n: 0,
            axes: [0; 7],
            changes: [[0; N]; 7],
        }
    }

    /// Sets how much the prediction changes where a coefficient is.
    pub fn set_change(&mut self, i: usize, channel: usize, class: i8) {
        self.changes[i][channel] = class;
    }

    /// Sets the axis of coefficient i of n.
    pub fn set_axis(&mut self, i: usize, axis: usize, n: usize) {
        self.axes[i] = axis;
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
}

/// What the models of a coefficient depend on beside the cell: those of the cell before it.
struct Before<const N: usize> {
    /// Sum of their sizes, each counted as 2 at most.
    size: u32,
    along: Beside<N>,
}

impl<const N: usize> Before<N> {
    fn new() -> Self {
        Self { size: 0, along: Beside::default() }
    }

    fn add(&mut self, axis: usize, channel: usize, coefficient: i32) {
        self.size += coefficient.unsigned_abs().min(2);
        self.along.add(axis, channel, coefficient);
    }
}

/// The contexts of a coefficient.
struct CoefficientContext {
    nonzero: MixedContext<5>,
    negative: MixedContext<3>,
    /// Of the first exponent; those of the next follow.
    exponent: MixedContext<2>,
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
        }
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

impl<const N: usize> Default for FieldModels<N> {
    fn default() -> Self {
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
        Self {
            mean: [const { SInt::new() }; N],
            any: MixedBits::new(any, memory, LEVELS, OF_TWO),
            nonzero: MixedBits::new(nonzero, memory, N * BEFORE, OF_FIVE),
            negative: MixedBits::new(negative, memory, N, OF_THREE),
            exponent: MixedBits::new(exponent, memory, N * EXPONENTS, OF_TWO),
            mantissa: vec![Mantissa::with_memory(memory); MAX_EXPONENT as usize + 1],
        }
    }
}

impl<const N: usize> FieldModels<N> {
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
        if !self.any.bit(coder, cell.any(), any)? {
            return Ok(Beside::default());
        }
        let mut before = Before::new();
        for (i, &axis) in cell.axes[..cell.n].iter().enumerate() {
            for c in 0..N {
                let others = std::array::from_fn(|c| coefficients[c][i]);
                let context = CoefficientContext::new(cell, &before, (i, c), others);
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
        if !self.nonzero.bit(coder, context.nonzero, wanted != 0)? {
            return Ok(0);
        }
        let negative = self.negative.bit(coder, context.negative, wanted < 0)?;
        let wanted = wanted.unsigned_abs();
        let (wanted_exponent, mut exponent) = (wanted.max(1).ilog2(), 0);
        while exponent < MAX_EXPONENT {
            let above = exponent < wanted_exponent;
            if !self.exponent.bit(coder, context.exponent(exponent), above)? {
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
        let cost = self.nonzero.cost(context.nonzero, coefficient != 0);
        if coefficient == 0 {
            return cost;
        }
        let size = coefficient.unsigned_abs();
        let exponent = size.ilog2();
        let above = (0..exponent).map(|e| self.exponent.cost(context.exponent(e), true));
        let sum: f32 = above.sum();
        let end = self.exponent.cost(context.exponent(exponent), false);
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
        self.models.any.cost(self.cell.any(), any)
    }

    /// Bits of each value of coefficient `i` of a channel; `others` are those of the same butterfly.
    pub fn coefficient(
        &self,
        (i, channel): (usize, usize),
        others: [i32; N],
    ) -> impl Fn(i32) -> f32 {
        let context = CoefficientContext::new(self.cell, &self.before, (i, channel), others);
        move |coefficient| self.models.cost(&context, coefficient)
    }

    /// Goes on to the next one.
    pub fn add(&mut self, (i, channel): (usize, usize), coefficient: i32) {
        self.before.add(self.cell.axes[i], channel, coefficient);
    }
}
