//! What to say about a sheet: the hierarchy, masks, shapes and thickness of least Lagrangian cost D + lambda R.
//!
//! D is the squared distance that input points would have from the decoded surface with its thickness, plus that
//! of decoded points from the input, in finest pixels squared. A run of n samples in the slab [a, b] and a decoded
//! slab [c, d] differ by what sticks out at either end; uniform slabs make that a difference of cubes. R is the
//! price in bits under the models of the coder, as trained by the round before.

use crate::patches::coding::surroundings::UNKNOWN;
use crate::patches::coding::{GeometryModels, pixel_index};
use crate::patches::model::{LatticePatch, MAX_THICKNESS, Node, PATCH_PIXELS, THICKNESS_STEPS};
use crate::patches::sheets::{Run, Sheet, THINNEST};
use crate::patches::surface::basis::{Basis, DEGREES, FRACTION, N_SHAPES};

/// How much the distance of the thin surface from the mean of the samples counts: slabs overlap well even where
/// their middles are apart.
const SURFACE: f32 = 0.5;

/// How much the error of decoded points counts against that of input points.
const FORWARD: f32 = 2.0;

/// Most shapes in a patch.
const MAX_SHAPES: usize = 12;

/// Shapes tried after the last one that helped.
const PATIENCE: usize = 3;

/// Far beyond any distance that matters, in pixels: a root is never left out for less.
const FAR: f32 = 1e4;

/// What the choice depends on.
pub(in crate::patches) struct Choice<'a> {
    pub models: &'a GeometryModels,
    pub bases: &'a [Basis],
    /// Pixels squared per bit.
    pub lambda: f32,
    /// Depth step in pixels.
    pub step: f32,
    pub levels: u32,
}

/// A node with its cost.
struct Chosen {
    node: Node,
    cost: f32,
}

/// Integral of the squared distance of the slab `a` from the slab `b`, over the width of `a`.
fn excess(a: [f32; 2], b: [f32; 2]) -> f32 {
    let cube = |x: f32| if x > 0.0 { x * x * x } else { 0.0 };
    let above = cube(a[1] - b[1]) - cube(a[0] - b[1]);
    let below = cube(b[0] - a[0]) - cube(b[0] - a[1]);
    (above + below) / (3.0 * (a[1] - a[0]))
}

/// Squared errors of one sample of a run: to the decoded slab, from it, and of the thin surface, weighted.
fn misfit(run: &Run, depth: f32, half: f32) -> f32 {
    let input = [run.depth - run.half, run.depth + run.half];
    let decoded = [depth - half, depth + half];
    let off = run.depth - depth;
    excess(input, decoded) + FORWARD * excess(decoded, input) + SURFACE * off * off
}

impl Choice<'_> {
    /// The best hierarchy for a sheet.
    pub fn root(&self, sheet: &Sheet) -> Node {
        let width = (PATCH_PIXELS << (self.levels - 1)) as usize;
        let holes = distances(&sheet.runs, width);
        let runs: Vec<Run> = sheet.runs.clone();
        let n: f32 = runs.iter().map(|r| r.n).sum();
        let of = Square { holes: &holes, tile: width, density: n / runs.len() as f32 };
        let best = self.node(&of, &runs, self.levels - 1, [0, 0]);
        if sheet.small {
            let left_out: f32 = runs.iter().map(|r| r.n * r.stray.min(FAR).powi(2)).sum();
            // A root takes about ten bits beside its node.
            if left_out < best.cost + 10.0 * self.lambda {
                return Node::Empty;
            }
        }
        best.node
    }

    fn node(&self, of: &Square<'_>, runs: &[Run], level: u32, corner: [usize; 2]) -> Chosen {
        let l = level as usize;
        let is_root = level + 1 == self.levels;
        if runs.is_empty() {
            let bits = if is_root { 0.0 } else { self.models.empty[l * 9].cost(true) };
            return Chosen { node: Node::Empty, cost: self.lambda * bits };
        }
        let split_bit = |split: bool| {
            if level == 0 { 0.0 } else { self.models.split[l * 6 + 4].cost(split) }
        };
        let presence = if is_root { 0.0 } else { self.models.empty[l * 9 + 4].cost(false) };
        let mut best = self.leaf(of, runs, level, corner);
        best.cost += self.lambda * (presence + split_bit(false));
        if !is_root {
            // Dropped: as if all lay half a square away from what remains.
            let away = (0.5 * (PATCH_PIXELS << level) as f32).powi(2);
            let bits = self.models.empty[l * 9 + 4].cost(true);
            let cost = runs.iter().map(|r| r.n * away).sum::<f32>() + self.lambda * bits;
            if cost < best.cost {
                best = Chosen { node: Node::Empty, cost };
            }
        }
        if level > 0 {
            let half = (PATCH_PIXELS << (level - 1)) as usize;
            let mut cost = self.lambda * (presence + split_bit(true));
            let mut children: [Node; 4] = Default::default();
            for (child, node) in children.iter_mut().enumerate() {
                let at = [corner[0] + (child & 1) * half, corner[1] + (child >> 1) * half];
                let inside = |r: &&Run| {
                    (at[0]..at[0] + half).contains(&usize::from(r.u))
                        && (at[1]..at[1] + half).contains(&usize::from(r.v))
                };
                let below: Vec<Run> = runs.iter().filter(inside).copied().collect();
                let chosen = self.node(of, &below, level - 1, at);
                cost += chosen.cost;
                *node = chosen.node;
                if cost >= best.cost {
                    break;
                }
            }
            if cost < best.cost && children.iter().any(|c| *c != Node::Empty) {
                best = Chosen { node: Node::Split(Box::new(children)), cost };
            }
        }
        best
    }

    fn leaf(&self, of: &Square<'_>, runs: &[Run], level: u32, corner: [usize; 2]) -> Chosen {
        let cell = |r: &Run| {
            let c = (usize::from(r.u) - corner[0]) >> level;
            let row = (usize::from(r.v) - corner[1]) >> level;
            row * PATCH_PIXELS as usize + c
        };
        let (mask, mut cost) = self.mask(of, runs, level, corner, cell);
        let mut inside: Vec<Run> =
            runs.iter().filter(|r| mask >> cell(r) & 1 != 0).copied().collect();
        let seen = inside.iter().fold(0_u64, |seen, r| seen | 1 << cell(r));
        fill_holes(&mut inside, mask & !seen, level, corner, of.density);
        let shape = self.shape(&inside, level, corner);
        cost += shape.cost;
        Chosen { node: Node::Leaf(LatticePatch { mask, ..shape.patch }), cost }
    }

    /// Pixels that are worth setting, and the cost of them and of those that are not.
    fn mask(
        &self,
        of: &Square<'_>,
        runs: &[Run],
        level: u32,
        corner: [usize; 2],
        cell: impl Fn(&Run) -> usize,
    ) -> (u64, f32) {
        let side = PATCH_PIXELS as usize;
        let pixel = (1_usize << level) as f32;
        let mut unset = [0.0_f32; 64];
        let mut set = [0.0_f32; 64];
        for run in runs {
            unset[cell(run)] += run.n * pixel * pixel / 3.0;
        }
        for (c, cost) in set.iter_mut().enumerate() {
            let (u, v) = (corner[0] + ((c % side) << level), corner[1] + ((c / side) << level));
            for dv in 0..1_usize << level {
                for du in 0..1_usize << level {
                    *cost += FORWARD * of.density * of.holes[(v + dv) * of.tile + u + du];
                }
            }
        }
        let full = &self.models.full[level as usize * 9 + 4];
        let all: f32 = set.iter().sum::<f32>() + self.lambda * full.cost(true);
        let mut mask = 0_u64;
        for c in 0..64 {
            if set[c] < unset[c] {
                mask |= 1 << c;
            }
        }
        // One pixel with samples at least: the one with most to lose.
        let measured = (0..64).filter(|&c| unset[c] > 0.0).fold(0_u64, |m, c| m | 1 << c);
        let most = (0..64)
            .filter(|&c| unset[c] > 0.0)
            .max_by(|&a, &b| (unset[a] - set[a]).total_cmp(&(unset[b] - set[b])))
            .map_or(1, |c| 1_u64 << c);
        if mask & measured == 0 {
            mask |= most;
        }
        let price = |mask: u64, c: usize| {
            let (column, row) = (c % side, c / side);
            let state = |du: isize, dv: isize| {
                let (x, y) = (column.wrapping_add_signed(du), row.wrapping_add_signed(dv));
                if x < side && y < side { (mask >> (y * side + x) & 1) as usize } else { UNKNOWN }
            };
            let states = [state(-1, 0), state(0, -1), state(-1, -1), state(1, -1)];
            self.models.mask[pixel_index(level, states)].cost(mask >> c & 1 != 0)
        };
        for _ in 0..2 {
            for c in 0..64_usize {
                // What the pixel's own bit and the four that it is context of would cost either way.
                let touched = [
                    Some(c),
                    (c % side + 1 < side).then_some(c + 1),
                    (c + side < 64).then_some(c + side),
                    (c % side + 1 < side && c + side + 1 < 64).then_some(c + side + 1),
                    (!c.is_multiple_of(side) && c + side - 1 < 64).then_some(c + side - 1),
                ];
                let cost = |mask: u64, loss: f32| {
                    let bits: f32 = touched.iter().flatten().map(|&t| price(mask, t)).sum();
                    loss + self.lambda * bits
                };
                let (with, without) = (mask | 1 << c, mask & !(1 << c));
                mask = if without & measured == 0 || cost(with, set[c]) <= cost(without, unset[c]) {
                    with
                } else {
                    without
                };
            }
        }
        let loss: f32 = (0..64).map(|c| if mask >> c & 1 != 0 { set[c] } else { unset[c] }).sum();
        let bits: f32 = full.cost(false) + (0..64).map(|c| price(mask, c)).sum::<f32>();
        let partial = loss + self.lambda * bits;
        if all <= partial { (u64::MAX, all) } else { (mask, partial) }
    }

    /// Shapes and thickness for the runs of set pixels.
    fn shape(&self, runs: &[Run], level: u32, corner: [usize; 2]) -> Shape {
        let l = level as usize;
        let basis = &self.bases[l];
        let scale = 1.0 / (1_u32 << FRACTION) as f32;
        let values: Vec<[f32; N_SHAPES]> = runs
            .iter()
            .map(|r| {
                let at = |x: u8, c: usize| 2 * (usize::from(x) - c) + 1;
                basis.at(at(r.u, corner[0]), at(r.v, corner[1])).map(|b| b as f32 * scale)
            })
            .collect();
        let total: f32 = runs.iter().map(|r| r.n).sum::<f32>().max(1e-6);
        let mean = runs.iter().map(|r| r.n * r.depth).sum::<f32>() / total;
        let mut gram = [[0.0_f32; N_SHAPES]; N_SHAPES];
        let mut right = [0.0_f32; N_SHAPES];
        for (run, b) in runs.iter().zip(&values) {
            for i in 0..N_SHAPES {
                let weighted = run.n * b[i];
                right[i] += weighted * (run.depth - mean);
                for j in 0..=i {
                    gram[i][j] += weighted * b[j];
                }
            }
        }
        for i in 0..N_SHAPES {
            // Shapes that the set pixels hardly see must not grow wild.
            gram[i][i] += 0.01 * total * f32::from(DEGREES[i].0 + DEGREES[i].1);
        }
        // Both triangles.
        let lower = gram;
        for (i, row) in gram.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate().skip(i + 1) {
                *entry = lower[j][i];
            }
        }
        let mut chosen = vec![0_usize];
        let mut best: Option<Shape> = None;
        let mut since = 0;
        while let Some(solution) = solve(&gram, &right, &chosen) {
            let mut patch = LatticePatch::default();
            for (&k, c) in chosen.iter().zip(&solution) {
                let offset = if k == 0 { mean } else { 0.0 };
                patch.coefficients[k] = ((c + offset) / self.step).round() as i32;
            }
            let shape = self.priced(patch, runs, &values, l);
            if best.as_ref().is_none_or(|b| shape.cost < b.cost) {
                best = Some(shape);
                since = 0;
            } else {
                since += 1;
            }
            if since == PATIENCE || chosen.len() == MAX_SHAPES.min(runs.len()) {
                break;
            }
            // The shape that explains most of what is left.
            let residual: [f32; N_SHAPES] = std::array::from_fn(|i| {
                right[i] - chosen.iter().zip(&solution).map(|(&k, c)| gram[i][k] * c).sum::<f32>()
            });
            let gain = |i: usize| residual[i] * residual[i] / gram[i][i].max(1e-6);
            let next = (0..N_SHAPES)
                .filter(|i| !chosen.contains(i))
                .max_by(|&a, &b| gain(a).total_cmp(&gain(b)).then(b.cmp(&a)));
            let Some(next) = next else { break };
            chosen.push(next);
        }
        // One coefficient is always solved for: its weight is positive.
        let mut best =
            best.unwrap_or_else(|| self.priced(LatticePatch::default(), runs, &values, l));
        for k in (1..N_SHAPES).rev() {
            let c = best.patch.coefficients[k];
            if c == 0 {
                continue;
            }
            for smaller in [0, c - c.signum()] {
                let mut patch = best.patch;
                patch.coefficients[k] = smaller;
                let shape = self.priced(patch, runs, &values, l);
                if shape.cost < best.cost {
                    best = shape;
                }
            }
        }
        best
    }

    /// A patch with its best thickness, and its cost.
    fn priced(
        &self,
        mut patch: LatticePatch,
        runs: &[Run],
        values: &[[f32; N_SHAPES]],
        level: usize,
    ) -> Shape {
        let used: Vec<usize> = (0..N_SHAPES).filter(|&k| patch.coefficients[k] != 0).collect();
        let depths: Vec<f32> = values
            .iter()
            .map(|b| used.iter().map(|&k| patch.coefficients[k] as f32 * self.step * b[k]).sum())
            .collect();
        let loss = |half: f32| -> f32 {
            runs.iter().zip(&depths).map(|(r, &d)| r.n * misfit(r, d, half.max(THINNEST))).sum()
        };
        let total: f32 = runs.iter().map(|r| r.n).sum::<f32>().max(1e-6);
        let variance = runs
            .iter()
            .zip(&depths)
            .map(|(r, d)| r.n * (r.half * r.half / 3.0 + (r.depth - d) * (r.depth - d)))
            .sum::<f32>()
            / total;
        let guess = ((3.0 * variance).sqrt() * f32::from(THICKNESS_STEPS)).round();
        let mut thickness = guess.clamp(0.0, f32::from(MAX_THICKNESS)) as u8;
        let half = |steps: u8| f32::from(steps) / f32::from(THICKNESS_STEPS);
        let mut distortion = loss(half(thickness));
        while thickness > 0 {
            let thinner = loss(half(thickness - 1));
            if thinner >= distortion {
                break;
            }
            (distortion, thickness) = (thinner, thickness - 1);
        }
        patch.thickness = thickness;
        let last = (1..N_SHAPES).rev().find(|&k| patch.coefficients[k] != 0).unwrap_or(0);
        let mut bits = self.models.last[level].cost(last as u32);
        for k in 1..last {
            bits += self.models.shapes[level * N_SHAPES + k].cost(patch.coefficients[k]);
        }
        if last > 0 {
            let magnitude = patch.coefficients[last].unsigned_abs() - 1;
            bits += 1.0 + self.models.last_shape[level].cost(magnitude);
        }
        // How far depth and thickness are from what the neighbours say is not known yet.
        bits += self.models.depth[level * 3 + 2].cost(1) + self.models.thickness[1].cost(1);
        Shape { patch, cost: distortion + self.lambda * bits }
    }
}

/// Adds a run of little weight at each pixel of `holes`, as deep as the nearest measured one: where nothing was
/// measured the surface goes on, it does not run away.
fn fill_holes(runs: &mut Vec<Run>, holes: u64, level: u32, corner: [usize; 2], density: f32) {
    let measured = runs.len();
    for hole in (0..64_usize).filter(|h| holes >> h & 1 != 0) {
        let side = PATCH_PIXELS as usize;
        let middle = |c: usize, i: usize| (c + (i << level) + (1 << level) / 2).min(255) as u8;
        let (u, v) = (middle(corner[0], hole % side), middle(corner[1], hole / side));
        let squared = |r: &Run| {
            let (du, dv) = (f32::from(r.u) - f32::from(u), f32::from(r.v) - f32::from(v));
            du * du + dv * dv
        };
        let nearest = runs[..measured].iter().min_by(|a, b| squared(a).total_cmp(&squared(b)));
        if let Some(&nearest) = nearest {
            let n = HOLE_WEIGHT * density * (1_u32 << (2 * level)) as f32;
            runs.push(Run { u, v, n, ..nearest });
        }
    }
}

/// Weight of a pixel without samples against one with samples.
const HOLE_WEIGHT: f32 = 0.2;

struct Shape {
    patch: LatticePatch,
    cost: f32,
}

/// What all squares of a sheet share.
struct Square<'a> {
    /// Squared distance of every pixel of the tile to the nearest run; zero where there is one.
    holes: &'a [f32],
    /// Pixels per side of the tile.
    tile: usize,
    /// Samples per pixel.
    density: f32,
}

/// Squared in-plane distance of each pixel's middle to the nearest run, in pixels, at most 16.
fn distances(runs: &[Run], width: usize) -> Vec<f32> {
    const REACH: i32 = 4;
    let mut squared = vec![(REACH * REACH) as f32; width * width];
    for run in runs {
        for dv in -REACH..=REACH {
            for du in -REACH..=REACH {
                let (u, v) = (i32::from(run.u) + du, i32::from(run.v) + dv);
                if u < 0 || v < 0 || u >= width as i32 || v >= width as i32 {
                    continue;
                }
                let d = &mut squared[v as usize * width + u as usize];
                *d = d.min((du * du + dv * dv) as f32);
            }
        }
    }
    // Samples of the other pixel lie about its middle, some of them closer.
    squared.iter().map(|&d| if d > 0.0 { (d.sqrt() - 0.25).powi(2) } else { 0.0 }).collect()
}

/// Least squares over the chosen shapes, by Cholesky's decomposition.
fn solve(
    gram: &[[f32; N_SHAPES]; N_SHAPES],
    right: &[f32; N_SHAPES],
    chosen: &[usize],
) -> Option<Vec<f32>> {
    let n = chosen.len();
    let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| f64::from(gram[chosen[i]][chosen[j]]));
    let vector = nalgebra::DVector::from_fn(n, |i, _| f64::from(right[chosen[i]]));
    let solution = matrix.cholesky()?.solve(&vector);
    Some(solution.iter().map(|&c| c as f32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn excess_is_the_mean_squared_distance_of_a_slab(
            a in -5.0_f32..5.0, width in 0.2_f32..4.0, b in -5.0_f32..5.0, other in 0.2_f32..4.0,
        ) {
            let (slab, from) = ([a, a + width], [b, b + other]);
            let n = 4000;
            let numeric = (0..n)
                .map(|i| {
                    let t = a + width * (i as f32 + 0.5) / n as f32;
                    let off = (from[0] - t).max(t - from[1]).max(0.0);
                    f64::from(off * off)
                })
                .sum::<f64>() / f64::from(n);
            let exact = f64::from(excess(slab, from));
            prop_assert!((exact - numeric).abs() < 1e-3 * numeric.max(1.0), "{exact} {numeric}");
        }
    }

    #[test]
    fn equal_slabs_have_no_misfit() {
        let run = Run { u: 0, v: 0, n: 1.0, depth: 3.0, half: 1.5, stray: 0.0 };
        assert_eq!(misfit(&run, 3.0, 1.5), 0.0);
        assert!(misfit(&run, 3.5, 1.5) > 0.0 && misfit(&run, 3.0, 1.0) > 0.0);
    }
}
