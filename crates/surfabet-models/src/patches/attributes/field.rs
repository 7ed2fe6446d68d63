//! A field of values on cells: a region-adaptive hierarchical transform with prediction from coarser cells.
//!
//! The cells are joined by eights up to one. Going down again, the means of the parents around a cell are interpolated,
//! which predicts its children; the residual is transformed by the butterflies of the region-adaptive hierarchical
//! transform (R. L. de Queiroz, P. A. Chou: *Compression of 3D Point Clouds Using a Region-Adaptive Hierarchical
//! Transform*, 2016), orthonormal for any set of cells, and rounded. Where no coefficient is coded the field is smooth,
//! not blocky.

use std::ops::Range;

use surfabet_entropy::Coder;
use surfabet_geom::morton::{MortonMap, step};

use super::butterflies::Butterflies;
use super::cells::index;
use super::choice::choose;
use super::models::{CellContext, FieldModels};
use super::prediction::Prediction;
use super::pyramid::{PyramidLevel, predict, pyramid};

/// Coefficients of the butterflies of a cell, by channel.
pub(super) type Coefficients<const N: usize> = [[i32; 7]; N];

/// Largest coefficient.
pub(super) const MAX_COEFFICIENT: i32 = 1 << 24;

/// How a field is predicted and rounded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps<const N: usize> {
    /// Rounding of the coefficients of each channel, for values times the root of the number of cells.
    pub of_channels: [f32; N],
    pub prediction: Prediction,
}

impl<const N: usize> Steps<N> {
    /// Step of a channel at a level of the pyramid.
    pub fn of(self, channel: usize, level: usize) -> f32 {
        self.of_channels[channel] * self.prediction.step_share(level)
    }
}

/// Where the coefficients come from.
#[derive(Debug, Clone, Copy)]
pub(super) enum FieldSource<'a, const N: usize> {
    /// The coder.
    Stream,
    /// A model: N times the number of cells, of which the first N are the mean.
    Model(&'a [i32]),
    /// The values that each cell should have; coefficients of least cost are chosen.
    Targets {
        values: &'a [[f32; N]],
        /// Squared error that a bit must save.
        lambda: f32,
    },
}

/// Values of the cells, and the coefficients that give them.
pub(super) struct CellValues<const N: usize> {
    pub values: Vec<[f32; N]>,
    pub coefficients: Vec<i32>,
}

/// Writes, reads or prices a field of N channels on sorted `cells`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(super) fn code_field<C: Coder, const N: usize>(
    coder: &mut C,
    cells: &[u64],
    steps: Steps<N>,
    source: FieldSource<'_, N>,
) -> Result<CellValues<N>, C::Error> {
    if cells.is_empty() {
        return Ok(CellValues { values: Vec::new(), coefficients: Vec::new() });
    }
    let targets = match source {
        FieldSource::Targets { values, .. } => Some(values),
        _ => None,
    };
    let levels = pyramid(cells, targets);
    let top = levels.len() - 1;
    let coefficients = Vec::with_capacity(N * cells.len());
    let mut walk = Walk { coder, models: FieldModels::default(), steps, source, coefficients };
    let mut means = vec![walk.mean(&levels[top])?];
    let mut activity = vec![0_u8];
    for l in (0..top).rev() {
        let (parents, children) = (&levels[l + 1], &levels[l]);
        let mut decoded = predict(parents, &means, children, steps.prediction.neighbour_share());
        let active = walk.level(l, parents, children, &means, &activity, &mut decoded)?;
        activity = parents.for_children(&active);
        means = decoded;
    }
    Ok(CellValues { values: means, coefficients: walk.coefficients })
}

/// The walk down the pyramid.
struct Walk<'a, C, const N: usize> {
    coder: &'a mut C,
    models: FieldModels<N>,
    steps: Steps<N>,
    source: FieldSource<'a, N>,
    /// All coefficients so far.
    coefficients: Vec<i32>,
}

/// A cell with at least two children.
struct Children<'a, const N: usize> {
    /// Octants of the children in the cell.
    octants: Vec<usize>,
    weights: &'a [f32],
    targets: Option<&'a [[f32; N]]>,
    /// Decoded mean of the cell.
    mean: [f32; N],
}

impl<C: Coder, const N: usize> Walk<'_, C, N> {
    /// Mean of all cells, rounded to whole numbers.
    fn mean(&mut self, top: &PyramidLevel<'_, N>) -> Result<[f32; N], C::Error> {
        let mut mean = [0.0; N];
        for (c, value) in mean.iter_mut().enumerate() {
            let wanted = match self.source {
                FieldSource::Stream => 0,
                FieldSource::Model(coefficients) => coefficients[c],
                FieldSource::Targets { .. } => top.targets[0][c].round() as i32,
            };
            let coded = self.coder.sint(&mut self.models.mean[c], wanted)?;
            self.coefficients.push(coded);
            *value = coded as f32;
        }
        Ok(mean)
    }

    /// Adds the coefficients of a level to its prediction in `decoded`. `means` and `activity` are those of the parents;
    /// gives the activity of each cell at this level, 0 to 4: the sum of the magnitudes of its coefficients.
    fn level(
        &mut self,
        l: usize,
        parents: &PyramidLevel<'_, N>,
        children: &PyramidLevel<'_, N>,
        means: &[[f32; N]],
        activity: &[u8],
        decoded: &mut [[f32; N]],
    ) -> Result<Vec<u8>, C::Error> {
        let places = index(&parents.keys);
        let mut active = vec![0_u8; parents.keys.len()];
        let mut missed = Missed::new(self.steps.prediction, children.keys.len());
        for (p, range) in parents.children().enumerate() {
            let key = parents.keys[p];
            missed.begin(range.clone(), decoded);
            if range.len() == 1 {
                decoded[range.start] = means[p];
                active[p] = activity[p].saturating_sub(1);
            } else {
                let family = |key: u64| places.get(&key).map(|&p| parents.children_of(p as usize));
                missed.add_beside(key, family, children, range.clone(), decoded);
                // Cells before this one are coded at this level, of those that follow only the level above is.
                let around = sum_beside(&places, key, false, &active);
                let ahead = sum_beside(&places, key, true, activity);
                let parent = usize::from(activity[p]) + ahead.div_ceil(2);
                let context = CellContext::new(l, parent, around);
                let cell = Children::new(children, range.clone(), means[p]);
                active[p] = self.cell(&context, &cell, &mut decoded[range.clone()])?;
            }
            missed.end(range, decoded);
        }
        Ok(active)
    }

    /// Adds the coefficients of a cell to the prediction of its children; gives its activity.
    fn cell(
        &mut self,
        context: &CellContext,
        cell: &Children<'_, N>,
        decoded: &mut [[f32; N]],
    ) -> Result<u8, C::Error> {
        let butterflies = Butterflies::new(&cell.octants, cell.weights);
        let n = butterflies.all().len();
        let mut coefficients = match self.source {
            FieldSource::Stream => [[0; 7]; N],
            FieldSource::Model(given) => {
                let mut coefficients = [[0; 7]; N];
                let from = self.coefficients.len();
                for (i, of) in given[from..from + N * n].chunks(N).enumerate() {
                    (0..N).for_each(|c| coefficients[c][i] = of[c]);
                }
                coefficients
            }
            FieldSource::Targets { lambda, .. } => {
                let residuals = cell.residuals(&butterflies, decoded);
                choose(&self.models, context, &butterflies, &residuals, self.steps, lambda)
            }
        };
        code_coefficients(self.coder, &mut self.models, context, n, &mut coefficients)?;
        for i in 0..n {
            self.coefficients.extend(coefficients.iter().map(|of| of[i]));
        }
        let steps = std::array::from_fn(|c| self.steps.of(c, context.level));
        cell.add(&butterflies, &coefficients, steps, decoded);
        let sum: u32 = coefficients.iter().flatten().map(|c| c.unsigned_abs().min(4)).sum();
        Ok(sum.min(4) as u8)
    }
}

/// What the prediction from the parents missed at the cells of a level that are coded already.
struct Missed<const N: usize> {
    /// The share of it that is added beside each; `None` for nothing.
    share: Option<f32>,
    /// By cell; empty where nothing is added.
    values: Vec<[f32; N]>,
}

impl<const N: usize> Missed<N> {
    fn new(prediction: Prediction, cells: usize) -> Self {
        let share = prediction.residual_share();
        Self { share, values: vec![[0.0; N]; share.map_or(0, |_| cells)] }
    }

    /// Adds its share of what was missed beside them to the predictions of the children `range` of the cell of `key`. Of
    /// the cells that share a face with a child those of smaller coordinates in other parents are coded: those parents'
    /// keys are smaller. `family` gives the children of a cell of this key.
    fn add_beside(
        &self,
        key: u64,
        family: impl Fn(u64) -> Option<Range<usize>>,
        children: &PyramidLevel<'_, N>,
        range: Range<usize>,
        predicted: &mut [[f32; N]],
    ) {
        let Some(share) = self.share else { return };
        for axis in 0..3 {
            let Some(beside) = family(step(key, axis, false)) else { continue };
            for i in range.clone().filter(|&i| children.keys[i] >> axis & 1 == 0) {
                let octant = children.keys[i] & 7 | 1 << axis;
                if let Some(j) = beside.clone().find(|&j| children.keys[j] & 7 == octant) {
                    (0..N).for_each(|c| predicted[i][c] += share * self.values[j][c]);
                }
            }
        }
    }

    /// Keeps what the parents predict of the cells `range`, until they are coded.
    fn begin(&mut self, range: Range<usize>, predicted: &[[f32; N]]) {
        if self.share.is_some() {
            self.values[range.clone()].copy_from_slice(&predicted[range]);
        }
    }

    /// Keeps what was missed at the cells `range`: their values less what the parents predicted.
    fn end(&mut self, range: Range<usize>, decoded: &[[f32; N]]) {
        if self.share.is_some() {
            for i in range {
                let predicted = self.values[i];
                self.values[i] = std::array::from_fn(|c| decoded[i][c] - predicted[c]);
            }
        }
    }
}

/// Sum of the activities of the three cells beside the one of `key`, up or down the axes.
fn sum_beside(places: &MortonMap<u32>, key: u64, up: bool, activity: &[u8]) -> usize {
    (0..3)
        .filter_map(|axis| places.get(&step(key, axis, up)))
        .map(|&i| usize::from(activity[i as usize]))
        .sum()
}

impl<'a, const N: usize> Children<'a, N> {
    /// The children `range` of a cell with this mean.
    fn new(level: &'a PyramidLevel<'_, N>, range: Range<usize>, mean: [f32; N]) -> Self {
        Self {
            octants: level.keys[range.clone()].iter().map(|k| (k & 7) as usize).collect(),
            weights: &level.weights[range.clone()],
            targets: level.targets.get(range),
            mean,
        }
    }

    /// The transform of what the prediction misses, by channel; in the slots of the butterflies.
    fn residuals(&self, butterflies: &Butterflies, predicted: &[[f32; N]]) -> [[f32; 8]; N] {
        let mut residuals = [[0.0_f32; 8]; N];
        let targets = self.targets.unwrap_or(&[]);
        for (i, (&octant, target)) in self.octants.iter().zip(targets).enumerate() {
            let root = self.weights[i].sqrt();
            (0..N).for_each(|c| residuals[c][octant] = root * (target[c] - predicted[i][c]));
        }
        residuals.iter_mut().for_each(|r| butterflies.forward(r));
        residuals
    }

    /// Adds the inverse transform of the coefficients to the predicted values. The mean of the cell is known: the
    /// coefficient of the mean is what the mean of the prediction misses.
    fn add(
        &self,
        butterflies: &Butterflies,
        coefficients: &Coefficients<N>,
        steps: [f32; N],
        decoded: &mut [[f32; N]],
    ) {
        let total: f32 = self.weights.iter().sum();
        // The last butterfly leaves the mean of all in its first slot.
        let root = butterflies.all()[butterflies.all().len() - 1].mean;
        for (c, of) in coefficients.iter().enumerate() {
            let mut values = [0.0_f32; 8];
            for (butterfly, &q) in butterflies.all().iter().zip(of) {
                values[butterfly.difference] = q as f32 * steps[c];
            }
            let predicted: f32 = decoded.iter().zip(self.weights).map(|(d, w)| w * d[c]).sum();
            values[root] = total.sqrt() * (self.mean[c] - predicted / total);
            butterflies.inverse(&mut values);
            for (i, &octant) in self.octants.iter().enumerate() {
                decoded[i][c] += values[octant] / self.weights[i].sqrt();
            }
        }
    }
}

/// Writes, reads or prices the coefficients of the first `n` butterflies of a cell: whether any is not zero, then all,
/// channel by channel.
fn code_coefficients<C: Coder, const N: usize>(
    coder: &mut C,
    models: &mut FieldModels<N>,
    context: &CellContext,
    n: usize,
    coefficients: &mut Coefficients<N>,
) -> Result<(), C::Error> {
    let any = coefficients.iter().flatten().any(|&c| c != 0);
    if !coder.bit(&mut models.any[context.any()], any)? {
        return Ok(());
    }
    let mut before = 0;
    for i in 0..n {
        for (channel, of) in coefficients.iter_mut().enumerate() {
            let model = &mut models.coefficients[context.coefficient(channel, before)];
            of[i] = coder.sint(model, of[i])?.clamp(-MAX_COEFFICIENT, MAX_COEFFICIENT);
            before += of[i].unsigned_abs().min(2);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surfabet_entropy::Price;

    proptest! {
        #[test]
        fn a_field_comes_back_to_within_its_step(
            cells in prop::collection::btree_map(0_u64..512, prop::array::uniform2(-300.0_f32..300.0), 1..60),
            prediction in prop::sample::select(vec![Prediction::Parents, Prediction::Beside]),
        ) {
            let keys: Vec<u64> = cells.keys().copied().collect();
            let targets: Vec<[f32; 2]> = cells.values().copied().collect();
            let steps = Steps { of_channels: [1.0, 2.0], prediction };
            let source = FieldSource::Targets { values: &targets, lambda: 1e-6 };
            let mut price = Price::default();
            let Ok(coded) = code_field(&mut price, &keys, steps, source);
            prop_assert_eq!(coded.coefficients.len(), 2 * keys.len());
            // Rounding to a step of s leaves an error of s / 2 in each of the orthonormal coefficients, of which a
            // value has 7 per level and its share of the top's.
            for (value, wanted) in coded.values.iter().zip(cells.values()) {
                for c in 0..2 {
                    prop_assert!((value[c] - wanted[c]).abs() <= 4.0 * (c + 1) as f32, "{value:?} {wanted:?}");
                }
            }
            // The chosen coefficients give the same values again.
            let source = FieldSource::Model(&coded.coefficients);
            let Ok(again) = code_field(&mut price, &keys, steps, source);
            prop_assert_eq!(again.values, coded.values);
            prop_assert_eq!(again.coefficients, coded.coefficients);
        }
    }

    #[test]
    fn one_value_everywhere_takes_hardly_a_bit_per_thousand_cells() {
        let cells: Vec<u64> = (0..4096).collect();
        let targets = vec![[200.0, 100.0, 50.0]; cells.len()];
        for prediction in [Prediction::Parents, Prediction::Beside] {
            let mut price = Price::default();
            let source = FieldSource::Targets { values: &targets, lambda: 100.0 };
            let steps = Steps { of_channels: [64.0; 3], prediction };
            let Ok(coded) = code_field(&mut price, &cells, steps, source);
            assert!(price.bits < 120.0, "{}", price.bits);
            // Single precision, a few roundings per level.
            let near = |v: &[f32; 3]| (0..3).all(|c| (v[c] - [200.0, 100.0, 50.0][c]).abs() < 1e-2);
            assert!(coded.values.iter().all(near));
        }
    }

    /// Along the first axis: a cell of one parent, then both cells of the next, of which only the first touches it.
    #[test]
    fn what_was_missed_counts_at_cells_that_share_a_face() {
        let cells = [1, 8, 9];
        let levels = pyramid::<1>(&cells, None);
        let (children, parents) = (&levels[0], &levels[1]);
        let family = |key: u64| (key == 0).then(|| parents.children_of(0));
        let mut missed = Missed::<1>::new(Prediction::Beside, cells.len());
        let mut values = [[7.0], [20.0], [30.0]];
        missed.begin(0..1, &values);
        values[0] = [17.0];
        missed.end(0..1, &values);
        missed.add_beside(1, family, children, 1..3, &mut values);
        assert_eq!(values, [[17.0], [23.0], [30.0]]);
        // Older files do not know of it.
        let missed = Missed::<1>::new(Prediction::Parents, cells.len());
        missed.add_beside(1, family, children, 1..3, &mut values);
        assert_eq!(values, [[17.0], [23.0], [30.0]]);
    }
}
