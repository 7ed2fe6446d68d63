//! Depth of a patch as a sum of shapes, and its thickness.

use surfabet_base::rounding::round_f32;

use super::misfit::{Slab, misfit};
use super::solution::Solution;
use super::{Choice, NEIGHBOURS, TileSquare};
use crate::patches::coding::{depth_context, shape_context};
use crate::patches::constants::{MAX_SHAPES, SHAPE_PATIENCE, SHAPE_PULL, THINNEST};
use crate::patches::model::{LatticePatch, MAX_THICKNESS, THICKNESS_STEPS};
use crate::patches::sheets::Run;
use crate::patches::surface::basis::{Basis, DEGREES, FRACTION, N_SHAPES};

/// Numbers that the processor takes at once: sums over all shapes are made in groups of these.
const LANES: usize = 4;

/// Values of all shapes at a run, and zeros up to a whole group.
type ShapeValues = [f32; N_SHAPES.next_multiple_of(LANES)];

/// A patch without its mask, and its cost J.
pub(super) struct PricedPatch {
    pub patch: LatticePatch,
    pub cost: f32,
}

/// The runs that a patch is fitted to.
struct ShapeFit {
    /// Of the runs, those that hold samples come first; the others are of pixels without.
    n_measured: usize,
    /// Values of the shapes at each run.
    values: Vec<ShapeValues>,
    /// The same, shape by shape.
    by_shape: Vec<f32>,
    /// Mean depth of each run.
    depths: Vec<f32>,
    /// Half thickness of each run.
    halves: Vec<f32>,
    /// Number of samples of each run.
    weights: Vec<f32>,
    /// Number of samples of all runs.
    total: f32,
    level: u32,
}

/// Numbers of each run, for pricing one patch after another.
struct Scratch {
    depths: Vec<f32>,
    terms: Vec<f32>,
}

impl Scratch {
    fn of(fit: &ShapeFit) -> Self {
        let n_runs = fit.depths.len();
        Self { depths: vec![0.0; n_runs], terms: vec![0.0; n_runs] }
    }
}

/// Normal equations of weighted least squares over all shapes: depths about their mean.
struct NormalEquations {
    /// Mean depth of the samples.
    mean: f32,
    /// `G_ij = sum of n s_i s_j` over the runs, plus the pull to zero on the diagonal.
    gram: [ShapeValues; N_SHAPES],
    /// `r_i = sum of n s_i (depth - mean)`.
    right: [f32; N_SHAPES],
}

impl Choice<'_> {
    /// Coefficients and thickness of least cost for the runs of set pixels, of which the first `n_measured` hold samples.
    ///
    /// Matching pursuit: the shape that explains most of the residual joins, all coefficients are solved for again, and
    /// the patch with the least cost on the way is kept. Then each coefficient is tried at zero and a step nearer to it.
    pub(super) fn shape(&self, runs: &[Run], n_measured: usize, at: TileSquare) -> PricedPatch {
        let fit = ShapeFit::new(runs, n_measured, &self.bases[at.level as usize], at);
        let equations = NormalEquations::new(&fit);
        let mut scratch = Scratch::of(&fit);
        let mut chosen = vec![0_usize];
        let mut solver = Solution::new();
        let mut best: Option<PricedPatch> = None;
        let mut since = 0;
        while let Some(solution) = equations.solve(&chosen, &mut solver) {
            let rounded = self.rounded(&equations, &chosen, &solution);
            let priced = self.priced(rounded, &fit, &mut scratch);
            if best.as_ref().is_none_or(|b| priced.cost < b.cost) {
                best = Some(priced);
                since = 0;
            } else {
                since += 1;
            }
            if since == SHAPE_PATIENCE || chosen.len() == MAX_SHAPES.min(runs.len()) {
                break;
            }
            let Some(next) = equations.next_shape(&chosen, &solution) else { break };
            chosen.push(next);
        }
        // One coefficient is always solved for: its weight is positive.
        let best = best.unwrap_or_else(|| self.priced(LatticePatch::default(), &fit, &mut scratch));
        self.shrunk(best, &fit, &mut scratch)
    }

    /// The patch with the solved coefficients in depth steps.
    fn rounded(
        &self,
        equations: &NormalEquations,
        chosen: &[usize],
        solution: &[f32],
    ) -> LatticePatch {
        let mut patch = LatticePatch::default();
        for (&k, c) in chosen.iter().zip(solution) {
            let offset = if k == 0 { equations.mean } else { 0.0 };
            patch.coefficients[k] = round_f32((c + offset) / self.step);
        }
        patch
    }

    /// The patch with coefficients at zero or a step nearer to it, the last first, where that costs less.
    fn shrunk(&self, mut best: PricedPatch, fit: &ShapeFit, scratch: &mut Scratch) -> PricedPatch {
        for k in (1..N_SHAPES).rev() {
            let c = best.patch.coefficients[k];
            if c == 0 {
                continue;
            }
            for smaller in [0, c - c.signum()] {
                let mut patch = best.patch;
                patch.coefficients[k] = smaller;
                let priced = self.priced(patch, fit, scratch);
                if priced.cost < best.cost {
                    best = priced;
                }
            }
        }
        best
    }

    /// A patch with its best thickness, and its cost `J = sum of n misfit + lambda R`, R with the points
    /// for what it does not reach.
    fn priced(
        &self,
        mut patch: LatticePatch,
        fit: &ShapeFit,
        scratch: &mut Scratch,
    ) -> PricedPatch {
        let n_runs = fit.depths.len();
        let Scratch { depths, terms } = scratch;
        depths.fill(0.0);
        for k in (0..N_SHAPES).filter(|&k| patch.coefficients[k] != 0) {
            let coefficient = patch.coefficients[k] as f32 * self.step;
            for (depth, s) in depths.iter_mut().zip(&fit.by_shape[k * n_runs..]) {
                *depth += coefficient * s;
            }
        }
        let (thickness, distortion) = self.best_thickness(fit, depths, terms);
        patch.thickness = thickness;
        PricedPatch { patch, cost: distortion + self.lambda * self.patch_bits(&patch, fit.level) }
    }

    /// Bits that coefficients, depth and thickness of a patch take.
    fn patch_bits(&self, patch: &LatticePatch, level: u32) -> f32 {
        let l = level as usize;
        let last = (1..N_SHAPES).rev().find(|&k| patch.coefficients[k] != 0).unwrap_or(0);
        let mut bits = self.models.last[l].cost(last as u32);
        for k in 1..last {
            bits += self.models.shapes[shape_context(level, k)].cost(patch.coefficients[k]);
        }
        if last > 0 {
            let magnitude = patch.coefficients[last].unsigned_abs() - 1;
            bits += 1.0 + self.models.last_shape[l].cost(magnitude);
        }
        // How far depth and thickness are from the predicted ones is not known yet: a step each.
        bits += self.models.depth[depth_context(level, NEIGHBOURS)].cost(1)
            + self.models.thickness[1].cost(1);
        bits
    }

    /// The thickness, in steps, with which decoded `depths` fit the runs best, and the distortion then: from the thickness
    /// of a slab with the samples' variance about the surface, thinner as long as the distortion falls.
    fn best_thickness(&self, fit: &ShapeFit, depths: &[f32], terms: &mut [f32]) -> (u8, f32) {
        let decoded_weight = self.decoded_weight();
        let variance = fit.variance(depths, terms);
        let mut distortion = |steps: u8| -> f32 {
            let half = (f32::from(steps) / f32::from(THICKNESS_STEPS)).max(THINNEST);
            let distance = fit.sum(depths, terms, |run, n, depth| {
                n * misfit(run, Slab { depth, half }, decoded_weight)
            });
            let Some(points) = self.points else { return distance };
            let measured = &mut terms[..fit.n_measured];
            let bits = fit.sum(depths, measured, |run, n, depth| {
                points.bits_beyond(run, n, Slab { depth, half })
            });
            distance + self.lambda * bits
        };
        let guess = ((3.0 * variance).sqrt() * f32::from(THICKNESS_STEPS)).round();
        let mut thickness = guess.clamp(0.0, f32::from(MAX_THICKNESS)) as u8;
        let mut least = distortion(thickness);
        while thickness > 0 {
            let thinner = distortion(thickness - 1);
            if thinner >= least {
                break;
            }
            (least, thickness) = (thinner, thickness - 1);
        }
        (thickness, least)
    }
}

impl ShapeFit {
    fn new(runs: &[Run], n_measured: usize, basis: &Basis, at: TileSquare) -> Self {
        let scale = 1.0 / (1_u32 << FRACTION) as f32;
        let half_pixel = |x: u8, corner: usize| 2 * (usize::from(x) - corner) + 1;
        let mut values: Vec<ShapeValues> = Vec::with_capacity(runs.len());
        values.extend(runs.iter().map(|r| {
            let (hu, hv) = (half_pixel(r.u, at.corner[0]), half_pixel(r.v, at.corner[1]));
            let mut values = [0.0; N_SHAPES.next_multiple_of(LANES)];
            for (value, s) in values.iter_mut().zip(basis.at(hu, hv)) {
                *value = s as f32 * scale;
            }
            values
        }));
        let mut by_shape = vec![0.0; N_SHAPES * runs.len()];
        for (k, of_shape) in by_shape.chunks_exact_mut(runs.len().max(1)).enumerate() {
            of_shape.iter_mut().zip(&values).for_each(|(value, of_run)| *value = of_run[k]);
        }
        Self {
            n_measured,
            values,
            by_shape,
            depths: runs.iter().map(|r| r.depth).collect(),
            halves: runs.iter().map(|r| r.half).collect(),
            weights: runs.iter().map(|r| r.n).collect(),
            total: runs.iter().map(|r| r.n).sum::<f32>().max(1e-6),
            level: at.level,
        }
    }

    /// Sum of `term` over the first runs, as many as there are `terms`: by its slab, its number of samples, and the depth that is
    /// decoded there. All terms come before their sum, which is made in their order: so a processor takes several at once, and
    /// the sum is the same on all.
    fn sum(&self, decoded: &[f32], terms: &mut [f32], term: impl Fn(Slab, f32, f32) -> f32) -> f32 {
        let n = terms.len();
        let (depths, halves) = (&self.depths[..n], &self.halves[..n]);
        let (weights, decoded) = (&self.weights[..n], &decoded[..n]);
        for i in 0..n {
            terms[i] = term(Slab { depth: depths[i], half: halves[i] }, weights[i], decoded[i]);
        }
        terms.iter().sum()
    }

    /// Mean squared distance of the samples from the `decoded` depths.
    fn variance(&self, decoded: &[f32], terms: &mut [f32]) -> f32 {
        let sum = self.sum(decoded, terms, |run, n, depth| {
            let off = run.depth - depth;
            n * (run.half * run.half / 3.0 + off * off)
        });
        sum / self.total
    }
}

impl NormalEquations {
    fn new(fit: &ShapeFit) -> Self {
        let runs = || fit.weights.iter().zip(&fit.depths).zip(&fit.values);
        let mean = runs().map(|((n, depth), _)| n * depth).sum::<f32>() / fit.total;
        let mut gram = [[0.0; N_SHAPES.next_multiple_of(LANES)]; N_SHAPES];
        let mut right = [0.0_f32; N_SHAPES];
        for ((&n, depth), s) in runs() {
            for i in 0..N_SHAPES {
                let weighted = n * s[i];
                right[i] += weighted * (depth - mean);
                add_up_to(i, &mut gram[i], s, weighted);
            }
        }
        for i in 0..N_SHAPES {
            // Shapes that hardly differ on the set pixels must not grow large against each other.
            gram[i][i] += SHAPE_PULL * fit.total * f32::from(DEGREES[i].0 + DEGREES[i].1);
        }
        // Both triangles.
        let lower = gram;
        for (i, row) in gram.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate().take(N_SHAPES).skip(i + 1) {
                *entry = lower[j][i];
            }
        }
        Self { mean, gram, right }
    }

    /// Coefficients c of the chosen shapes with `G c = r`; `solver` was given those before the last.
    fn solve(&self, chosen: &[usize], solver: &mut Solution) -> Option<[f32; MAX_SHAPES]> {
        let last = *chosen.last()?;
        let entry = |j: usize| f64::from(self.gram[last][chosen[j]]);
        solver.with(entry, f64::from(self.right[last]))
    }

    /// The shape not chosen yet that lowers the squared error most, alone: by `(r_i - sum of G_ik c_k)^2 / G_ii`.
    fn next_shape(&self, chosen: &[usize], solution: &[f32]) -> Option<usize> {
        let mut explained: ShapeValues = Default::default();
        for (&k, c) in chosen.iter().zip(solution) {
            // The equations are symmetric.
            explained.iter_mut().zip(&self.gram[k]).for_each(|(sum, entry)| *sum += entry * c);
        }
        let residual: [f32; N_SHAPES] = std::array::from_fn(|i| self.right[i] - explained[i]);
        let gain = |i: usize| residual[i] * residual[i] / self.gram[i][i].max(1e-6);
        (0..N_SHAPES)
            .filter(|i| !chosen.contains(i))
            .max_by(|&a, &b| gain(a).total_cmp(&gain(b)).then(b.cmp(&a)))
    }
}

/// Adds `weight * values` to a row, up to the group with entry `last` and all of that group.
fn add_up_to(last: usize, row: &mut ShapeValues, values: &ShapeValues, weight: f32) {
    let groups = row.as_chunks_mut::<LANES>().0.iter_mut().zip(values.as_chunks::<LANES>().0);
    for (entries, values) in groups.take(last / LANES + 1) {
        for (entry, value) in entries.iter_mut().zip(values) {
            *entry += weight * value;
        }
    }
}
