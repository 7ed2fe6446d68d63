//! Fields of older files, in single precision: a region-adaptive hierarchical transform with prediction from coarser cells.
//!
//! The cells are joined by eights up to one. Going down again, the means of the parents around a cell are interpolated,
//! which predicts its children; the residual is transformed by the butterflies of the region-adaptive hierarchical
//! transform (R. L. de Queiroz, P. A. Chou: *Compression of 3D Point Clouds Using a Region-Adaptive Hierarchical
//! Transform*, 2016), orthonormal for any set of cells, and rounded. Where no coefficient is coded the field is smooth,
//! not blocky.

use std::ops::Range;

use surfabet_entropy::Coder;
use surfabet_geom::morton::{MortonMap, step};

use super::CellValues;
use super::butterflies::Butterflies;
use super::coefficients::{Coded, Coefficients};
use super::models::MAX_COEFFICIENT;
use super::older_models::{CellContext, FieldModels};
use super::pyramid::{PyramidLevel, descend, from_parents, pyramid};
use crate::patches::attributes::cells::index;

/// What an older way to code a field is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct OlderField {
    /// Weight of the parent next to a child's own along each axis.
    neighbour_share: f32,
    /// The share of what was missed at each cell beside a child that is added to its prediction, where there is any.
    missed_share: Option<f32>,
    /// Step of a level of the pyramid against that of the model: for the cells themselves, their parents, and so on.
    step_shares: [f32; 4],
}

impl OlderField {
    /// [`super::FieldCoding::Parents`].
    pub const PARENTS: Self =
        Self { neighbour_share: 0.32, missed_share: None, step_shares: [1.25, 1.0, 0.85, 0.7] };

    /// [`super::FieldCoding::Beside`].
    pub const BESIDE: Self =
        Self { neighbour_share: 0.26, missed_share: Some(0.3), step_shares: [1.15, 1.0, 0.9, 0.8] };
}

/// Writes, reads or prices a field of N channels on sorted `cells`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(super) fn code_field<C: Coder, const N: usize>(
    coder: &mut C,
    cells: &[u64],
    steps: [u32; N],
    coding: OlderField,
    given: Option<&[i32]>,
) -> Result<CellValues<N>, C::Error> {
    if cells.is_empty() {
        return Ok(CellValues { values: Vec::new(), coefficients: Vec::new() });
    }
    let levels = pyramid::<N>(cells, None);
    let (models, coded) = (FieldModels::default(), Coded::with_capacity(cells.len()));
    let mut walk = Walk { coder, models, steps, coding, given, coded };
    let top = walk.mean()?;
    let values = descend(&levels, top, |l, [parents, children], means, activity| {
        let mut decoded = predict(parents, means, children, coding.neighbour_share);
        let active = walk.level(l, parents, children, means, activity, &mut decoded)?;
        Ok((decoded, active))
    })?;
    Ok(CellValues { values, coefficients: walk.coded.all })
}

/// Predicts the mean of every child: the means of its parent and of the seven parents next to it on the child's
/// side, interpolated. Along each axis the parent counts `1 - s` and its neighbour s, `neighbour_share`; parents that do not
/// exist are left out.
fn predict<const N: usize>(
    parents: &PyramidLevel<'_, N>,
    means: &[[f32; N]],
    children: &PyramidLevel<'_, N>,
    neighbour_share: f32,
) -> Vec<[f32; N]> {
    from_parents(parents, children, |around| {
        let (mut sum, mut total) = ([0.0; N], 0.0);
        for &(parent, corner) in around {
            let shares = [1.0 - neighbour_share, neighbour_share];
            let weight: f32 = (0..3).map(|axis| shares[corner >> axis & 1]).product();
            (0..N).for_each(|c| sum[c] += weight * means[parent][c]);
            total += weight;
        }
        sum.map(|s| s / total)
    })
}

/// The walk down the pyramid.
struct Walk<'a, C, const N: usize> {
    coder: &'a mut C,
    models: FieldModels<N>,
    steps: [u32; N],
    coding: OlderField,
    /// A model's coefficients, N times the number of cells, of which the first N are the mean; `None` for a reader.
    given: Option<&'a [i32]>,
    coded: Coded<N>,
}

/// A cell with at least two children.
struct Children<const N: usize> {
    /// Octants of the children in the cell.
    octants: Vec<usize>,
    weights: Vec<f32>,
    /// Decoded mean of the cell.
    mean: [f32; N],
}

impl<C: Coder, const N: usize> Walk<'_, C, N> {
    /// Mean of all cells, in whole numbers.
    fn mean(&mut self) -> Result<[f32; N], C::Error> {
        let mut mean = [0.0; N];
        for (c, value) in mean.iter_mut().enumerate() {
            let wanted = self.given.map_or(0, |coefficients| coefficients[c]);
            let coded = self.coder.sint(&mut self.models.mean[c], wanted)?;
            self.coded.all.push(coded);
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
        let mut missed = Missed::new(self.coding, children.keys.len());
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
        cell: &Children<N>,
        decoded: &mut [[f32; N]],
    ) -> Result<u8, C::Error> {
        let butterflies = Butterflies::new(&cell.octants, &cell.weights);
        let n = butterflies.all().len();
        let given = self.given.map(|given| self.coded.next_of(given, n));
        let mut coefficients = given.unwrap_or([[0; 7]; N]);
        code_coefficients(self.coder, &mut self.models, context, n, &mut coefficients)?;
        let shares = self.coding.step_shares;
        let share = shares[context.level.min(shares.len() - 1)];
        let steps = self.steps.map(|step| step as f32 * share);
        cell.add(&butterflies, &coefficients, steps, decoded);
        Ok(self.coded.add(&coefficients, n))
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
    fn new(coding: OlderField, cells: usize) -> Self {
        let share = coding.missed_share;
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

impl<const N: usize> Children<N> {
    /// The children `range` of a cell with this mean.
    fn new(level: &PyramidLevel<'_, N>, range: Range<usize>, mean: [f32; N]) -> Self {
        Self {
            octants: level.keys[range.clone()].iter().map(|k| (k & 7) as usize).collect(),
            weights: level.weights[range].iter().map(|&w| w as f32).collect(),
            mean,
        }
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
            let predicted: f32 = decoded.iter().zip(&self.weights).map(|(d, w)| w * d[c]).sum();
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

    /// Along the first axis: a cell of one parent, then both cells of the next, of which only the first touches it.
    #[test]
    fn what_was_missed_counts_at_cells_that_share_a_face() {
        let cells = [1, 8, 9];
        let levels = pyramid::<1>(&cells, None);
        let (children, parents) = (&levels[0], &levels[1]);
        let family = |key: u64| (key == 0).then(|| parents.children_of(0));
        let mut missed = Missed::<1>::new(OlderField::BESIDE, cells.len());
        let mut values = [[7.0], [20.0], [30.0]];
        missed.begin(0..1, &values);
        values[0] = [17.0];
        missed.end(0..1, &values);
        missed.add_beside(1, family, children, 1..3, &mut values);
        assert_eq!(values, [[17.0], [23.0], [30.0]]);
        // Older files do not know of it.
        let missed = Missed::<1>::new(OlderField::PARENTS, cells.len());
        missed.add_beside(1, family, children, 1..3, &mut values);
        assert_eq!(values, [[17.0], [23.0], [30.0]]);
    }
}
