//! Find all like this: where else in the scene stands what an example shows.

use std::f64::consts::{FRAC_PI_8, PI, TAU};

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;
use surfabet_geom::{KdTree, Neighbor, Pose, Progress};

use super::model::{AlphabetModel, Occurrence};
use super::surface::{self, Surface};
use crate::error::{Error, Result, positive};
use crate::vector::dot;

/// Samples along the diagonal of an example.
const FINENESS: f64 = 64.0;

/// Closest spacing of samples, metres.
const LEAST_SPACING: f64 = 0.004;

/// Occurrences of the example that motions are guessed from.
const SEEDS: usize = 48;

/// Samples of the example that guesses are tried with.
const TRIED: usize = 96;

/// Samples of the example that motions are refined with, at first and to the end.
const REFINED: [usize; 2] = [128, 512];

/// Samples of the example that places are scored with.
const MATCHED: usize = 4096;

/// Shifts that are tried one after the other, as shares of the example's diagonal.
const SLIDES: [f64; 6] = [0.04, 0.04, 0.02, 0.02, 0.01, 0.005];

/// Guesses that are refined.
const GUESSES: usize = 2000;

/// Motions that are refined to the end.
const FINALISTS: usize = 300;

/// Equal pieces seen from two places may differ in size by this factor at no cost.
const SEEN: f64 = 1.5;

/// Pieces larger than the example's largest whole piece by this factor are no place to look for it.
const COMPACT: f64 = 8.0;

/// What the rarest sample is taken to be met by chance with.
const RAREST: f64 = 0.05;

/// From this |z| of a normal on, it says little about the direction that something faces.
const LEVEL: f64 = 0.8;

/// Normals of one and the same surface differ by less, |cosine|.
const ALIKE: f32 = 0.6;

/// Occurrences whose colours are less alike than this are no pair.
const SAME_COLOR: f64 = 0.1;

/// Two finds that share more of their region are one thing.
const OVERLAP: f64 = 0.35;

/// Two finds are nearer than this share of the example's diagonal: one thing.
const APART: f64 = 0.25;

/// What to look for, in world coordinates, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// An upright box by its lowest and highest corner.
    Box {
        /// Lowest corner.
        low: [f64; 3],
        /// Highest corner.
        high: [f64; 3],
    },
    /// All within a distance of a point.
    Ball {
        /// The point.
        center: [f64; 3],
        /// The distance.
        radius: f64,
    },
}

impl Region {
    /// # Errors
    /// [`Error::InvalidParameter`] when there is no room in it.
    fn check(&self) -> Result<()> {
        match *self {
            Self::Box { low, high } => {
                let room = (0..3).all(|a| low[a] < high[a] && (high[a] - low[a]).is_finite());
                if !room {
                    let corners = format!("{low:?} to {high:?}");
                    return Err(Error::invalid(
                        "region",
                        corners,
                        "from a lower to a higher corner",
                    ));
                }
            }
            Self::Ball { center, radius } => {
                if !center.iter().all(|c| c.is_finite()) {
                    return Err(Error::invalid("point", format!("{center:?}"), "finite"));
                }
                positive("radius", radius, "positive and finite")?;
            }
        }
        Ok(())
    }

    fn contains(&self, p: [f64; 3]) -> bool {
        match *self {
            Self::Box { low, high } => (0..3).all(|a| (low[a]..=high[a]).contains(&p[a])),
            Self::Ball { center, radius } => {
                (0..3).map(|a| (p[a] - center[a]).powi(2)).sum::<f64>() <= radius * radius
            }
        }
    }

    fn center(&self) -> [f64; 3] {
        match *self {
            Self::Box { low, high } => std::array::from_fn(|a| 0.5 * (low[a] + high[a])),
            Self::Ball { center, .. } => center,
        }
    }

    fn about(&self, origin: [f64; 3]) -> Self {
        let minus = |p: [f64; 3]| std::array::from_fn(|a| p[a] - origin[a]);
        match *self {
            Self::Box { low, high } => Self::Box { low: minus(low), high: minus(high) },
            Self::Ball { center, radius } => Self::Ball { center: minus(center), radius },
        }
    }
}

/// How to look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FindOptions {
    /// Least score of what is found, 0 to 1. Things of one kind seen from different sides score 0.5 to 0.85 against
    /// each other; unlike things score up to 0.55 by shape alone, less with colours.
    pub min_score: f64,
    /// Most places that are found.
    pub max_found: usize,
    /// Spacing of the samples that are compared, metres; by default a 64th of the diagonal of what the example shows.
    pub resolution: Option<f64>,
    /// Deviation of equal surfaces, metres; by default sigma of the example's occurrences, their median.
    pub tolerance: Option<f64>,
    /// Deviation of equal colours in chroma, grey levels; luma, which changes with the light, may differ three times as
    /// much. `None` goes by shape alone, as in a model without colours.
    pub color_tolerance: Option<f64>,
}

impl Default for FindOptions {
    fn default() -> Self {
        Self {
            min_score: 0.5,
            max_found: 1000,
            resolution: None,
            tolerance: None,
            color_tolerance: Some(10.0),
        }
    }
}

impl FindOptions {
    fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.min_score) {
            return Err(Error::invalid("least score", self.min_score, "0 to 1"));
        }
        for (name, value) in [
            ("resolution", self.resolution),
            ("tolerance", self.tolerance),
            ("color_tolerance", self.color_tolerance),
        ] {
            if let Some(value) = value {
                positive(name, value, "positive and finite")?;
            }
        }
        Ok(())
    }
}

/// A place that looks like the example.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Takes the example there: a turn about the vertical and a shift.
    pub pose: Pose,
    /// How alike, 0 to 1; 1 for the example itself.
    pub score: f64,
    /// Where the middle of the region comes to lie, world coordinates.
    pub center: [f64; 3],
}

impl AlphabetModel {
    /// All places that look like what stands in `example`, the best first; the example itself is among them.
    ///
    /// Scenes are upright, so places differ by a turn about the vertical and a shift. Motions are guessed from pairs of
    /// occurrences of like words, refined on the samples of both surfaces, and scored by the share of the example that
    /// is found again and of the place that the example explains. Surfaces that go on beyond the region, such as the
    /// floor, count by the share of them that lies inside.
    ///
    /// Things must stand out of the deviation that the model was learned with: legs of a chair are lost at a sigma of
    /// their width.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for options or a region outside their domain, and for a region where no word
    /// stands, [`Error::TooManyPoints`] when the spacing of samples is too close, [`Error::Cancelled`].
    pub fn find(
        &self,
        example: &Region,
        options: &FindOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<Found>> {
        options.check()?;
        example.check()?;
        progress.update("sampling the surface", 0.0);
        let origin = self.header().origin;
        let region = example.about(origin);
        let inside: Vec<Occurrence> =
            self.occurrences().filter(|o| example.contains(o.center)).collect();
        let diagonal = match region {
            Region::Box { low, high } => {
                (0..3).map(|a| (high[a] - low[a]).powi(2)).sum::<f64>().sqrt()
            }
            Region::Ball { radius, .. } => 2.0 * radius,
        };
        let spacing = options.resolution.unwrap_or((diagonal / FINENESS).max(LEAST_SPACING));
        let mut sigmas: Vec<f64> = inside.iter().map(|o| o.sigma).collect();
        sigmas.sort_by(f64::total_cmp);
        let Some(&sigma) = sigmas.get(sigmas.len() / 2) else {
            let place = format!("{example:?}");
            return Err(Error::invalid("region", place, "where the model has words"));
        };
        let tolerance = options.tolerance.unwrap_or(sigma.max(0.25 * spacing));
        let surface = Surface::of(self, spacing, progress)?;
        let tree = KdTree::new(&surface.points)?;
        let color_tolerance = options.color_tolerance.filter(|_| surface.colors.is_some());
        // What lies flush is one piece with its wall: where colours tell things apart, pieces do not.
        let (pieces, sizes) = match color_tolerance {
            Some(_) => ((0..surface.len() as u32).collect(), vec![1; surface.len()]),
            None => surface.pieces(&tree, progress)?,
        };
        progress.check()?;
        let scene = Place { surface: &surface, tree: &tree, pieces: &pieces, sizes: &sizes };
        let Some(template) = Template::new(&scene, &region, tolerance, color_tolerance, diagonal)?
        else {
            let place = format!("{example:?}");
            return Err(Error::invalid("region", place, "where the model has a surface"));
        };
        progress.update("guessing motions", 0.2);
        let guesses = guesses(self, &scene, &template, progress)?;
        progress.update("refining motions", 0.4);
        let mut motions: Vec<(f64, Motion)> = guesses
            .into_par_iter()
            .map(|motion| {
                progress.check()?;
                let motion = template.refined(
                    &scene,
                    motion,
                    REFINED[0],
                    [0.12 * diagonal, 3.0 * tolerance],
                    6,
                );
                let matches = template.matches(&scene, &motion, 2.0 * tolerance, REFINED[0]);
                Ok((share(&matches, &template.weights), motion))
            })
            .collect::<Result<_>>()?;
        template.keep_apart(&mut motions, 0.25, FINALISTS);
        progress.update("scoring places", 0.7);
        let motions: Vec<(Motion, Vec<f32>)> = motions
            .into_par_iter()
            .map(|(_, motion)| {
                progress.check()?;
                let reach = [6.0 * tolerance, tolerance];
                let mut motion = template.refined(&scene, motion, REFINED[1], reach, 8);
                if color_tolerance.is_some() {
                    motion = template.slid(&scene, motion);
                }
                Ok((motion, template.matches(&scene, &motion, tolerance, MATCHED)))
            })
            .collect::<Result<_>>()?;
        let rarity = template.rarity(&motions);
        let mut finals: Vec<(f64, Motion)> = motions
            .par_iter()
            .map(|(motion, matches)| {
                progress.check()?;
                Ok((template.score(&scene, motion, matches, &rarity), *motion))
            })
            .collect::<Result<_>>()?;
        finals.push((1.0, Motion { yaw: 0.0, shift: [0.0; 3] }));
        finals.retain(|(score, _)| *score >= options.min_score);
        template.keep_apart(&mut finals, 1.0, options.max_found);
        let middle = example.center();
        let found = |(score, motion): (f64, Motion)| {
            let pose = template.pose(&motion, origin)?;
            Ok(Found { pose, score, center: pose.apply(middle) })
        };
        finals.into_iter().map(found).collect()
    }
}

/// The samples of a scene.
struct Place<'a> {
    surface: &'a Surface,
    tree: &'a KdTree,
    pieces: &'a [u32],
    sizes: &'a [u32],
}

impl Place<'_> {
    /// Samples of the i-th sample's piece.
    fn size(&self, i: usize) -> f64 {
        f64::from(self.sizes[self.pieces[i] as usize])
    }

    /// The root of the share of its piece that lies among `samples`, per sample.
    fn shares(&self, samples: &[u32]) -> Vec<f64> {
        let mut pieces: Vec<u32> = samples.iter().map(|&i| self.pieces[i as usize]).collect();
        pieces.sort_unstable();
        let share = |&i: &u32| {
            let piece = self.pieces[i as usize];
            let n =
                pieces.partition_point(|&p| p <= piece) - pieces.partition_point(|&p| p < piece);
            (n as f64 / f64::from(self.sizes[piece as usize])).sqrt()
        };
        samples.iter().map(share).collect()
    }
}

/// A turn about the vertical through the template's pivot, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion {
    yaw: f64,
    shift: [f64; 3],
}

impl Motion {
    fn turned(&self, p: [f32; 3]) -> [f64; 3] {
        let (s, c) = self.yaw.sin_cos();
        let [x, y, z] = p.map(f64::from);
        [c * x - s * y, s * x + c * y, z]
    }
}

/// What to look for: samples about a pivot.
struct Template {
    region: Region,
    pivot: [f64; 3],
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Which samples of the scene they are.
    samples: Vec<u32>,
    /// Samples of each sample's piece.
    sizes: Vec<f64>,
    /// The share of each sample's piece that lies in the region.
    weights: Vec<f64>,
    tree: KdTree,
    tolerance: f64,
    color_tolerance: Option<f64>,
    spacing: f64,
    diagonal: f64,
    /// Farthest sample from the pivot.
    reach: f64,
}

impl Template {
    fn new(
        scene: &Place,
        region: &Region,
        tolerance: f64,
        color_tolerance: Option<f64>,
        diagonal: f64,
    ) -> Result<Option<Self>> {
        let surface = scene.surface;
        let mut inside: Vec<u32> = (0..surface.len() as u32)
            .filter(|&i| region.contains(surface.points[i as usize].map(f64::from)))
            .collect();
        let weights = scene.shares(&inside);
        // A fixed shuffle, so that any first so many stand for all.
        let mut shuffled: Vec<(u64, u32, f64)> = inside
            .iter()
            .zip(weights)
            .map(|(&i, w)| (u64::from(i).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32), i, w))
            .collect();
        shuffled.sort_by_key(|s| (s.0, s.1));
        inside = shuffled.iter().map(|s| s.1).collect();
        let weights: Vec<f64> = shuffled.iter().map(|s| s.2).collect();
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Ok(None);
        }
        let pivot: [f64; 3] = std::array::from_fn(|a| {
            let at = |(&i, w): (&u32, &f64)| w * f64::from(surface.points[i as usize][a]);
            inside.iter().zip(&weights).map(at).sum::<f64>() / total
        });
        let points: Vec<[f32; 3]> = inside
            .iter()
            .map(|&i| {
                let p = surface.points[i as usize];
                std::array::from_fn(|a| (f64::from(p[a]) - pivot[a]) as f32)
            })
            .collect();
        let reach = points.iter().map(|&p| f64::from(dot(p, p))).fold(0.0, f64::max).sqrt();
        Ok(Some(Self {
            region: *region,
            pivot,
            normals: inside.iter().map(|&i| surface.normals[i as usize]).collect(),
            color_tolerance,
            sizes: inside.iter().map(|&i| scene.size(i as usize)).collect(),
            tree: KdTree::new(&points)?,
            points,
            weights,
            samples: inside,
            tolerance,
            spacing: surface.spacing,
            diagonal,
            reach,
        }))
    }

    fn moved(&self, motion: &Motion, i: usize) -> [f32; 3] {
        let turned = motion.turned(self.points[i]);
        std::array::from_fn(|a| (turned[a] + self.pivot[a] + motion.shift[a]) as f32)
    }

    /// How near a surface with a normal comes to a point that is `d` away from one of its samples, and whether the
    /// normals are alike: 1 to 0.
    fn nearness(&self, d: [f32; 3], normal: [f32; 3], other: [f32; 3], tolerance: f64) -> f64 {
        if dot(normal, other).abs() < ALIKE {
            return 0.0;
        }
        let along = f64::from(dot(d, normal));
        let beside = (f64::from(dot(d, d)) - along * along).max(0.0).sqrt();
        let gap = (beside - self.spacing).max(0.0);
        (-0.5 * (along * along + gap * gap) / (tolerance * tolerance)).exp()
    }

    /// How alike the i-th sample and the j-th of the scene are in the sizes of their pieces and in colour, 1 to 0.
    fn alike(&self, scene: &Place, i: usize, j: usize) -> f64 {
        let size = alike(self.sizes[i], scene.size(j));
        let colors = |t| scene.surface.alike(self.samples[i] as usize, j, t);
        size * self.color_tolerance.map_or(1.0, colors)
    }

    /// How near the scene comes to each of the first `n` samples there, 1 to 0.
    fn matches(&self, scene: &Place, motion: &Motion, tolerance: f64, n: usize) -> Vec<f32> {
        let near = |i: usize| {
            let p = self.moved(motion, i);
            let Some(near) = scene.tree.nearest(p) else { return 0.0 };
            if f64::from(near.squared_distance()).sqrt() > 4.0 * tolerance + self.spacing {
                return 0.0;
            }
            let q = scene.surface.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let turned = motion.turned(self.normals[i]).map(|c| c as f32);
            let normal = scene.surface.normals[near.index()];
            let like = self.alike(scene, i, near.index());
            (like * self.nearness(d, normal, turned, tolerance)) as f32
        };
        (0..self.points.len().min(n)).map(near).collect()
    }

    /// How much each sample tells: the logarithm of how seldom it is met, among motions that are mostly wrong.
    fn rarity(&self, motions: &[(Motion, Vec<f32>)]) -> Vec<f64> {
        let n = motions.len() as f64 + 1.0;
        let met = |i: usize| motions.iter().map(|(_, m)| f64::from(m[i])).sum::<f64>();
        // Half a motion that meets nothing: what is always met still counts a little.
        let tells = |i| -((met(i) + 0.5) / n).clamp(RAREST, 1.0 - 0.5 / n).ln();
        let n_samples = self.points.len().min(MATCHED);
        (0..n_samples).map(|i| self.weights[i] * tells(i)).collect()
    }

    /// The share of what the scene has in the region there, by weight, that the example explains.
    fn explained(&self, scene: &Place, motion: &Motion, tolerance: f64) -> f64 {
        let center: [f32; 3] = std::array::from_fn(|a| (self.pivot[a] + motion.shift[a]) as f32);
        let mut near: Vec<Neighbor> = Vec::new();
        scene.tree.within(center, self.reach as f32, &mut near);
        let back = Motion { yaw: -motion.yaw, shift: [0.0; 3] };
        let place = |i: u32| {
            let p = scene.surface.points[i as usize];
            let d = std::array::from_fn(|a| p[a] - center[a]);
            back.turned(d)
        };
        let mut there: Vec<u32> = near.iter().map(|n| n.index() as u32).collect();
        there.retain(|&i| {
            let p = place(i);
            self.region.contains(std::array::from_fn(|a| p[a] + self.pivot[a]))
        });
        let weights = scene.shares(&there);
        let (mut sum, mut all) = (0.0, 0.0);
        for (&i, weight) in there.iter().zip(weights) {
            all += weight;
            let p = place(i).map(|c| c as f32);
            let Some(near) = self.tree.nearest(p) else { continue };
            let q = self.points[near.index()];
            let d = std::array::from_fn(|a| p[a] - q[a]);
            let turned = back.turned(scene.surface.normals[i as usize]).map(|c| c as f32);
            let like = self.alike(scene, near.index(), i as usize);
            sum += weight * like * self.nearness(d, self.normals[near.index()], turned, tolerance);
        }
        sum / all.max(f64::MIN_POSITIVE)
    }

    fn score(&self, scene: &Place, motion: &Motion, matches: &[f32], rarity: &[f64]) -> f64 {
        let found = share(matches, rarity);
        let explained = self.explained(scene, motion, self.tolerance);
        (found * explained).sqrt()
    }

    /// Improves a motion on the first `n` samples: Gauss-Newton steps on the distances to the nearest samples of the
    /// scene, those farther than a reach that falls from the first to the second of `reach` left out.
    fn refined(
        &self,
        scene: &Place,
        start: Motion,
        n: usize,
        reach: [f64; 2],
        steps: usize,
    ) -> Motion {
        let n = self.points.len().min(n);
        let mut motion = start;
        for step in 0..steps {
            let at = step as f64 / (steps - 1).max(1) as f64;
            let limit = reach[0] * (reach[1] / reach[0]).powf(at);
            let (mut matrix, mut vector) = (Matrix4::zeros(), Vector4::zeros());
            let mut all = 0.0;
            for i in 0..n {
                let p = self.moved(&motion, i);
                let Some(near) = scene.tree.nearest(p) else { continue };
                let normal = scene.surface.normals[near.index()].map(f64::from);
                let q = scene.surface.points[near.index()];
                let d: [f64; 3] = std::array::from_fn(|a| f64::from(p[a] - q[a]));
                let squared: f64 = d.iter().map(|c| c * c).sum();
                if squared > (limit + self.spacing).powi(2) {
                    continue;
                }
                let turned = motion.turned(self.normals[i]);
                let cosine: f64 = (0..3).map(|a| turned[a] * normal[a]).sum();
                if cosine.abs() < f64::from(ALIKE) {
                    continue;
                }
                let along: f64 = (0..3).map(|a| d[a] * normal[a]).sum();
                let weight = self.weights[i] / (1.0 + squared / (limit * limit));
                // The turn moves a point at right angles to its arm.
                let arm = motion.turned(self.points[i]);
                let turn = [-arm[1], arm[0], 0.0];
                let mut add = |direction: [f64; 3], residual: f64, weight: f64| {
                    let across = (0..3).map(|a| direction[a] * turn[a]).sum::<f64>();
                    let row = Vector4::new(direction[0], direction[1], direction[2], across);
                    matrix += weight * row * row.transpose();
                    vector -= weight * residual * row;
                };
                add(normal, along, weight);
                // Along the surface the nearest sample says little: a tenth.
                for a in 0..3 {
                    let mut axis = [0.0; 3];
                    axis[a] = 1.0;
                    add(axis, d[a] - along * normal[a], 0.1 * weight);
                }
                all += weight;
            }
            // Holds what no surface tells.
            let hold = 1e-3 * all + 1e-12;
            for k in 0..4 {
                matrix[(k, k)] += if k == 3 { hold * self.reach * self.reach } else { hold };
            }
            let Some(solver) = matrix.cholesky() else { break };
            let by = solver.solve(&vector);
            (0..3).for_each(|a| motion.shift[a] += by[a]);
            motion.yaw += by[3];
        }
        motion
    }

    /// A motion shifted to where more matches: surfaces hold nothing along themselves, colours do.
    fn slid(&self, scene: &Place, start: Motion) -> Motion {
        let worth = |motion: &Motion| {
            share(&self.matches(scene, motion, self.tolerance, REFINED[1]), &self.weights)
        };
        let mut best = (worth(&start), start);
        for step in SLIDES.map(|share| share * self.diagonal) {
            for axis in 0..3 {
                for by in [-step, step] {
                    let mut motion = best.1;
                    motion.shift[axis] += by;
                    let value = worth(&motion);
                    if value > best.0 {
                        best = (value, motion);
                    }
                }
            }
        }
        best.1
    }

    /// The best of motions that take the pivot to nearly one place (times `share`), at most `most`.
    fn keep_apart(&self, motions: &mut Vec<(f64, Motion)>, share: f64, most: usize) {
        let order = |m: &Motion| [m.shift[0], m.shift[1], m.shift[2], m.yaw];
        motions.sort_by(|a, b| {
            let [p, q] = [order(&a.1), order(&b.1)];
            let ties = (0..4).map(|k| p[k].total_cmp(&q[k]));
            ties.fold(b.0.total_cmp(&a.0), std::cmp::Ordering::then)
        });
        let limit = (APART * share * self.diagonal).powi(2);
        let mut kept: Vec<(f64, Motion)> = Vec::new();
        for m in motions.iter() {
            let near = |k: &(f64, Motion)| {
                let far: f64 = (0..3).map(|a| (k.1.shift[a] - m.1.shift[a]).powi(2)).sum();
                // Before the end, one place may keep several directions.
                let turn = (k.1.yaw - m.1.yaw).rem_euclid(TAU);
                if share >= 1.0 {
                    return far < limit || self.overlap(&k.1, &m.1) > OVERLAP;
                }
                far < limit && turn.min(TAU - turn) < FRAC_PI_8
            };
            if kept.len() == most {
                break;
            }
            if !kept.iter().any(near) {
                kept.push(*m);
            }
        }
        *motions = kept;
    }

    /// The share of the example that `other` takes to where `motion` takes its region.
    fn overlap(&self, motion: &Motion, other: &Motion) -> f64 {
        let back = Motion { yaw: -motion.yaw, shift: [0.0; 3] };
        let n = self.points.len().min(REFINED[1]);
        let inside = |i: usize| {
            let p = self.moved(other, i).map(f64::from);
            let d = std::array::from_fn(|a| (p[a] - self.pivot[a] - motion.shift[a]) as f32);
            let turned = back.turned(d);
            self.region.contains(std::array::from_fn(|a| turned[a] + self.pivot[a]))
        };
        (0..n).filter(|&i| inside(i)).count() as f64 / n as f64
    }

    /// In world coordinates.
    fn pose(&self, motion: &Motion, origin: [f64; 3]) -> Result<Pose> {
        let (s, c) = motion.yaw.sin_cos();
        let rows = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        // About the pivot in the world.
        let pivot: [f64; 3] = std::array::from_fn(|a| self.pivot[a] + origin[a]);
        let shift = std::array::from_fn(|a| {
            let turned: f64 = (0..3).map(|k| rows[a][k] * pivot[k]).sum();
            pivot[a] - turned + motion.shift[a]
        });
        Ok(Pose::new(rows, shift)?)
    }
}

/// How alike pieces of so many samples are, 1 to 0: parts of things are hidden, but a seat is no floor.
fn alike(a: f64, b: f64) -> f64 {
    (SEEN / a.max(b) * a.min(b)).min(1.0).sqrt()
}

/// The share of `weights` that matches.
fn share(matches: &[f32], weights: &[f64]) -> f64 {
    let (mut sum, mut all) = (0.0, f64::MIN_POSITIVE);
    for (&m, &w) in matches.iter().zip(weights) {
        sum += w * f64::from(m);
        all += w;
    }
    sum / all
}

/// Where there is a surface, and how steep: a bit per cell.
struct Occupancy {
    low: [f32; 3],
    per_cell: f32,
    size: [usize; 3],
    steep: Vec<u64>,
    level: Vec<u64>,
}

/// Most cells, 32 MiB of bits.
const CELLS: f64 = (1_u64 << 28) as f64;

impl Occupancy {
    /// Cells of at least `side` metres; those next to an occupied one are occupied too.
    fn new(surface: &Surface, side: f64, counts: impl Fn(usize) -> bool) -> Self {
        let bound = |pick: fn(f32, f32) -> f32, from: f32| -> [f32; 3] {
            std::array::from_fn(|a| surface.points.iter().map(|p| p[a]).fold(from, pick))
        };
        let [low, high] = [bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY)];
        let mut side = side;
        let cells = |side: f64| -> [f64; 3] {
            std::array::from_fn(|a| (f64::from(high[a] - low[a]) / side).floor() + 5.0)
        };
        while cells(side).iter().product::<f64>() > CELLS {
            side *= 1.25;
        }
        let size = cells(side).map(|c| c as usize);
        let words = size.iter().product::<usize>().div_ceil(64);
        let mut grid = Self {
            low: low.map(|c| c - 2.0 * side as f32),
            per_cell: 1.0 / side as f32,
            size,
            steep: vec![0; words],
            level: vec![0; words],
        };
        for (i, (p, n)) in surface.points.iter().zip(&surface.normals).enumerate() {
            if !counts(i) {
                continue;
            }
            let cell: [usize; 3] =
                std::array::from_fn(|a| ((p[a] - grid.low[a]) * grid.per_cell) as usize);
            let middle = (cell[2] * size[1] + cell[1]) * size[0] + cell[0];
            let row = size[0];
            let layer = size[0] * size[1];
            // Two cells lie around every sample.
            let around = [
                middle,
                middle - 1,
                middle + 1,
                middle - row,
                middle + row,
                middle - layer,
                middle + layer,
            ];
            for k in around {
                if n[2].abs() < 0.85 {
                    grid.steep[k / 64] |= 1 << (k % 64);
                }
                if n[2].abs() > 0.5 {
                    grid.level[k / 64] |= 1 << (k % 64);
                }
            }
        }
        grid
    }

    fn has(&self, p: [f32; 3], level: bool) -> bool {
        let cell: [f32; 3] = std::array::from_fn(|a| (p[a] - self.low[a]) * self.per_cell);
        if !(0..3).all(|a| cell[a] >= 0.0 && cell[a] < self.size[a] as f32) {
            return false;
        }
        let [x, y, z] = cell.map(|c| c as usize);
        let k = (z * self.size[1] + y) * self.size[0] + x;
        let bits = if level { &self.level } else { &self.steep };
        bits[k / 64] >> (k % 64) & 1 != 0
    }
}

/// The most promising motions: every pair of an occurrence in the example and one of its radius or the next and of its
/// inclination anywhere gives one, and the opposite one, since thin things look alike from both sides.
fn guesses(
    model: &AlphabetModel,
    scene: &Place,
    template: &Template,
    progress: &dyn Progress,
) -> Result<Vec<Motion>> {
    let origin = model.header().origin;
    let all: Vec<Occurrence> = model
        .occurrences()
        .map(|o| Occurrence { center: std::array::from_fn(|a| o.center[a] - origin[a]), ..o })
        .collect();
    let inside: Vec<u32> = (0..scene.surface.len() as u32)
        .filter(|&i| template.region.contains(scene.surface.points[i as usize].map(f64::from)))
        .collect();
    // What an occurrence is worth as a seed: the mean weight of its samples in the region.
    let mut worth = vec![(0.0, 0.0); all.len()];
    for (&i, weight) in inside.iter().zip(scene.shares(&inside)) {
        let (sum, n) = &mut worth[scene.surface.occurrences[i as usize] as usize];
        *sum += weight;
        *n += 1.0;
    }
    let mut seeds: Vec<(f64, usize)> = worth
        .iter()
        .enumerate()
        .filter(|(k, (_, n))| *n > 0.0 && template.region.contains(all[*k].center))
        .map(|(k, (sum, n))| (sum / n, k))
        .collect();
    let any_steep = seeds.iter().any(|&(_, k)| all[k].rows[2][2].abs() < LEVEL);
    seeds.retain(|&(_, k)| !any_steep || all[k].rows[2][2].abs() < LEVEL);
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    seeds.truncate(SEEDS);
    let side = (2.0 * template.spacing).max(0.03 * template.diagonal).max(template.tolerance);
    // Whole pieces of the example are not looked for in much larger ones.
    let whole = template.sizes.iter().zip(&template.weights).filter(|(_, w)| **w > 0.7);
    let largest = whole.map(|(size, _)| *size).fold(0.0, f64::max);
    let limit = if largest > 0.0 { COMPACT * largest } else { f64::INFINITY };
    let compact = |i: usize| scene.size(i) <= limit;
    let grid = Occupancy::new(scene.surface, side, compact);
    let mut eligible = vec![false; all.len()];
    for (i, &o) in scene.surface.occurrences.iter().enumerate() {
        eligible[o as usize] |= compact(i);
    }
    let tried = template.points.len().min(4 * TRIED);
    // Of the first samples, those that weigh most.
    let mut trial: Vec<usize> = (0..tried).collect();
    trial.sort_by(|&i, &j| template.weights[j].total_cmp(&template.weights[i]).then(i.cmp(&j)));
    trial.truncate(TRIED);
    let total: f64 = trial.iter().map(|&i| template.weights[i]).sum();
    let share = |motion: &Motion| {
        let mut sum = 0.0;
        for &i in &trial {
            let level = template.normals[i][2].abs() > 0.68;
            if grid.has(template.moved(motion, i), level) {
                sum += template.weights[i];
            }
        }
        sum / total
    };
    let hues = surface::hues(model);
    let same_color = |i: usize, j: usize| match (&hues, template.color_tolerance) {
        (Some(hues), Some(tolerance)) => surface::alike(hues[i], hues[j], tolerance) > SAME_COLOR,
        _ => true,
    };
    let mut motions: Vec<(f64, Motion)> = seeds
        .par_iter()
        .map(|&(_, k)| {
            progress.check()?;
            let e = &all[k];
            let mut best = Vec::new();
            let there = (0..all.len()).filter(|&j| eligible[j] && same_color(k, j));
            for s in there.map(|j| &all[j]) {
                let ratio = s.radius / e.radius;
                if (s.rows[2][2].abs() - e.rows[2][2].abs()).abs() > 0.3
                    || !(0.4..2.5).contains(&ratio)
                {
                    continue;
                }
                let heading = |o: &Occurrence| o.rows[2][1].atan2(o.rows[2][0]);
                let turns: Vec<f64> = if any_steep {
                    let turn = heading(s) - heading(e);
                    vec![turn, turn + PI]
                } else {
                    (0..16).map(|i| f64::from(i) * FRAC_PI_8).collect()
                };
                for yaw in turns {
                    let arm = std::array::from_fn(|a| (e.center[a] - template.pivot[a]) as f32);
                    let mut motion = Motion { yaw, shift: [0.0; 3] };
                    let turned = motion.turned(arm);
                    motion.shift =
                        std::array::from_fn(|a| s.center[a] - turned[a] - template.pivot[a]);
                    let share = share(&motion);
                    if share > 0.3 {
                        best.push((share, motion));
                    }
                }
            }
            Ok(best)
        })
        .collect::<Result<Vec<_>>>()?
        .concat();
    // One guess per cell and direction.
    let bin = |m: &Motion| {
        let turn = (m.yaw.rem_euclid(TAU) / (0.5 * FRAC_PI_8)).floor() as i64;
        (m.shift.map(|c| (c / side).floor() as i64), turn)
    };
    motions.sort_by(|a, b| {
        let ties = (0..3).map(|k| a.1.shift[k].total_cmp(&b.1.shift[k]));
        let order = bin(&a.1).cmp(&bin(&b.1)).then(b.0.total_cmp(&a.0));
        ties.fold(order, std::cmp::Ordering::then).then(a.1.yaw.total_cmp(&b.1.yaw))
    });
    motions.dedup_by(|a, b| bin(&a.1) == bin(&b.1));
    motions.sort_by(|a, b| b.0.total_cmp(&a.0));
    motions.truncate(GUESSES);
    Ok(motions.into_iter().map(|m| m.1).collect())
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{PointCloud, Silent};

    use super::*;
    use crate::alphabet::Deviation;
    use crate::alphabet::mdl::{MdlOptions, learn};

    /// Where the things stand: x, y, yaw.
    const PLACES: [[f64; 3]; 3] = [[-1.0, -0.9, 0.2], [1.0, -0.7, 1.4], [0.1, 1.1, 3.7]];

    /// A seat with a back and one arm, so that it looks the same in no other direction, as rectangles: corner, two
    /// edges.
    const THING: [[[f64; 3]; 3]; 3] = [
        [[-0.25, -0.25, 0.45], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        [[-0.25, -0.25, 0.45], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]],
        [[-0.25, -0.25, 0.45], [0.0, 0.4, 0.0], [0.0, 0.0, 0.2]],
    ];

    fn placed([x, y, yaw]: [f64; 3], p: [f64; 3]) -> [f64; 3] {
        let (s, c) = yaw.sin_cos();
        [x + c * p[0] - s * p[1], y + s * p[0] + c * p[1], p[2]]
    }

    /// Three things on a floor, and a box that is none.
    fn model() -> AlphabetModel {
        let mut points = Vec::new();
        let mut rectangle = |place: [f64; 3], [corner, right, up]: [[f64; 3]; 3]| {
            let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
            let n = [right, up].map(|v| (length(v) / 0.015).round() as usize);
            for i in 0..n[0] * n[1] {
                let s = ((i % n[0]) as f64 + 0.5) / n[0] as f64;
                let t = ((i / n[0]) as f64 + 0.5) / n[1] as f64;
                let p = std::array::from_fn(|a| corner[a] + s * right[a] + t * up[a]);
                points.push(placed(place, p).map(|c| c as f32));
            }
        };
        rectangle([0.0; 3], [[-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
        for place in PLACES {
            THING.iter().for_each(|&r| rectangle(place, r));
        }
        let other = [-1.2, 1.2, 0.4];
        rectangle(other, [[0.0, 0.0, 0.6], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]]);
        rectangle(other, [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.0, 0.6]]);
        let (cloud, _) = PointCloud::from_positions(points);
        let deviation = Deviation { scale: 1.0, noise: Some(0.008), ..Deviation::default() };
        learn(&cloud, &MdlOptions { deviation, ..MdlOptions::default() }, &Silent).unwrap()
    }

    fn example() -> Region {
        let [x, y, _] = PLACES[0];
        Region::Box { low: [x - 0.4, y - 0.4, 0.1], high: [x + 0.4, y + 0.4, 1.0] }
    }

    #[test]
    fn equal_things_are_found_with_their_poses() {
        let model = model();
        let found = model.find(&example(), &FindOptions::default(), &Silent).unwrap();
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(found[0].pose, Pose::identity());
        assert_eq!(found[0].score, 1.0);
        assert!(found.windows(2).all(|w| w[0].score >= w[1].score));
        for to in &PLACES[1..] {
            let right = |f: &&Found| {
                let corners = [[0.25, -0.25, 0.45], [-0.25, 0.25, 0.45], [-0.25, -0.25, 0.95]];
                corners.iter().all(|&p| {
                    let [at, should] = [f.pose.apply(placed(PLACES[0], p)), placed(*to, p)];
                    (0..3).map(|a| (at[a] - should[a]).powi(2)).sum::<f64>() < 0.03_f64.powi(2)
                })
            };
            assert_eq!(found.iter().filter(right).count(), 1, "{to:?}: {found:?}");
        }
    }

    #[test]
    fn the_number_of_threads_is_of_no_account() {
        let model = model();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| model.find(&example(), &FindOptions::default(), &Silent).unwrap())
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn regions_without_room_or_words_are_refused() {
        let model = model();
        let find = |region: Region| model.find(&region, &FindOptions::default(), &Silent);
        let nowhere = Region::Ball { center: [50.0, 0.0, 0.0], radius: 1.0 };
        let flat = Region::Box { low: [0.0; 3], high: [1.0, 0.0, 1.0] };
        let none = Region::Ball { center: [0.0; 3], radius: f64::NAN };
        for region in [nowhere, flat, none] {
            assert!(matches!(find(region), Err(Error::InvalidParameter { .. })), "{region:?}");
        }
        let options = FindOptions { min_score: 1.5, ..FindOptions::default() };
        assert!(model.find(&example(), &options, &Silent).is_err());
    }
}
