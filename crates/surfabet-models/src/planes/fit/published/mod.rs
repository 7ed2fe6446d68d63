//! The method as it is printed: EMPF, split, EMPF, merge without what was added to them.
//!
//! Every point supports the patch that is most probable for it, however far; tiles have the side G; rectangles lie along
//! the principal axes; splits are at gaps, merges by the paper's two conditions. What could not work as printed is named where
//! it is done, and in docs/methods/planes.md.

mod merge;
mod split;
mod trim;

use surfabet_geom::Progress;

use self::merge::merge;
use self::split::split;
use self::trim::trim;
use super::e_step::{e_step_everywhere, weight_scale};
use super::m_step::m_step;
use super::responsibilities::Responsibilities;
use super::seed::random;
use super::{Iteration, Trace, stable};
use crate::error::Result;
use crate::planes::constants::{PUBLISHED_PATCHES, SIGMAS_PER_GRID_SIZE, UNSUPPORTED_SHARE};
use crate::planes::options::PlanesOptions;
use crate::planes::patch::Patch;
use crate::planes::points::Points;

/// A fit by the printed method.
pub(in crate::planes) struct PublishedFit<'a> {
    points: &'a Points,
    options: &'a PlanesOptions,
    /// The patches as they are now.
    pub patches: Vec<Patch>,
    /// The grid size G, metres.
    pub grid_size: f64,
}

impl<'a> PublishedFit<'a> {
    /// A fit that starts from patches at random: as many as asked for, or ten as in experiment II.
    pub fn new(
        points: &'a Points,
        options: &'a PlanesOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let asked = options.initial_patches;
        let n = if asked > 0 { asked } else { PUBLISHED_PATCHES };
        let patches = random(points, n, options.random_state);
        let mut fit = Self { points, options, patches, grid_size: 0.0 };
        let start = e_step_everywhere(points, &fit.patches, 1.0, progress)?;
        fit.grid_size = fit.of_distances(start.distances());
        Ok(fit)
    }

    /// Iterates until distances to the patches are stable (section II-B).
    pub fn run(&mut self, progress: &dyn Progress) -> Result<Trace> {
        let most = self.options.max_iterations;
        let mut iterations: Vec<Iteration> = Vec::new();
        let mut stop_reason = "reached the largest number of iterations";
        for i in 0..most {
            progress.update("fitting", i as f32 / most as f32);
            let now = self.iterate(progress)?;
            let is_stable =
                iterations.last().is_some_and(|last| stable(last, &now, self.options.tolerance));
            iterations.push(now);
            if is_stable {
                stop_reason = "distances to the patches are stable";
                break;
            }
            if (i + 1) % self.options.new_patches_every == 0 {
                self.add_patches(i as u64);
            }
        }
        Ok(Trace { iterations, stop_reason })
    }

    /// EMPF, split, EMPF, merge.
    fn iterate(&mut self, progress: &dyn Progress) -> Result<Iteration> {
        self.em(progress)?;
        let (points, grid_size) = (self.points, self.grid_size);
        let threshold = self.options.split_threshold;
        let mut parts = Vec::new();
        for patch in std::mem::take(&mut self.patches) {
            progress.check()?;
            parts.extend(split(points, patch, threshold, grid_size));
        }
        self.patches = parts;
        let last = self.em(progress)?;
        let patches = std::mem::take(&mut self.patches);
        self.patches = merge(points, patches, self.grid_size, progress)?;
        let (mean_distance, _) = last.fit();
        let supporting: usize = self.patches.iter().map(|p| p.support.len()).sum();
        Ok(Iteration {
            patches: self.patches.len(),
            grid_size: self.grid_size,
            mean_distance,
            supporting: supporting as f64 / points.len() as f64,
        })
    }

    /// E-step, M-step and trimming (section II-A).
    fn em(&mut self, progress: &dyn Progress) -> Result<Responsibilities> {
        let points = self.points;
        let mut last = Responsibilities::default();
        for _ in 0..self.options.em_steps {
            let s = weight_scale(self.grid_size, self.options.weight_at_grid_size);
            last = e_step_everywhere(points, &self.patches, s, progress)?;
            let planes = m_step(points, &self.patches, &last);
            let sets = last.support_sets();
            let heights = planes.iter().zip(sets).flat_map(|(plane, set)| {
                let frame = plane.as_ref().map(|p| p.frame);
                let of = move |&i: &u32| frame.map(|f| f.local(points.positions[i as usize])[2]);
                set.iter().filter_map(of)
            });
            self.grid_size = self.of_distances(heights);
            let grid_size = self.grid_size;
            let trimmed = planes
                .iter()
                .zip(sets)
                .filter_map(|(plane, set)| trim(points, plane.as_ref()?.frame, set, grid_size));
            self.patches = trimmed.collect();
        }
        Ok(last)
    }

    /// `G = 3 std(d)` of distances with their signs, about zero: see [`super::grid_size`].
    fn of_distances(&self, distances: impl Iterator<Item = f64>) -> f64 {
        let (n, squares) = distances.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + d * d));
        let of_data = SIGMAS_PER_GRID_SIZE * (squares / f64::max(n, 1.0)).sqrt();
        // Of an exact fit G would be zero, and tiles and bins far below the spacing of the points are empty whatever these lie on.
        let least = self.options.min_grid_size.unwrap_or(self.points.spacing());
        of_data.max(least)
    }

    /// Adds patches at random where many points are in no reduced support set (section II-B).
    fn add_patches(&mut self, round: u64) {
        let points = self.points;
        let mut is_free = vec![true; points.len()];
        self.patches.iter().flat_map(|p| &p.support).for_each(|&i| is_free[i as usize] = false);
        let free = is_free.iter().filter(|f| **f).count();
        if (free as f64) < UNSUPPORTED_SHARE * points.len() as f64 {
            return;
        }
        let wanted =
            random(points, self.patches.len().max(1), self.options.random_state ^ (round + 1));
        let mut at =
            (0..points.len()).filter(|&i| is_free[i]).step_by(free.div_ceil(PUBLISHED_PATCHES));
        for mut patch in wanted.into_iter().take(PUBLISHED_PATCHES) {
            if let Some(i) = at.next() {
                patch.frame.center = points.positions[i].map(f64::from);
                self.patches.push(patch);
            }
        }
    }
}
