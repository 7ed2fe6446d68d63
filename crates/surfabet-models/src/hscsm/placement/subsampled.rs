//! SCSM's placement, to compare with.

use surfabet_geom::Progress;

use super::{Placer, point_of};
use crate::error::Result;
use crate::hscsm::constants::BATCH;
use crate::vector::{dot, minus};

impl Placer<'_> {
    /// Patches on a spatial subsampling of what is not covered yet, the point
    /// nearest to the mean in each cube of one patch size, round after round.
    pub(super) fn subsampled(&mut self, progress: &dyn Progress) -> Result<()> {
        let lowest = self.field.rules.min_pixels;
        // Cubes of points whose side is nearest to a patch size.
        let doublings =
            (self.field.grid.n as f32).log2().round() as u32 + self.field.point_doublings;
        loop {
            self.notify(progress)?;
            let mut seeds: Vec<u32> = Vec::new();
            let free: Vec<u32> = (0..self.field.points.len() as u32)
                .filter(|&k| self.ownership.free[k as usize] > 0)
                .collect();
            let point = |k: u32| &self.field.points.all[k as usize];
            for cube in free.chunk_by(|&a, &b| {
                point(a).key >> (3 * doublings) == point(b).key >> (3 * doublings)
            }) {
                let mut mean = [0.0_f64; 3];
                for &k in cube {
                    let p = point(k).position;
                    (0..3).for_each(|a| mean[a] += f64::from(p[a]) / cube.len() as f64);
                }
                let mean = mean.map(|c| c as f32);
                let distance = |k: u32| {
                    let d = minus(point(k).position, mean);
                    dot(d, d)
                };
                let nearest =
                    |&a: &u32, &b: &u32| distance(a).total_cmp(&distance(b)).then(a.cmp(&b));
                seeds.extend(cube.iter().copied().min_by(|a, b| nearest(a, b)));
            }
            let before = self.done;
            for chosen in seeds.chunks(BATCH) {
                let trials = self.trials(chosen, |k| (k as usize, point_of(&self.field, k), None));
                for trial in trials.into_iter().flatten() {
                    self.commit(trial, lowest);
                }
                self.notify(progress)?;
            }
            if self.done == before {
                return Ok(());
            }
        }
    }
}
