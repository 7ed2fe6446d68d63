//! Split and merge EM patch fitting, SMEMPF: EMPF, split, EMPF, merge, until distances are stable (section II-B).

mod e_step;
mod grid_size;
mod grouped;
mod incidence;
mod largest_first;
mod likelihood;
mod m_step;
mod merge;
mod published;
mod removal;
mod responsibilities;
mod seed;
mod split;
mod surface;
mod trim;

use surfabet_base::parallel;
use surfabet_geom::Progress;

use self::e_step::e_step;
pub use self::e_step::weight_scale;
pub(super) use self::e_step::{NONE, supports, supports_everywhere};
use self::grid_size::deviation;
use self::incidence::Incidence;
use self::largest_first::largest_first;
use self::likelihood::{Limits, refine};
pub use self::m_step::Regression;
pub(super) use self::m_step::plane;
use self::m_step::{clear_m_step, m_step};
use self::merge::{PlanarSet, Rule, close_pairs, merge};
pub(super) use self::published::PublishedFit;
use self::removal::{removals, superfluous};
pub use self::responsibilities::Responsibilities;
pub(super) use self::seed::random;
use self::split::{SplitRule, split};
use self::surface::{Evidence, Judged};
pub(super) use self::trim::mean_square;
use self::trim::{facing, outline, trim, trim_to};
use super::constants::{
    CLEAR_PASSES, CLEAR_SIGMAS, COARSER_LEVELS, FIGURES, LARGE_PATCH, LARGE_SHARE,
    LEAST_GRID_SIZE_SIGMAS, LEAST_NOISE, LEAST_PATCH_POINTS, LEAST_SCALE, MOST_DEVIATION,
    PART_SHARE, POINTS_PER_PATCH_POINT, SIGMAS_PER_GRID_SIZE,
};
use super::options::PlanesOptions;
use super::patch::{Frame, Patch};
use super::points::Points;
use super::tiles::Tiles;
use crate::error::Result;
use crate::options::Options;
use crate::vector::dot;

/// The state of a fit, to be moved on step by step.
#[derive(Debug, Clone)]
pub struct Fit<'a> {
    points: &'a Points,
    options: PlanesOptions,
    min_points: usize,
    smallest_grid_size: f64,
    grid_size: f64,
    /// Standard deviation of the distances, metres.
    deviation: f64,
    /// Standard deviation of the points across their surfaces, before any patch is known, metres; zero where it is not.
    noise: f64,
    /// What the deviation counts as at most, metres: patches of several surfaces must not make G so large that these merge.
    most_deviation: f64,
    /// How the noise depends on the angle at which surfaces were seen.
    incidence: Incidence,
    patches: Vec<Patch>,
    /// The points of each patch that was judged to be no surface.
    improbable: Vec<Vec<u32>>,
}

/// A patch before it is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// What the judge gets of it: logarithms of figures.
    pub inputs: [f64; FIGURES],
    /// The distinct points that support it, ascending.
    pub points: Vec<u32>,
}

/// One iteration in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Number of patches after it.
    pub patches: usize,
    /// Grid size (G), metres.
    pub grid_size: f64,
    /// Mean distance of supporting points to their patches, metres.
    pub mean_distance: f64,
    /// Share of the distinct points that support a patch.
    pub supporting: f64,
}

/// How a fit went.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Each iteration in numbers.
    pub iterations: Vec<Iteration>,
    /// Why it ended.
    pub stop_reason: &'static str,
}

impl<'a> Fit<'a> {
    /// A fit with the patches to start from.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] for options outside their domain, [`crate::Error::Cancelled`].
    pub fn new(
        points: &'a Points,
        options: &PlanesOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        options.check()?;
        let noise = seed::noise(points);
        // Without this bound EM may lay several patches into the thickness of one noisy surface: each fits its slice
        // well, G shrinks to the slice, and no two merge.
        let known = noise.map_or(0.0, |n| LEAST_GRID_SIZE_SIGMAS * n.0);
        let by_data = options.quality.scale() * points.spacing().max(known);
        let smallest = options.min_grid_size.unwrap_or(by_data);
        let by_default = (points.len() / POINTS_PER_PATCH_POINT).max(LEAST_PATCH_POINTS);
        let mut fit = Self {
            points,
            options: options.clone(),
            min_points: options.min_points.unwrap_or(by_default),
            smallest_grid_size: smallest,
            grid_size: smallest,
            deviation: 0.0,
            noise: noise.map_or(0.0, |n| n.0),
            most_deviation: f64::INFINITY,
            incidence: noise.map_or(Incidence::EVEN, |n| n.1),
            patches: Vec::new(),
            improbable: Vec::new(),
        };
        if options.initial_patches > 0 {
            fit.patches = random(points, options.initial_patches, options.random_state);
            fit.grid_size = fit.first_grid_size().max(smallest);
            fit.deviation = fit.grid_size / SIGMAS_PER_GRID_SIZE;
        } else if let Some((noise, _)) = noise {
            fit.grid_size = (SIGMAS_PER_GRID_SIZE * noise).max(smallest);
            fit.deviation = noise;
            fit.most_deviation = (MOST_DEVIATION * noise).max(smallest / SIGMAS_PER_GRID_SIZE);
            fit.add_patches(0, progress)?;
        } else {
            // So few points that no cells are flat, or nothing is.
            let (rule, least) = (fit.merge_rule(), fit.part_points());
            fit.patches = seed::from_neighborhoods(points, &rule, least, progress)?;
        }
        Ok(fit)
    }

    /// The grid size that the learned one does not fall below, metres.
    pub fn smallest_grid_size(&self) -> f64 {
        self.smallest_grid_size
    }

    /// The patches as they are now.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// The patches at the end, and the points of each that was judged to be no surface.
    pub(super) fn into_patches(self) -> (Vec<Patch>, Vec<Vec<u32>>) {
        (self.patches, self.improbable)
    }

    /// The grid size G, metres.
    pub fn grid_size(&self) -> f64 {
        self.grid_size
    }

    /// Number of points that a patch needs to be kept.
    pub fn min_points(&self) -> usize {
        self.min_points
    }

    /// Number of points that a patch needs as long as the fit goes on: what is to be left out in the end has to be split off
    /// before, and cells at the rims of a surface hold points of others too.
    fn part_points(&self) -> usize {
        let part = (PART_SHARE * self.min_points as f64) as usize;
        part.max(LEAST_PATCH_POINTS.min(self.min_points))
    }

    /// Iterates until the fit is stable and no flat points are left without a patch, then removes what is no surface.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn run(&mut self, progress: &dyn Progress) -> Result<Trace> {
        let trace = self.settle(progress)?;
        self.finish(progress)?;
        Ok(trace)
    }

    /// Iterates until the fit is stable and no flat points are left without a patch.
    fn settle(&mut self, progress: &dyn Progress) -> Result<Trace> {
        let most = self.options.max_iterations;
        let mut iterations: Vec<Iteration> = Vec::new();
        let mut stop_reason = "reached the largest number of iterations";
        // Patches are added once to a stable fit, which then has to become stable once more.
        let mut complete = false;
        for i in 0..most {
            progress.update("fitting", i as f32 / most as f32);
            let now = self.iterate(progress)?;
            let tolerance = self.options.tolerance;
            let is_stable = iterations.last().is_some_and(|last| stable(last, &now, tolerance));
            iterations.push(now);
            let mut done = is_stable && complete;
            if !done && (is_stable || (i + 1) % self.options.new_patches_every == 0) {
                let added = self.add_patches(COARSER_LEVELS, progress)?;
                complete = is_stable;
                done = is_stable && added == 0;
            }
            if done {
                stop_reason = "distances to the patches are stable";
                break;
            }
        }
        Ok(Trace { iterations, stop_reason })
    }

    /// One iteration: EMPF, split, EMPF, merge (section II-B).
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn iterate(&mut self, progress: &dyn Progress) -> Result<Iteration> {
        self.em(progress)?;
        self.split(progress)?;
        let last = self.em(progress)?;
        self.remove_superfluous(progress)?;
        self.merge(progress)?;
        let (mean_distance, supporting) = last.fit();
        let (patches, grid_size) = (self.patches.len(), self.grid_size);
        Ok(Iteration { patches, grid_size, mean_distance, supporting })
    }

    /// E-step, M-step and trimming (EMPF, section II-A), as often as the options say. Gives the last probabilities.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn em(&mut self, progress: &dyn Progress) -> Result<Responsibilities> {
        let mut last = Responsibilities::default();
        let steps = self.options.em_steps;
        for step in 1..=steps {
            last = self.e_step(progress)?;
            let planes = self.m_step(&last);
            self.trim_by(if step < steps { outline } else { trim }, &planes, &last);
        }
        Ok(last)
    }

    /// E-step with the patches as they are.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn e_step(&self, progress: &dyn Progress) -> Result<Responsibilities> {
        let (s, factors) = (self.weight_scale(), self.noise_factors());
        e_step(self.points, &self.patches, self.grid_size, s, Some(&factors), progress)
    }

    /// The patch that each point supports.
    fn supports(&self, progress: &dyn Progress) -> Result<Vec<u32>> {
        let (s, factors) = (self.weight_scale(), self.noise_factors());
        supports(self.points, &self.patches, self.grid_size, s, Some(&factors), progress)
    }

    /// The scale S of the weights. Where G is bounded from below, it still follows from the distances as they are.
    fn weight_scale(&self) -> f64 {
        let own = (SIGMAS_PER_GRID_SIZE * self.deviation).max(self.grid_size * LEAST_SCALE);
        weight_scale(own.min(self.grid_size), self.options.weight_at_grid_size)
    }

    /// By how much the noise of each patch is above the median, for the angle at which it was seen.
    fn noise_factors(&self) -> Vec<f64> {
        let of = |patch: &Patch| PlanarSet::of(patch).noise_factor(&patch.frame, self.incidence);
        self.patches.iter().map(of).collect()
    }

    /// M-step: the new planes.
    pub fn m_step(&self, responsibilities: &Responsibilities) -> Vec<Option<Regression>> {
        m_step(self.points, &self.patches, responsibilities)
    }

    /// Trims new planes to patches, with the grid size that their distances give (sections II-A and II-E).
    pub fn trim(&mut self, planes: &[Option<Regression>], responsibilities: &Responsibilities) {
        self.trim_by(trim, planes, responsibilities);
    }

    /// [`Fit::trim`] by [`trim`] or by [`outline`].
    fn trim_by(
        &mut self,
        trim: fn(&Points, Frame, &[u32], f64) -> Option<Patch>,
        planes: &[Option<Regression>],
        responsibilities: &Responsibilities,
    ) {
        let sets = responsibilities.support_sets();
        self.deviation = deviation(planes).min(self.most_deviation);
        self.grid_size = (SIGMAS_PER_GRID_SIZE * self.deviation).max(self.smallest_grid_size);
        let (points, size) = (self.points, self.grid_size);
        let trimmed = largest_first(
            0..planes.len(),
            |&j| sets[j].len(),
            |j| trim(points, planes[j].as_ref()?.frame, &sets[j], size),
        );
        self.patches = trimmed.into_iter().flatten().collect();
    }

    /// Splits patches that are not evenly supported (section II-C).
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn split(&mut self, progress: &dyn Progress) -> Result<()> {
        let points = self.points;
        let rule = SplitRule {
            threshold: self.options.split_threshold,
            min_points: self.part_points(),
            noise: self.smallest_grid_size / SIGMAS_PER_GRID_SIZE,
            merge: self.merge_rule(),
        };
        let patches = std::mem::take(&mut self.patches);
        let parts = largest_first(patches, Patch::n_supporting, |patch| -> Result<Vec<Patch>> {
            progress.check()?;
            Ok(split(points, patch, &rule))
        });
        self.patches =
            parts.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
        Ok(())
    }

    /// Removes patches that the others explain as well.
    fn remove_superfluous(&mut self, progress: &dyn Progress) -> Result<()> {
        let last = self.e_step(progress)?;
        let removed = superfluous(&removals(&last, self.patches.len(), progress)?);
        let mut kept = vec![true; self.patches.len()];
        removed.iter().for_each(|&j| kept[j as usize] = false);
        self.keep(&kept);
        Ok(())
    }

    /// Keeps the patches that are marked.
    fn keep(&mut self, kept: &[bool]) {
        let mut kept = kept.iter();
        self.patches.retain(|_| kept.next() == Some(&true));
    }

    /// Merges similar patches (section II-D).
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn merge(&mut self, progress: &dyn Progress) -> Result<()> {
        let patches = std::mem::take(&mut self.patches);
        self.patches = merge(self.points, patches, &self.merge_rule(), progress)?;
        Ok(())
    }

    /// Adds patches where points are flat and support none (section II-B), in cells up to `coarser` levels larger than the
    /// noise and the spacing of the points ask for. Gives their number.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn add_patches(&mut self, coarser: u32, progress: &dyn Progress) -> Result<usize> {
        let free: Vec<u32> =
            (0..).zip(self.supports(progress)?).filter(|f| f.1 == NONE).map(|f| f.0).collect();
        let added = seed::from_data(
            self.points,
            &free,
            &self.merge_rule(),
            coarser,
            self.part_points(),
            progress,
        )?;
        let n = added.len();
        self.patches.extend(added);
        Ok(n)
    }

    /// Removes patches with too few points and those that are no surface, then fits the rest once more.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn finish(&mut self, progress: &dyn Progress) -> Result<()> {
        self.patches.retain(|p| p.n_supporting() >= self.min_points);
        self.keep_surfaces(progress)?;
        self.em(progress)?;
        for pass in 1..=CLEAR_PASSES {
            let last = self.e_step(progress)?;
            let pairs = close_pairs(&self.patches, self.grid_size, true);
            let margin = CLEAR_SIGMAS * self.deviation.min(self.grid_size / SIGMAS_PER_GRID_SIZE);
            let planes = clear_m_step(self.points, &self.patches, &pairs, &last, margin);
            self.trim_by(if pass < CLEAR_PASSES { outline } else { trim }, &planes, &last);
        }
        self.fit_together(progress)?;
        self.patches.retain(|p| p.n_supporting() >= self.min_points);
        Ok(())
    }

    /// The patches that a fit comes to before any is judged.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn candidates(mut self, progress: &dyn Progress) -> Result<Vec<Candidate>> {
        self.settle(progress)?;
        self.patches.retain(|p| p.n_supporting() >= self.min_points);
        let evidence = self.evidence(progress)?;
        let of = |(patch, evidence): (&Patch, Evidence)| Candidate {
            inputs: evidence.inputs(),
            points: patch.whole.clone(),
        };
        Ok(self.patches.iter().zip(evidence).map(of).collect())
    }

    /// What each patch is judged by.
    fn evidence(&self, progress: &dyn Progress) -> Result<Vec<Evidence>> {
        let last = self.e_step(progress)?;
        let removals = removals(&last, self.patches.len(), progress)?;
        // Not of the grid size as it is: where one patch is over something thick, that is thick too.
        let noise = self.noise.max(LEAST_NOISE * self.smallest_grid_size);
        let noise: Vec<f64> = self.noise_factors().into_iter().map(|f| f * noise).collect();
        let (points, patches, grid_size) = (self.points, &self.patches, self.grid_size);
        let judged = Judged { points, patches, removals: &removals, noise: &noise, grid_size };
        judged.evidence(progress)
    }

    /// Removes patches that are probably no surface.
    fn keep_surfaces(&mut self, progress: &dyn Progress) -> Result<()> {
        let evidence = self.evidence(progress)?;
        let kept: Vec<bool> = self
            .patches
            .iter()
            .zip(evidence)
            .map(|(patch, evidence)| evidence.probability() >= self.least_probability(patch))
            .collect();
        let improbable = self.patches.iter().zip(&kept).filter(|&(_, &kept)| !kept);
        self.improbable = improbable.map(|(patch, _)| patch.whole.clone()).collect();
        self.keep(&kept);
        Ok(())
    }

    /// The probability that a patch needs, which is less where it has many points.
    fn least_probability(&self, patch: &Patch) -> f64 {
        let [from, to] = LARGE_PATCH;
        let times = patch.n_supporting() as f64 / self.min_points as f64;
        let large = ((times / from).ln() / (to / from).ln()).clamp(0.0, 1.0);
        self.options.min_probability * (1.0 - large * (1.0 - LARGE_SHARE))
    }

    /// Replaces patches whose sides are short beside the noise by those of the largest likelihood.
    fn fit_together(&mut self, progress: &dyn Progress) -> Result<()> {
        let limits = Limits {
            grid_size: self.grid_size,
            deviation: self.deviation,
            noise: self.deviation.min(self.smallest_grid_size / SIGMAS_PER_GRID_SIZE),
            min_points: self.min_points,
        };
        let fitted = refine(self.points, &self.patches, limits, progress)?;
        if fitted.is_empty() {
            return Ok(());
        }
        let near: Vec<Vec<u32>> = fitted.iter().map(|f| self.support_of(&f.replaced)).collect();
        let mut replaced = vec![false; self.patches.len()];
        fitted.iter().flat_map(|f| &f.replaced).for_each(|&j| replaced[j as usize] = true);
        self.keep(&replaced.iter().map(|r| !r).collect::<Vec<_>>());
        let n_kept = self.patches.len();
        for (f, near) in fitted.iter().zip(&near) {
            for &(frame, half) in &f.rectangles {
                let patch = self.facing_as(self.rectangle(frame, half), near);
                self.patches.push(patch);
            }
        }
        let last = self.e_step(progress)?;
        let sets = last.support_sets();
        let (points, size) = (self.points, self.grid_size);
        let bare = self.patches.split_off(n_kept);
        let trimmed =
            parallel::map_range(bare.len(), |j| trim_to(points, &bare[j], &sets[n_kept + j], size));
        self.patches.extend(trimmed.into_iter().flatten());
        Ok(())
    }

    /// A whole rectangle about the middle of `frame`, with half its sides.
    fn rectangle(&self, frame: Frame, half: [f64; 2]) -> Patch {
        let mut tiles = Tiles::new(half.map(|h| -h), half.map(|h| 2.0 * h), self.grid_size);
        tiles.support(vec![true; tiles.supported().len()]);
        Patch::bare(frame, tiles)
    }

    /// The points that support these patches.
    fn support_of(&self, patches: &[u32]) -> Vec<u32> {
        patches.iter().flat_map(|&j| &self.patches[j as usize].whole).copied().collect()
    }

    /// A rectangle with its normal to the side that the points of `near` within G of it were seen from.
    fn facing_as(&self, patch: Patch, near: &[u32]) -> Patch {
        let of = |&&i: &&u32| {
            patch.distance(self.points.positions[i as usize], self.grid_size).is_some()
        };
        let own: Vec<u32> = near.iter().filter(of).copied().collect();
        match facing(self.points, &own) {
            Some(seen) if dot(seen, patch.frame.normal) < 0.0 => {
                // It is even about its middle, so that its tiles stay.
                Patch { frame: patch.frame.flipped(), ..patch }
            }
            _ => patch,
        }
    }

    /// The first G of patches placed at random: 3 times the root mean square distance of the points to the closest.
    fn first_grid_size(&self) -> f64 {
        let far = 4.0 * self.points.extent().max(self.points.cell);
        let squares: Vec<f64> = parallel::map(&self.points.positions, |&p| {
            let near = self.patches.iter().filter_map(|patch| patch.distance(p, far));
            near.map(|d| d * d).fold(far * far, f64::min)
        });
        SIGMAS_PER_GRID_SIZE * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    /// When two patches merge.
    fn merge_rule(&self) -> Rule {
        Rule {
            distance: self.grid_size,
            deviation: self.grid_size / SIGMAS_PER_GRID_SIZE,
            incidence: self.incidence,
            tolerance: self.options.merge_tolerance,
        }
    }
}

/// Whether mean distance and share of supporting points of two iterations differ by at most the share `tolerance`.
fn stable(before: &Iteration, after: &Iteration, tolerance: f64) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= tolerance * a.abs().max(b.abs());
    close(before.mean_distance, after.mean_distance) && close(before.supporting, after.supporting)
}
