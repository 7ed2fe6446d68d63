//! A field of values on cells: a region-adaptive hierarchical transform with prediction from coarser cells.
//!
//! The cells are joined by eights up to one. Going down again, the means of the parents around a cell are interpolated,
//! which predicts its children; the residual is transformed by the butterflies of the region-adaptive hierarchical
//! transform (R. L. de Queiroz, P. A. Chou: *Compression of 3D Point Clouds Using a Region-Adaptive Hierarchical
//! Transform*, 2016), orthonormal for any set of cells, and rounded. Where no coefficient is coded the field is smooth,
//! not blocky.
//!
//! Values are whole numbers, in units of 2^-6, and so is all that is computed from them. So readers and writers agree
//! on every platform, and the models of a coefficient may depend on what is predicted: where it changes much, more is missed.
//!
//! | file | step |
//! |---|---|
//! | `coding` | the ways to code a field that files have |
//! | `pyramid` | cells joined by eights, the way down them, and the parents around a cell |
//! | `whole_butterflies` | the transform of a cell's children, in whole numbers |
//! | `butterflies` | the same in single precision |
//! | `coefficients` | all coefficients of a field, in their order |
//! | `contexts` | what the models of coefficients depend on |
//! | `models` | models of the coefficients |
//! | `estimates`, `estimate_inputs`, `estimate_weights` | what small networks expect of a coefficient, and of what |
//! | `trace` | decisions for the training of the networks |
//! | `choice` | when learning: coefficients of least cost |
//! | `older`, `older_models` | fields of older files |

mod butterflies;
mod choice;
mod coding;
mod coefficients;
mod contexts;
mod estimate_inputs;
mod estimate_weights;
mod estimates;
mod models;
mod older;
mod older_models;
mod pyramid;
mod trace;
mod whole_butterflies;

use std::ops::Range;

use surfabet_entropy::Coder;
use surfabet_geom::morton::step;

use super::cells::index;
use crate::patches::constants::{MISSED_SHARE, PARENT_WEIGHTS, STEP_SHARES};
use butterflies::Butterflies;
use choice::choose;
pub use coding::FieldCoding;
use coefficients::Coded;
use contexts::{Around, Beside, CellContext};
use estimates::length;
use models::FieldModels;
use older::OlderField;
use pyramid::{PyramidLevel, descend, from_parents, pyramid};
pub(super) use whole_butterflies::FRACTION;
use whole_butterflies::{WholeButterflies, bounded};

#[cfg(feature = "trace")]
pub use trace::decisions;

/// Rounding of the coefficients of each channel, for values times the root of the number of cells; 1 to 4096.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps<const N: usize>(pub [u32; N]);

impl<const N: usize> Steps<N> {
    /// Step of a channel at a level of the pyramid, in 32nds.
    fn of(self, channel: usize, level: usize) -> i64 {
        i64::from(self.0[channel] * STEP_SHARES[level.min(STEP_SHARES.len() - 1)])
    }

    /// The steps of a level.
    pub fn of_level(self, level: usize) -> [f32; N] {
        std::array::from_fn(|c| self.of(c, level) as f32 / 32.0)
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

/// The values of least cost for `targets`, on sorted `cells`, in whole numbers with estimates or without; `lambda` is the squared error
/// that a bit must save.
pub(super) fn choose_field<const N: usize>(
    cells: &[u64],
    steps: Steps<N>,
    coding: FieldCoding,
    targets: &[[f32; N]],
    lambda: f32,
) -> CellValues<N> {
    let with_estimates = coding == FieldCoding::Estimated;
    let source = FieldSource::Targets { values: targets, lambda };
    let price = &mut surfabet_entropy::Price::default();
    let Ok(chosen) = code_whole(price, cells, steps, with_estimates, source);
    chosen
}

/// Reads a field of N channels on sorted `cells`, or writes or prices one of these coefficients.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(super) fn code_field<C: Coder, const N: usize>(
    coder: &mut C,
    cells: &[u64],
    steps: Steps<N>,
    coding: FieldCoding,
    coefficients: Option<&[i32]>,
) -> Result<CellValues<N>, C::Error> {
    let older =
        |coder: &mut C, coding| older::code_field(coder, cells, steps.0, coding, coefficients);
    match coding {
        FieldCoding::Whole | FieldCoding::Estimated => {
            let source = coefficients.map_or(FieldSource::Stream, FieldSource::Model);
            code_whole(coder, cells, steps, coding == FieldCoding::Estimated, source)
        }
        FieldCoding::Beside => older(coder, OlderField::BESIDE),
        FieldCoding::Parents => older(coder, OlderField::PARENTS),
    }
}

/// Writes, reads or prices a field of N channels on sorted `cells`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
fn code_whole<C: Coder, const N: usize>(
    coder: &mut C,
    cells: &[u64],
    steps: Steps<N>,
    with_estimates: bool,
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
    let (models, coded) = (FieldModels::new(with_estimates), Coded::with_capacity(cells.len()));
    let mut walk = Walk { coder, models, steps, source, coded };
    let top = walk.mean(&levels[levels.len() - 1])?;
    let means = descend(&levels, top, |l, [parents, children], means, activity| {
        let mut decoded = predict(parents, means, children);
        let active = walk.level(l, parents, children, means, activity, &mut decoded)?;
        Ok((decoded, active))
    })?;
    let unit = (1 << FRACTION) as f32;
    let values = means.into_iter().map(|value| value.map(|v| v as f32 / unit)).collect();
    Ok(CellValues { values, coefficients: walk.coded.all })
}

/// Predicts the mean of every child: the means of its parent and of the seven parents next to it on the child's
/// side, interpolated; parents that do not exist are left out.
fn predict<const N: usize>(
    parents: &PyramidLevel<'_, N>,
    means: &[[i32; N]],
    children: &PyramidLevel<'_, N>,
) -> Vec<[i32; N]> {
    from_parents(parents, children, |around| {
        let (mut sum, mut total) = ([0_i64; N], 0_i64);
        for &(parent, corner) in around {
            let weight: i64 = (0..3).map(|axis| PARENT_WEIGHTS[corner >> axis & 1]).product();
            (0..N).for_each(|c| sum[c] += weight * i64::from(means[parent][c]));
            total += weight;
        }
        sum.map(|s| (2 * s + total).div_euclid(2 * total) as i32)
    })
}

/// The walk down the pyramid.
struct Walk<'a, C, const N: usize> {
    coder: &'a mut C,
    models: FieldModels<N>,
    steps: Steps<N>,
    source: FieldSource<'a, N>,
    coded: Coded<N>,
}

/// A cell with at least two children.
struct Children<'a, const N: usize> {
    /// Octants of the children in the cell.
    octants: Vec<usize>,
    weights: &'a [u32],
    targets: Option<&'a [[f32; N]]>,
    /// Decoded mean of the cell.
    mean: [i32; N],
}

impl<C: Coder, const N: usize> Walk<'_, C, N> {
    /// Mean of all cells, rounded to whole numbers.
    fn mean(&mut self, top: &PyramidLevel<'_, N>) -> Result<[i32; N], C::Error> {
        let mut mean = [0; N];
        for (c, value) in mean.iter_mut().enumerate() {
            let wanted = match self.source {
                FieldSource::Stream => 0,
                FieldSource::Model(coefficients) => coefficients[c],
                FieldSource::Targets { .. } => top.targets[0][c].round() as i32,
            };
            let coded = self.coder.sint(&mut self.models.mean[c], wanted)?;
            self.coded.all.push(coded);
            *value = bounded(i64::from(coded) << FRACTION);
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
        means: &[[i32; N]],
        activity: &[u8],
        decoded: &mut [[i32; N]],
    ) -> Result<Vec<u8>, C::Error> {
        let places = index(&parents.keys);
        let mut active = vec![0_u8; parents.keys.len()];
        let mut coded = vec![Beside::default(); parents.keys.len()];
        let mut missed = vec![[0; N]; children.keys.len()];
        let of_parents = parents.children().enumerate();
        for (p, range) in of_parents {
            let key = parents.keys[p];
            missed[range.clone()].copy_from_slice(&decoded[range.clone()]);
            if range.len() == 1 {
                decoded[range.start] = means[p];
                active[p] = activity[p].saturating_sub(1);
            } else {
                let at =
                    |axis: usize, up: bool| places.get(&step(key, axis, up)).map(|&i| i as usize);
                // Cells before this one are coded at this level, of those that follow only the level above is.
                let below: [Option<usize>; 3] = std::array::from_fn(|axis| at(axis, false));
                let above = (0..3).filter_map(|axis| at(axis, true));
                let families = below.map(|q| q.map(|q| parents.children_of(q)));
                let pulls = add_missed(&families, children, &range, &missed, decoded);
                let all = Around {
                    activity: activity[p],
                    ahead: above.map(|i| usize::from(activity[i])).sum(),
                    behind: below.iter().flatten().map(|&i| usize::from(active[i])).sum(),
                    n_behind: below.iter().flatten().count(),
                    weight: parents.weights[p],
                    missed: self.missed_beside(l, &families, &missed),
                };
                let beside = Beside::along(below.map(|q| q.map(|q| &coded[q])));
                let context = CellContext::new(l, all, beside);
                let cell = Children::new(children, range.clone(), means[p]);
                (active[p], coded[p]) =
                    self.cell(context, &cell, &pulls, &mut decoded[range.clone()])?;
            }
            // Until here what was predicted from the parents, now what that missed.
            for i in range {
                let predicted = missed[i];
                missed[i] = std::array::from_fn(|c| decoded[i][c] - predicted[c]);
            }
        }
        Ok(active)
    }

    /// Sum of what was missed at the children of the cells beside that are coded, in eighths of a step of cells as wide as the
    /// level's in a surface.
    fn missed_beside(
        &self,
        l: usize,
        below: &[Option<Range<usize>>; 3],
        missed: &[[i32; N]],
    ) -> [u64; N] {
        std::array::from_fn(|c| {
            let all = below.iter().flatten().flat_map(Clone::clone);
            // 24 values below 2^31: the product stays below 2^49.
            let sum: u64 = all.map(|j| u64::from(missed[j][c].unsigned_abs())).sum();
            (sum << (l.min(11) + 2)) / self.steps.of(c, l) as u64
        })
    }

    /// Adds the coefficients of a cell to the prediction of its children; gives its activity, and what cells beside it
    /// look at.
    fn cell(
        &mut self,
        mut context: CellContext<N>,
        cell: &Children<'_, N>,
        pulls: &[[i32; 8]; N],
        decoded: &mut [[i32; N]],
    ) -> Result<(u8, Beside<N>), C::Error> {
        let butterflies = WholeButterflies::new(&cell.octants, cell.weights);
        let n = butterflies.all().len();
        let steps: [_; N] = std::array::from_fn(|c| self.steps.of(c, context.level));
        let mut means = [0; N];
        for c in 0..N {
            let mut slots = [0; 8];
            cell.octants.iter().zip(&*decoded).for_each(|(&o, value)| slots[o] = value[c]);
            means[c] = butterflies.forward(&mut slots, |i, butterfly, change| {
                context.set_change(i, c, butterfly.change_class(change, steps[c]));
            });
        }
        for (c, of_channel) in pulls.iter().enumerate().filter(|(_, of)| **of != [0; 8]) {
            butterflies.forward(&mut of_channel.clone(), |i, _, pull| {
                let shift = context.level.min(11) + 2;
                let size = (pull.unsigned_abs() << shift) / steps[c] as u64;
                context.pulls[i][c] = length(size).min(12) as i8 * pull.signum() as i8;
            });
        }
        for (i, butterfly) in butterflies.all().iter().enumerate() {
            context.set_axis(i, butterfly.axis, butterfly.weights, n);
        }
        let mut coefficients = match self.source {
            FieldSource::Stream => [[0; 7]; N],
            FieldSource::Model(given) => self.coded.next_of(given, n),
            FieldSource::Targets { lambda, .. } => {
                let (residuals, slots) = cell.residuals(decoded);
                choose(&self.models, &context, &slots, &residuals, self.steps, lambda)
            }
        };
        let beside = self.models.code(self.coder, &context, &mut coefficients)?;
        for c in 0..N {
            // All children move by what the mean of their predictions is off, and by their coefficients.
            let mut slots = [0; 8];
            let off = i64::from(cell.mean[c]) - i64::from(means[c]);
            butterflies.inverse(&mut slots, off, &coefficients[c], steps[c]);
            for (&octant, value) in cell.octants.iter().zip(&mut *decoded) {
                value[c] = bounded(i64::from(value[c]) + slots[octant]);
            }
        }
        Ok((self.coded.add(&coefficients, n), beside))
    }
}

/// Adds its share of what was missed beside them to the predictions of the children `range` of a cell. Of the cells that share a
/// face with a child those of smaller coordinates in other parents are coded: those parents' keys are smaller. `below` are
/// the children of the cell one down along each axis. Gives the sum of what was missed beside each, by channel and octant.
fn add_missed<const N: usize>(
    below: &[Option<Range<usize>>; 3],
    children: &PyramidLevel<'_, N>,
    range: &Range<usize>,
    missed: &[[i32; N]],
    predicted: &mut [[i32; N]],
) -> [[i32; 8]; N] {
    let mut pulls = [[0; 8]; N];
    for i in range.clone() {
        let mut sum = [0_i64; N];
        for (axis, family) in below.iter().enumerate() {
            let Some(family) = family else { continue };
            if children.keys[i] >> axis & 1 == 0 {
                let octant = children.keys[i] & 7 | 1 << axis;
                if let Some(j) = family.clone().find(|&j| children.keys[j] & 7 == octant) {
                    (0..N).for_each(|c| sum[c] += i64::from(missed[j][c]));
                }
            }
        }
        for c in 0..N {
            let share = (MISSED_SHARE * sum[c] + 128) >> 8;
            predicted[i][c] = bounded(i64::from(predicted[i][c]) + share);
            pulls[c][(children.keys[i] & 7) as usize] = bounded(sum[c]);
        }
    }
    pulls
}

impl<'a, const N: usize> Children<'a, N> {
    /// The children `range` of a cell with this mean.
    fn new(level: &'a PyramidLevel<'_, N>, range: Range<usize>, mean: [i32; N]) -> Self {
        Self {
            octants: level.keys[range.clone()].iter().map(|k| (k & 7) as usize).collect(),
            weights: &level.weights[range.clone()],
            targets: level.targets.get(range),
            mean,
        }
    }

    /// The transform of what the prediction misses, by channel, and the slots in which its coefficients are.
    fn residuals(&self, predicted: &[[i32; N]]) -> ([[f32; 8]; N], Vec<usize>) {
        let weights: Vec<f32> = self.weights.iter().map(|&w| w as f32).collect();
        let butterflies = Butterflies::new(&self.octants, &weights);
        let mut residuals = [[0.0_f32; 8]; N];
        let targets = self.targets.unwrap_or(&[]);
        let unit = (1 << FRACTION) as f32;
        for (i, (&octant, target)) in self.octants.iter().zip(targets).enumerate() {
            let root = weights[i].sqrt();
            for c in 0..N {
                residuals[c][octant] = root * (target[c] - predicted[i][c] as f32 / unit);
            }
        }
        residuals.iter_mut().for_each(|r| butterflies.forward(r));
        (residuals, butterflies.all().iter().map(|butterfly| butterfly.difference).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surfabet_entropy::Price;

    use super::models::MAX_COEFFICIENT;

    proptest! {
        #[test]
        fn a_field_comes_back_to_within_its_step(
            cells in prop::collection::btree_map(0_u64..512, prop::array::uniform2(-300.0_f32..300.0), 1..60),
        ) {
            let keys: Vec<u64> = cells.keys().copied().collect();
            let targets: Vec<[f32; 2]> = cells.values().copied().collect();
            let steps = Steps([1, 2]);
            let coded = choose_field(&keys, steps, FieldCoding::Estimated, &targets, 1e-6);
            prop_assert_eq!(coded.coefficients.len(), 2 * keys.len());
            // Rounding to a step of s leaves an error of s / 2 in each of the orthonormal coefficients, of which a
            // value has 7 per level and its share of the top's; rounding of values adds some 64ths.
            for (value, wanted) in coded.values.iter().zip(cells.values()) {
                for c in 0..2 {
                    prop_assert!((value[c] - wanted[c]).abs() <= 4.2 * (c + 1) as f32, "{value:?} {wanted:?}");
                }
            }
            // The chosen coefficients give the same values again, by all codings.
            let [estimated, whole] = [FieldCoding::Estimated, FieldCoding::Whole];
            for coding in [estimated, whole, FieldCoding::Beside, FieldCoding::Parents] {
                let given = Some(coded.coefficients.as_slice());
                let Ok(again) = code_field(&mut Price::default(), &keys, steps, coding, given);
                prop_assert_eq!(&again.coefficients, &coded.coefficients);
                let is_whole = [estimated, whole].contains(&coding);
                prop_assert!(!is_whole || again.values == coded.values);
            }
        }

        /// Coefficients that no learned model has, as of a hostile file.
        #[test]
        fn any_coefficients_give_values_within_bounds(
            cells in prop::collection::btree_set(0_u64..512, 1..40),
            coefficients in prop::collection::vec(-MAX_COEFFICIENT..=MAX_COEFFICIENT, 80),
        ) {
            let keys: Vec<u64> = cells.iter().copied().collect();
            let given = Some(&coefficients[..2 * keys.len()]);
            let steps = Steps([4096, 1]);
            let coding = FieldCoding::Estimated;
            let Ok(coded) = code_field(&mut Price::default(), &keys, steps, coding, given);
            prop_assert!(coded.values.iter().flatten().all(|v| v.abs() <= (1 << 24) as f32));
        }
    }

    #[test]
    fn one_value_everywhere_takes_hardly_a_bit_per_thousand_cells() {
        let cells: Vec<u64> = (0..4096).collect();
        let targets = vec![[200.0, 100.0, 50.0]; cells.len()];
        let coded = choose_field(&cells, Steps([64; 3]), FieldCoding::Estimated, &targets, 100.0);
        let mut price = Price::default();
        let given = Some(coded.coefficients.as_slice());
        let coding = FieldCoding::Estimated;
        let Ok(_) = code_field(&mut price, &cells, Steps([64; 3]), coding, given);
        assert!(price.bits < 120.0, "{}", price.bits);
        assert!(coded.values.iter().all(|v| *v == [200.0, 100.0, 50.0]));
    }
}
