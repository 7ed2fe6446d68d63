//! The adaptive models of a field.
//!
//! Each decision is made by several models at once, which depend on different things: the level and how much was coded
//! around, how much the prediction changes, what was coded along the same axis beside and before. Estimates of small networks count
//! beside them (`estimates`). Which of them pay was
//! found on coefficients of a kitchen and of a simulated room (docs/benchmarks/patches.md).

use surfabet_entropy::{Bit, Coder, Mantissa, MixedBits, SInt};

use super::coefficients::Coefficients;
use super::contexts::{
    ACTIVITIES, BEFORE, Before, Beside, CHANGES, CellContext, CoefficientContext, EXPONENTS,
    FEW_LEVELS, LEVELS,
};
use super::estimate_inputs::{CellEstimates, Estimates, any_estimate};
use super::trace;

/// Largest coefficient.
pub(super) const MAX_COEFFICIENT: i32 = 1 << MAX_EXPONENT;
pub(super) const MAX_EXPONENT: u32 = 24;

/// Weights of two, three and five models at first, in units of 2^-16: 0.5, 0.4 and 0.3.
const OF_TWO: i32 = 32_768;
const OF_THREE: i32 = 26_214;
const OF_FIVE: i32 = 19_661;

/// The same beside an estimate, and that of the estimate: 0.2, 0.2, 0.1 and 0.8. Of given coefficients of two simulated rooms and half of
/// a kitchen, without estimates of signs, 0.3, 0.15 and 0.7 in place of 0.2, 0.1 and 0.8 took 0.03 percent more bits, 0.5, 0.3 and 0.5
/// took 0.4 more.
const OF_TWO_BESIDE: i32 = 13_107;
const OF_THREE_BESIDE: i32 = 13_107;
const OF_FIVE_BESIDE: i32 = 6_554;
const OF_ESTIMATE: i32 = 52_429;

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
        let of_two = beside(OF_TWO, OF_TWO_BESIDE);
        let of_three = beside(OF_THREE, OF_THREE_BESIDE);
        let of_five = beside(OF_FIVE, OF_FIVE_BESIDE);
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
        let negative = MixedBits::new(negative, memory, N, of_three);
        let exponent = MixedBits::new(exponent, memory, N * EXPONENTS, of_two);
        Self {
            with_estimates,
            mean: [const { SInt::new() }; N],
            any: MixedBits::new(any, memory, LEVELS, of_two).with_given(of_estimate),
            nonzero: nonzero.with_given(of_estimate),
            negative: negative.with_given(of_estimate),
            exponent: exponent.with_given(of_estimate),
            mantissa: vec![Mantissa::with_memory(memory); MAX_EXPONENT as usize + 1],
        }
    }

    /// The estimate of whether any coefficient of a cell is not zero; 0 without.
    fn any_estimate(&self, cell: &CellContext<N>) -> i64 {
        if self.with_estimates { any_estimate(cell).0 } else { 0 }
    }

    /// What the estimates of the cell's coefficients have in common, where there are any.
    fn estimates(&self, cell: &CellContext<N>) -> Option<CellEstimates<N>> {
        self.with_estimates.then(|| CellEstimates::new(cell))
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
        let any = self.any.bit_given(coder, cell.any(), estimate, any)?;
        if cfg!(feature = "trace") && self.with_estimates {
            trace::record(trace::ANY, &[&any_estimate(cell).1], any);
        }
        if !any {
            return Ok(Beside::default());
        }
        let estimates = self.estimates(cell);
        let mut before = Before::new();
        for (i, &axis) in cell.axes[..cell.n].iter().enumerate() {
            for c in 0..N {
                let others = std::array::from_fn(|c| coefficients[c][i]);
                let context = CoefficientContext::new(cell, &before, (i, c), others);
                let of = estimates.as_ref().map(|of| of.of(cell, &before, (i, c), others));
                let coded = self.coefficient(coder, &context, of.as_ref(), coefficients[c][i])?;
                if cfg!(feature = "trace") {
                    of.iter().for_each(|of| of.trace(coded));
                }
                coefficients[c][i] = coded;
                before.add(axis, c, coded, others);
            }
        }
        Ok(before.along)
    }

    fn coefficient<C: Coder>(
        &mut self,
        coder: &mut C,
        context: &CoefficientContext,
        estimates: Option<&Estimates<'_, N>>,
        wanted: i32,
    ) -> Result<i32, C::Error> {
        let given = estimates.map_or(0, |of| of.nonzero);
        if !self.nonzero.bit_given(coder, context.nonzero, given, wanted != 0)? {
            return Ok(0);
        }
        let given = estimates.map_or(0, Estimates::negative);
        let negative = self.negative.bit_given(coder, context.negative, given, wanted < 0)?;
        let wanted = wanted.unsigned_abs();
        let (wanted_exponent, mut exponent) = (wanted.max(1).ilog2(), 0);
        while exponent < MAX_EXPONENT {
            let above = exponent < wanted_exponent;
            let given = estimates.map_or(0, |of| of.exponent(exponent));
            if !self.exponent.bit_given(coder, context.exponent(exponent), given, above)? {
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
    fn cost(
        &self,
        context: &CoefficientContext,
        estimates: Option<&Estimates<'_, N>>,
        coefficient: i32,
    ) -> f32 {
        let given = estimates.map_or(0, |of| of.nonzero);
        let cost = self.nonzero.cost_given(context.nonzero, given, coefficient != 0);
        if coefficient == 0 {
            return cost;
        }
        let size = coefficient.unsigned_abs();
        let exponent = size.ilog2();
        let at = |e: u32, above: bool| {
            let given = estimates.map_or(0, |of| of.exponent(e));
            self.exponent.cost_given(context.exponent(e), given, above)
        };
        let sum: f32 = (0..exponent).map(|e| at(e, true)).sum();
        let end = at(exponent, false);
        let given = estimates.map_or(0, Estimates::negative);
        let negative = self.negative.cost_given(context.negative, given, coefficient < 0);
        cost + negative + sum + end + self.mantissa[exponent as usize].cost(size, exponent)
    }
}

/// The prices of the coefficients of a cell, one after another.
pub(super) struct Prices<'a, const N: usize> {
    models: &'a FieldModels<N>,
    cell: &'a CellContext<N>,
    estimates: Option<CellEstimates<N>>,
    before: Before<N>,
}

impl<'a, const N: usize> Prices<'a, N> {
    pub fn new(models: &'a FieldModels<N>, cell: &'a CellContext<N>) -> Self {
        Self { models, cell, estimates: models.estimates(cell), before: Before::new() }
    }

    /// Bits of whether any coefficient is not zero.
    pub fn any(&self, any: bool) -> f32 {
        self.models.any.cost_given(self.cell.any(), self.models.any_estimate(self.cell), any)
    }

    /// Bits of each value of coefficient `i` of a channel; `others` are those of the same butterfly.
    pub fn coefficient(&self, at: (usize, usize), others: [i32; N]) -> impl Fn(i32) -> f32 {
        let context = CoefficientContext::new(self.cell, &self.before, at, others);
        let estimates = self.estimates.as_ref();
        let estimates = estimates.map(|of| of.of(self.cell, &self.before, at, others));
        move |coefficient| self.models.cost(&context, estimates.as_ref(), coefficient)
    }

    /// Goes on to the next one; `others` are those of the same butterfly.
    pub fn add(&mut self, (i, channel): (usize, usize), coefficient: i32, others: [i32; N]) {
        self.before.add(self.cell.axes[i], channel, coefficient, others);
    }
}
