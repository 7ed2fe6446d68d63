//! Colour of the nodes: a region-adaptive hierarchical transform with prediction from coarser cells.
//!
//! Cells of the grid are joined by eights up to one. Going down again, the mean colours of the parents around a
//! cell are interpolated, which predicts its children; what the prediction misses is transformed by the
//! butterflies of the region-adaptive hierarchical transform (R. L. de Queiroz, P. A. Chou: *Compression of 3D
//! Point Clouds Using a Region-Adaptive Hierarchical Transform*, 2016), orthonormal for any set of cells, and
//! rounded. Where nothing is said the colour is smooth, not blocky.

pub(in crate::patches) mod cells;
pub(in crate::patches) mod targets;

use rayon::prelude::*;
use surfabet_entropy::{Bit, Coder, SInt};
use surfabet_geom::morton::step;

use crate::color::rounded;
use crate::patches::color::cells::index;

/// Levels with models of their own.
const LEVELS: usize = 12;

/// Contexts of the number of coefficients around.
const ACTIVITY: usize = 7;

/// Adaptive models of the colours.
#[derive(Debug, Clone)]
pub(in crate::patches) struct ColorModels {
    mean: [SInt; 3],
    /// Is any coefficient of the cell not zero: by level, activity of the parent and around.
    any: Vec<Bit>,
    /// Coefficients by channel, level and activity.
    coefficients: Vec<SInt>,
}

impl Default for ColorModels {
    fn default() -> Self {
        Self {
            mean: [const { SInt::new() }; 3],
            any: vec![Bit::with_memory(Bit::MAX_MEMORY); LEVELS * ACTIVITY * ACTIVITY],
            coefficients: vec![SInt::new(); 3 * LEVELS * 3],
        }
    }
}

/// How finely colour is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColorSteps {
    /// Rounding of the luma coefficients, 0..255 times the root of the number of nodes; 1 to 4096.
    pub luma: u32,
    /// Rounding of the chroma coefficients, 1 to 4096.
    pub chroma: u32,
}

impl ColorSteps {
    /// Checks that both are in their domain.
    pub fn is_valid(self) -> bool {
        [self.luma, self.chroma].iter().all(|s| (1..=4096).contains(s))
    }

    /// Step of a channel at a level. What is said of coarse cells also predicts the finer ones, so it is said more
    /// finely.
    fn of(self, channel: usize, level: usize) -> f32 {
        const SHARES: [f32; 4] = [1.25, 1.0, 0.85, 0.7];
        let step = if channel == 0 { self.luma } else { self.chroma };
        step as f32 * SHARES[level.min(SHARES.len() - 1)]
    }
}

/// Luma and two chromas, orthonormal.
fn to_channels([r, g, b]: [f32; 3]) -> [f32; 3] {
    const T: f32 = 0.577_350_26;
    const H: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const S: f32 = 0.408_248_3;
    [T * (r + g + b), H * (r - b), S * (2.0 * g - r - b)]
}

fn to_rgb([y, o, g]: [f32; 3]) -> [f32; 3] {
    const T: f32 = 0.577_350_26;
    const H: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const S: f32 = 0.408_248_3;
    [T * y + H * o - S * g, T * y + 2.0 * S * g, T * y - H * o - S * g]
}

/// Cells of one size.
struct Level {
    keys: Vec<u64>,
    /// Number of nodes in each cell.
    weights: Vec<f32>,
    /// Children of cell i are cells `children[i]..children[i + 1]` of the level below; empty at the lowest.
    children: Vec<u32>,
    /// True means, when writing.
    targets: Vec<[f32; 3]>,
}

fn pyramid(nodes: &[u64], targets: Option<&[[f32; 3]]>) -> Vec<Level> {
    let targets = targets.map_or(Vec::new(), |t| t.iter().map(|&c| to_channels(c)).collect());
    let mut levels = vec![Level {
        keys: nodes.to_vec(),
        weights: vec![1.0; nodes.len()],
        children: Vec::new(),
        targets,
    }];
    while levels[levels.len() - 1].keys.len() > 1 {
        let below = &levels[levels.len() - 1];
        let mut level = Level {
            keys: Vec::new(),
            weights: Vec::new(),
            children: Vec::new(),
            targets: Vec::new(),
        };
        for (i, key) in (0..).zip(&below.keys) {
            if level.keys.last() != Some(&(key >> 3)) {
                level.keys.push(key >> 3);
                level.children.push(i);
            }
        }
        level.children.push(below.keys.len() as u32);
        for range in level.children.windows(2) {
            let range = range[0] as usize..range[1] as usize;
            let weight: f32 = below.weights[range.clone()].iter().sum();
            level.weights.push(weight);
            if !below.targets.is_empty() {
                let mut mean = [0.0; 3];
                for i in range {
                    (0..3).for_each(|c| mean[c] += below.weights[i] * below.targets[i][c] / weight);
                }
                level.targets.push(mean);
            }
        }
        levels.push(level);
    }
    levels
}

/// The butterflies of one cell with up to eight children.
struct Butterflies {
    /// Pairs in the order of the forward transform: slots of both, and their weights' shares.
    pairs: [(usize, usize, f32, f32); 7],
    n_pairs: usize,
}

impl Butterflies {
    fn new(octants: &[usize], weights: &[f32]) -> Self {
        let mut weight = [0.0_f32; 8];
        for (&o, &w) in octants.iter().zip(weights) {
            weight[o] = w;
        }
        let mut found = Self { pairs: [(0, 0, 0.0, 0.0); 7], n_pairs: 0 };
        // Slot that holds what remains of each octant.
        let mut slot: [usize; 8] = std::array::from_fn(|o| o);
        for axis in 0..3 {
            for low in (0..8).step_by(1 << (axis + 1)) {
                let (a, b) = (slot[low], slot[low + (1 << axis)]);
                let (wa, wb) = (weight[a], weight[b]);
                if wa > 0.0 && wb > 0.0 {
                    let total = wa + wb;
                    found.pairs[found.n_pairs] = (a, b, (wa / total).sqrt(), (wb / total).sqrt());
                    found.n_pairs += 1;
                    weight[a] = total;
                } else if wb > 0.0 {
                    slot[low] = b;
                }
            }
        }
        found
    }

    fn pairs(&self) -> &[(usize, usize, f32, f32)] {
        &self.pairs[..self.n_pairs]
    }

    fn forward(&self, values: &mut [f32; 8]) {
        for &(a, b, sa, sb) in self.pairs() {
            let (x, y) = (values[a], values[b]);
            values[a] = sa * x + sb * y;
            values[b] = sa * y - sb * x;
        }
    }

    fn inverse(&self, values: &mut [f32; 8]) {
        for &(a, b, sa, sb) in self.pairs().iter().rev() {
            let (x, y) = (values[a], values[b]);
            values[a] = sa * x - sb * y;
            values[b] = sb * x + sa * y;
        }
    }
}

/// Means of the parents around each child, interpolated at its middle.
fn predict(parents: &Level, means: &[[f32; 3]], children: &Level) -> Vec<[f32; 3]> {
    let places = index(&parents.keys);
    let of_parent: Vec<u32> = parents
        .children
        .windows(2)
        .zip(0..)
        .flat_map(|(range, i)| std::iter::repeat_n(i, (range[1] - range[0]) as usize))
        .collect();
    children
        .keys
        .par_iter()
        .zip(&of_parent)
        .with_min_len(1 << 10)
        .map(|(&child, &parent)| {
            let own = parents.keys[parent as usize];
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for corner in 0..8_usize {
                let mut key = own;
                let mut weight = 1.0;
                for axis in 0..3 {
                    if corner >> axis & 1 != 0 {
                        key = step(key, axis, child >> axis & 1 != 0);
                        weight *= NEIGHBOUR_SHARE;
                    } else {
                        weight *= 1.0 - NEIGHBOUR_SHARE;
                    }
                }
                let found = if corner == 0 { Some(&parent) } else { places.get(&key) };
                if let Some(&i) = found {
                    (0..3).for_each(|c| sum[c] += weight * means[i as usize][c]);
                    total += weight;
                }
            }
            sum.map(|s| s / total)
        })
        .collect()
}

/// Weight of the parent next to the own one along each axis; linear interpolation between middles would be 1/4, a
/// smoother one is better in the mean.
const NEIGHBOUR_SHARE: f32 = 0.32;

/// Where the coefficients come from.
#[derive(Debug, Clone, Copy)]
pub(in crate::patches) enum Source<'a> {
    /// The coder.
    Stream,
    /// A model: three times the number of nodes, of which the first three are the mean.
    Model(&'a [i32]),
    /// The colour that each node should have; coefficients of least cost are chosen.
    Targets {
        colors: &'a [[f32; 3]],
        /// Squared grey levels per bit.
        lambda: f32,
    },
}

/// Colours of the nodes, and the coefficients that say them.
pub(in crate::patches) struct Colors {
    pub colors: Vec<[u8; 3]>,
    pub coefficients: Vec<i32>,
}

/// Writes, reads or prices the colours of sorted `nodes`.
///
/// # Errors
/// Whatever the coder finds wrong with what it reads.
pub(in crate::patches) fn code_colors<C: Coder>(
    coder: &mut C,
    models: &mut ColorModels,
    nodes: &[u64],
    steps: ColorSteps,
    source: Source<'_>,
) -> Result<Colors, C::Error> {
    if nodes.is_empty() {
        return Ok(Colors { colors: Vec::new(), coefficients: Vec::new() });
    }
    let targets = match source {
        Source::Targets { colors, .. } => Some(colors),
        _ => None,
    };
    let levels = pyramid(nodes, targets);
    let top = levels.len() - 1;
    let mut walk =
        Walk { coder, models, steps, source, coefficients: Vec::with_capacity(3 * nodes.len()) };
    let mut means = vec![walk.mean(&levels[top])?];
    let mut activity = vec![0_u8];
    for l in (0..top).rev() {
        let (parents, children) = (&levels[l + 1], &levels[l]);
        let mut decoded = predict(parents, &means, children);
        let active = walk.level(l, parents, children, &means, &activity, &mut decoded)?;
        activity = active
            .iter()
            .zip(parents.children.windows(2))
            .flat_map(|(&a, range)| std::iter::repeat_n(a, (range[1] - range[0]) as usize))
            .collect();
        means = decoded;
    }
    let colors = means.into_iter().map(|m| rounded(to_rgb(m)));
    Ok(Colors { colors: colors.collect(), coefficients: walk.coefficients })
}

/// On the way down the pyramid.
struct Walk<'a, C> {
    coder: &'a mut C,
    models: &'a mut ColorModels,
    steps: ColorSteps,
    source: Source<'a>,
    coefficients: Vec<i32>,
}

impl<C: Coder> Walk<'_, C> {
    fn mean(&mut self, top: &Level) -> Result<[f32; 3], C::Error> {
        let mut mean = [0.0; 3];
        for (c, value) in mean.iter_mut().enumerate() {
            let wanted = match self.source {
                Source::Stream => 0,
                Source::Model(coefficients) => coefficients[c],
                Source::Targets { .. } => top.targets[0][c].round() as i32,
            };
            let read = self.coder.sint(&mut self.models.mean[c], wanted)?;
            self.coefficients.push(read);
            *value = read as f32;
        }
        Ok(mean)
    }

    /// Adds what is said of a level to its prediction; gives back how much was said of every parent.
    fn level(
        &mut self,
        l: usize,
        parents: &Level,
        children: &Level,
        means: &[[f32; 3]],
        activity: &[u8],
        decoded: &mut [[f32; 3]],
    ) -> Result<Vec<u8>, C::Error> {
        let places = index(&parents.keys);
        let mut active = vec![0_u8; parents.keys.len()];
        for (p, range) in parents.children.windows(2).enumerate() {
            let (from, to) = (range[0] as usize, range[1] as usize);
            if to - from == 1 {
                decoded[from] = means[p];
                active[p] = activity[p].saturating_sub(1);
                continue;
            }
            let around = (0..3)
                .filter_map(|axis| places.get(&step(parents.keys[p], axis, false)))
                .map(|&i| usize::from(active[i as usize]))
                .sum::<usize>();
            // What was said a level up of the parents that follow, whose own turn is yet to come.
            let ahead = (0..3)
                .filter_map(|axis| places.get(&step(parents.keys[p], axis, true)))
                .map(|&i| usize::from(activity[i as usize]))
                .sum::<usize>();
            let context = Context {
                level: l.min(LEVELS - 1),
                parent: (usize::from(activity[p]) + ahead.div_ceil(2)).min(ACTIVITY - 1),
                around: around.min(ACTIVITY - 1),
            };
            let cell = Cell {
                octants: children.keys[from..to].iter().map(|k| (k & 7) as usize).collect(),
                weights: &children.weights[from..to],
                targets: children.targets.get(from..to),
                mean: means[p],
            };
            active[p] = self.cell(&context, &cell, &mut decoded[from..to])?;
        }
        Ok(active)
    }

    fn cell(
        &mut self,
        context: &Context,
        cell: &Cell<'_>,
        decoded: &mut [[f32; 3]],
    ) -> Result<u8, C::Error> {
        let butterflies = Butterflies::new(&cell.octants, cell.weights);
        let n = butterflies.n_pairs;
        let mut coefficients = [[0_i32; 7]; 3];
        match self.source {
            Source::Stream => {}
            Source::Model(given) => {
                let from = self.coefficients.len();
                for (i, of) in given[from..from + 3 * n].chunks(3).enumerate() {
                    (0..3).for_each(|c| coefficients[c][i] = of[c]);
                }
            }
            Source::Targets { lambda, .. } => {
                let mut residuals = [[0.0_f32; 8]; 3];
                for (i, (&o, target)) in
                    cell.octants.iter().zip(cell.targets.unwrap_or(&[])).enumerate()
                {
                    let root = cell.weights[i].sqrt();
                    (0..3).for_each(|c| residuals[c][o] = root * (target[c] - decoded[i][c]));
                }
                residuals.iter_mut().for_each(|r| butterflies.forward(r));
                coefficients =
                    choose(self.models, context, &butterflies, &residuals, self.steps, lambda);
            }
        }
        code_cell(self.coder, self.models, context, n, &mut coefficients)?;
        let [luma, orange, green] = &coefficients;
        for ((y, o), g) in luma.iter().zip(orange).zip(green).take(n) {
            self.coefficients.extend([y, o, g]);
        }
        let total: f32 = cell.weights.iter().sum();
        // The last butterfly leaves the mean of all in its first slot.
        let root = butterflies.pairs()[n - 1].0;
        for (c, of) in coefficients.iter().enumerate() {
            let step = self.steps.of(c, context.level);
            let mut values = [0.0_f32; 8];
            for (&(_, b, _, _), &q) in butterflies.pairs().iter().zip(of) {
                values[b] = q as f32 * step;
            }
            let predicted: f32 = decoded.iter().zip(cell.weights).map(|(d, w)| w * d[c]).sum();
            values[root] = total.sqrt() * (cell.mean[c] - predicted / total);
            butterflies.inverse(&mut values);
            for (i, &o) in cell.octants.iter().enumerate() {
                decoded[i][c] += values[o] / cell.weights[i].sqrt();
            }
        }
        let said: u32 = coefficients.iter().flatten().map(|c| c.unsigned_abs().min(4)).sum();
        Ok(said.min(4) as u8)
    }
}

/// A cell with at least two children.
struct Cell<'a> {
    octants: Vec<usize>,
    weights: &'a [f32],
    targets: Option<&'a [[f32; 3]]>,
    /// Decoded mean.
    mean: [f32; 3],
}

struct Context {
    level: usize,
    parent: usize,
    around: usize,
}

impl Context {
    fn any(&self) -> usize {
        (self.level * ACTIVITY + self.parent) * ACTIVITY + self.around
    }

    fn coefficient(&self, channel: usize, before: u32) -> usize {
        (channel * LEVELS + self.level) * 3 + before.min(2) as usize
    }
}

fn code_cell<C: Coder>(
    coder: &mut C,
    models: &mut ColorModels,
    context: &Context,
    n: usize,
    coefficients: &mut [[i32; 7]; 3],
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

/// Larger coefficients than colours can have are of no use to anyone.
const MAX_COEFFICIENT: i32 = 1 << 24;

/// Rounds the coefficients of a cell for the least cost.
fn choose(
    models: &ColorModels,
    context: &Context,
    butterflies: &Butterflies,
    residuals: &[[f32; 8]; 3],
    steps: ColorSteps,
    lambda: f32,
) -> [[i32; 7]; 3] {
    let mut coefficients = [[0; 7]; 3];
    let any = &models.any[context.any()];
    let (mut zero, mut cost) = (0.0, lambda * any.cost(true));
    let mut before = 0;
    for (i, &(_, b, _, _)) in butterflies.pairs().iter().enumerate() {
        for channel in 0..3 {
            let step = steps.of(channel, context.level);
            let value = residuals[channel][b];
            let model = &models.coefficients[context.coefficient(channel, before)];
            let nearest = (value / step).round() as i32;
            let price = |c: i32| (value - c as f32 * step).powi(2) + lambda * model.cost(c);
            let mut best = (0, price(0));
            for c in [nearest, nearest - nearest.signum()] {
                let p = price(c);
                if p < best.1 {
                    best = (c, p);
                }
            }
            coefficients[channel][i] = best.0;
            cost += best.1;
            zero += value * value;
            before += best.0.unsigned_abs().min(2);
        }
    }
    if zero + lambda * any.cost(false) <= cost {
        return [[0; 7]; 3];
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use surfabet_entropy::Price;

    proptest! {
        #[test]
        fn butterflies_are_orthonormal_and_keep_the_weighted_mean(
            present in 1_u8..=255,
            values in prop::array::uniform8(-200.0_f32..200.0),
            weights in prop::array::uniform8(1.0_f32..50.0),
        ) {
            let octants: Vec<usize> = (0..8).filter(|o| present >> o & 1 != 0).collect();
            let of: Vec<f32> = octants.iter().map(|&o| weights[o]).collect();
            let butterflies = Butterflies::new(&octants, &of);
            prop_assert_eq!(butterflies.n_pairs, octants.len() - 1);
            let mut transformed = [0.0; 8];
            octants.iter().for_each(|&o| transformed[o] = values[o] * weights[o].sqrt());
            let before = transformed;
            butterflies.forward(&mut transformed);
            let energy = |v: &[f32; 8]| v.iter().map(|x| x * x).sum::<f32>();
            prop_assert!((energy(&before) - energy(&transformed)).abs() <= 1e-3 * energy(&before) + 1e-3);
            if let Some(&(root, ..)) = butterflies.pairs().last() {
                let total: f32 = of.iter().sum();
                let mean = octants.iter().map(|&o| weights[o] * values[o]).sum::<f32>() / total;
                prop_assert!((transformed[root] - mean * total.sqrt()).abs() < 0.05);
            }
            butterflies.inverse(&mut transformed);
            for (a, b) in transformed.iter().zip(&before) {
                prop_assert!((a - b).abs() < 0.01);
            }
        }

        #[test]
        fn fine_steps_give_the_colours_back(
            cells in prop::collection::btree_map(0_u64..512, prop::array::uniform3(0_u8..=255), 1..60),
        ) {
            let nodes: Vec<u64> = cells.keys().copied().collect();
            let targets: Vec<[f32; 3]> = cells.values().map(|c| c.map(f32::from)).collect();
            let steps = ColorSteps { luma: 1, chroma: 1 };
            let source = Source::Targets { colors: &targets, lambda: 1e-6 };
            let mut price = Price::default();
            let Ok(said) = code_colors(&mut price, &mut ColorModels::default(), &nodes, steps, source);
            for (color, wanted) in said.colors.iter().zip(cells.values()) {
                for c in 0..3 {
                    prop_assert!(color[c].abs_diff(wanted[c]) <= 4, "{color:?} {wanted:?}");
                }
            }
            // What was chosen says the same colours again.
            let source = Source::Model(&said.coefficients);
            let Ok(again) = code_colors(&mut price, &mut ColorModels::default(), &nodes, steps, source);
            prop_assert_eq!(again.colors, said.colors);
            prop_assert_eq!(again.coefficients, said.coefficients);
        }
    }

    #[test]
    fn one_colour_everywhere_takes_hardly_a_bit_per_thousand_cells() {
        let nodes: Vec<u64> = (0..4096).collect();
        let targets = vec![[200.0, 100.0, 50.0]; nodes.len()];
        let steps = ColorSteps { luma: 64, chroma: 64 };
        let mut price = Price::default();
        let source = Source::Targets { colors: &targets, lambda: 100.0 };
        let Ok(said) = code_colors(&mut price, &mut ColorModels::default(), &nodes, steps, source);
        assert!(price.bits < 120.0, "{}", price.bits);
        assert!(said.colors.iter().all(|c| c[0].abs_diff(200) <= 1 && c[1].abs_diff(100) <= 1));
    }
}
