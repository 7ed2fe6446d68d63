//! Colour: a region-adaptive hierarchical transform with prediction from coarser cells.
//!
//! Cells of a cubic grid around the surface carry colour. They are joined by eights up to one. Going down again, the
//! mean colours of the parents around a cell are interpolated, which predicts its children; the residual is transformed
//! by the butterflies of the region-adaptive hierarchical transform (R. L. de Queiroz, P. A. Chou: *Compression of 3D
//! Point Clouds Using a Region-Adaptive Hierarchical Transform*, 2016), orthonormal for any set of cells, and rounded.
//! Where no coefficient is coded the colour is smooth, not blocky.
//!
//! | file | step |
//! |---|---|
//! | `cells` | the cells that carry colour, from the geometry |
//! | `targets` | when learning: the colour that each should have |
//! | `steps` | luma and two chromas, and their steps |
//! | `pyramid` | cells joined by eights, and prediction from the level above |
//! | `butterflies` | the transform of a cell's children |
//! | `choice` | when learning: coefficients of least cost |
//! | `models` | adaptive models of the coefficients |

mod butterflies;
pub(in crate::patches) mod cells;
mod choice;
mod models;
mod pyramid;
mod steps;
pub(in crate::patches) mod targets;

use std::ops::Range;

use surfabet_entropy::Coder;
use surfabet_geom::morton::{MortonMap, step};

use crate::color::rounded;
use butterflies::Butterflies;
use cells::index;
use models::CellContext;
pub(in crate::patches) use models::ColorModels;
use pyramid::{PyramidLevel, predict, pyramid};
pub use steps::ColorSteps;
use steps::to_rgb;

/// Coefficients of the butterflies of a cell, by channel.
type Coefficients = [[i32; 7]; 3];

/// Largest coefficient: no colour has one as large.
const MAX_COEFFICIENT: i32 = 1 << 24;

/// Where the coefficients come from.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) enum ColorSource<'a> {
    /// The coder.
    Stream,
    /// A model: three times the number of cells, of which the first three are the mean.
    Model(&'a [i32]),
    /// The colour that each cell should have; coefficients of least cost are chosen.
    Targets {
        colors: &'a [[f32; 3]],
        /// Squared grey levels that a bit must save.
        lambda: f32,
    },
}

/// Colours of the cells, and the coefficients that give them.
pub(in crate::patches) struct CellColors {
    pub colors: Vec<[u8; 3]>,
    pub coefficients: Vec<i32>,
}

/// Writes, reads or prices the colours of sorted `cells`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::patches) fn code_colors<C: Coder>(
    coder: &mut C,
    models: &mut ColorModels,
    cells: &[u64],
    steps: ColorSteps,
    source: ColorSource<'_>,
) -> Result<CellColors, C::Error> {
    if cells.is_empty() {
        return Ok(CellColors { colors: Vec::new(), coefficients: Vec::new() });
    }
    let targets = match source {
        ColorSource::Targets { colors, .. } => Some(colors),
        _ => None,
    };
    let levels = pyramid(cells, targets);
    let top = levels.len() - 1;
    let coefficients = Vec::with_capacity(3 * cells.len());
    let mut walk = Walk { coder, models, steps, source, coefficients };
    let mut means = vec![walk.mean(&levels[top])?];
    let mut activity = vec![0_u8];
    for l in (0..top).rev() {
        let (parents, children) = (&levels[l + 1], &levels[l]);
        let mut decoded = predict(parents, &means, children);
        let active = walk.level(l, parents, children, &means, &activity, &mut decoded)?;
        activity = parents.for_children(&active);
        means = decoded;
    }
    let colors = means.into_iter().map(|m| rounded(to_rgb(m)));
    Ok(CellColors { colors: colors.collect(), coefficients: walk.coefficients })
}

/// The walk down the pyramid.
struct Walk<'a, C> {
    coder: &'a mut C,
    models: &'a mut ColorModels,
    steps: ColorSteps,
    source: ColorSource<'a>,
    /// All coefficients so far.
    coefficients: Vec<i32>,
}

/// A cell with at least two children.
struct Children<'a> {
    /// Octants of the children in the cell.
    octants: Vec<usize>,
    weights: &'a [f32],
    targets: Option<&'a [[f32; 3]]>,
    /// Decoded mean of the cell.
    mean: [f32; 3],
}

impl<C: Coder> Walk<'_, C> {
    /// Mean colour of all cells, rounded to whole numbers.
    fn mean(&mut self, top: &PyramidLevel) -> Result<[f32; 3], C::Error> {
        let mut mean = [0.0; 3];
        for (c, value) in mean.iter_mut().enumerate() {
            let wanted = match self.source {
                ColorSource::Stream => 0,
                ColorSource::Model(coefficients) => coefficients[c],
                ColorSource::Targets { .. } => top.targets[0][c].round() as i32,
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
        parents: &PyramidLevel,
        children: &PyramidLevel,
        means: &[[f32; 3]],
        activity: &[u8],
        decoded: &mut [[f32; 3]],
    ) -> Result<Vec<u8>, C::Error> {
        let places = index(&parents.keys);
        let mut active = vec![0_u8; parents.keys.len()];
        for (p, range) in parents.children().enumerate() {
            if range.len() == 1 {
                decoded[range.start] = means[p];
                active[p] = activity[p].saturating_sub(1);
                continue;
            }
            let key = parents.keys[p];
            // Cells before this one are coded at this level, of those that follow only the level above is.
            let around = sum_beside(&places, key, false, &active);
            let ahead = sum_beside(&places, key, true, activity);
            let parent = usize::from(activity[p]) + ahead.div_ceil(2);
            let context = CellContext::new(l, parent, around);
            let cell = Children::new(children, range.clone(), means[p]);
            active[p] = self.cell(&context, &cell, &mut decoded[range])?;
        }
        Ok(active)
    }

    /// Adds the coefficients of a cell to the prediction of its children; gives its activity.
    fn cell(
        &mut self,
        context: &CellContext,
        cell: &Children<'_>,
        decoded: &mut [[f32; 3]],
    ) -> Result<u8, C::Error> {
        let butterflies = Butterflies::new(&cell.octants, cell.weights);
        let n = butterflies.all().len();
        let mut coefficients = match self.source {
            ColorSource::Stream => [[0; 7]; 3],
            ColorSource::Model(given) => {
                let mut coefficients = [[0; 7]; 3];
                let from = self.coefficients.len();
                for (i, of) in given[from..from + 3 * n].chunks(3).enumerate() {
                    (0..3).for_each(|c| coefficients[c][i] = of[c]);
                }
                coefficients
            }
            ColorSource::Targets { lambda, .. } => {
                let residuals = cell.residuals(&butterflies, decoded);
                choice::choose(self.models, context, &butterflies, &residuals, self.steps, lambda)
            }
        };
        code_coefficients(self.coder, self.models, context, n, &mut coefficients)?;
        let [luma, orange, green] = &coefficients;
        for ((y, o), g) in luma.iter().zip(orange).zip(green).take(n) {
            self.coefficients.extend([y, o, g]);
        }
        let steps = std::array::from_fn(|c| self.steps.of(c, context.level));
        cell.add(&butterflies, &coefficients, steps, decoded);
        let sum: u32 = coefficients.iter().flatten().map(|c| c.unsigned_abs().min(4)).sum();
        Ok(sum.min(4) as u8)
    }
}

/// Sum of the activities of the three cells beside the one of `key`, up or down the axes.
fn sum_beside(places: &MortonMap<u32>, key: u64, up: bool, activity: &[u8]) -> usize {
    (0..3)
        .filter_map(|axis| places.get(&step(key, axis, up)))
        .map(|&i| usize::from(activity[i as usize]))
        .sum()
}

impl<'a> Children<'a> {
    /// The children `range` of a cell with this mean.
    fn new(level: &'a PyramidLevel, range: Range<usize>, mean: [f32; 3]) -> Self {
        Self {
            octants: level.keys[range.clone()].iter().map(|k| (k & 7) as usize).collect(),
            weights: &level.weights[range.clone()],
            targets: level.targets.get(range),
            mean,
        }
    }

    /// The transform of what the prediction misses, by channel; in the slots of the butterflies.
    fn residuals(&self, butterflies: &Butterflies, predicted: &[[f32; 3]]) -> [[f32; 8]; 3] {
        let mut residuals = [[0.0_f32; 8]; 3];
        let targets = self.targets.unwrap_or(&[]);
        for (i, (&octant, target)) in self.octants.iter().zip(targets).enumerate() {
            let root = self.weights[i].sqrt();
            (0..3).for_each(|c| residuals[c][octant] = root * (target[c] - predicted[i][c]));
        }
        residuals.iter_mut().for_each(|r| butterflies.forward(r));
        residuals
    }

    /// Adds the inverse transform of the coefficients to the predicted colours. The mean of the cell is known: the
    /// coefficient of the mean is what the mean of the prediction misses.
    fn add(
        &self,
        butterflies: &Butterflies,
        coefficients: &Coefficients,
        steps: [f32; 3],
        decoded: &mut [[f32; 3]],
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
fn code_coefficients<C: Coder>(
    coder: &mut C,
    models: &mut ColorModels,
    context: &CellContext,
    n: usize,
    coefficients: &mut Coefficients,
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
        fn fine_steps_give_the_colours_back(
            cells in prop::collection::btree_map(0_u64..512, prop::array::uniform3(0_u8..=255), 1..60),
        ) {
            let keys: Vec<u64> = cells.keys().copied().collect();
            let targets: Vec<[f32; 3]> = cells.values().map(|c| c.map(f32::from)).collect();
            let steps = ColorSteps { luma: 1, chroma: 1 };
            let source = ColorSource::Targets { colors: &targets, lambda: 1e-6 };
            let mut price = Price::default();
            let Ok(coded) = code_colors(&mut price, &mut ColorModels::default(), &keys, steps, source);
            for (color, wanted) in coded.colors.iter().zip(cells.values()) {
                for c in 0..3 {
                    prop_assert!(color[c].abs_diff(wanted[c]) <= 4, "{color:?} {wanted:?}");
                }
            }
            // The chosen coefficients give the same colours again.
            let source = ColorSource::Model(&coded.coefficients);
            let Ok(again) = code_colors(&mut price, &mut ColorModels::default(), &keys, steps, source);
            prop_assert_eq!(again.colors, coded.colors);
            prop_assert_eq!(again.coefficients, coded.coefficients);
        }
    }

    #[test]
    fn one_colour_everywhere_takes_hardly_a_bit_per_thousand_cells() {
        let cells: Vec<u64> = (0..4096).collect();
        let targets = vec![[200.0, 100.0, 50.0]; cells.len()];
        let steps = ColorSteps { luma: 64, chroma: 64 };
        let mut price = Price::default();
        let source = ColorSource::Targets { colors: &targets, lambda: 100.0 };
        let Ok(coded) = code_colors(&mut price, &mut ColorModels::default(), &cells, steps, source);
        assert!(price.bits < 120.0, "{}", price.bits);
        assert!(coded.colors.iter().all(|c| c[0].abs_diff(200) <= 1 && c[1].abs_diff(100) <= 1));
    }
}
