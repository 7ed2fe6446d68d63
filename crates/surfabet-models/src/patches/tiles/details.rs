//! Levels of detail: whole models of a tile, each with pixels four times as large as those of the next, all of the same points.

use surfabet_geom::Progress;

use super::{Cubes, Known, TilePlan, TileTask, learn_tile};
use crate::error::Result;
use crate::patches::model::{Lattice, PatchModel};
use crate::patches::options::PatchesOptions;

/// Most levels of detail that are learned: with pixels of 1 cm the third has some of 16 cm.
pub const MAX_DETAILS: u32 = 3;

/// Doublings from the pixels of a level of detail to those of the one before, which is coarser.
const DOUBLINGS: u32 = 2;

/// Most samples of a pixel of a thin surface: they are merged in cells of half a pixel.
const MOST_SAMPLES: f64 = 4.0;

/// Finest pixels that those of the coarsest of so many levels of detail are wide.
pub(super) fn coarsest_pixel(details: u32) -> i32 {
    1 << (DOUBLINGS * (details - 1))
}

impl TilePlan {
    /// Doublings from the pixels of the last level of detail to those of one, 0 the coarsest.
    fn doublings(&self, level: u32) -> u32 {
        DOUBLINGS * (self.details - 1 - level)
    }

    /// The plan and the options by which a level of detail is learned, 0 the coarsest. Those of the last are those of a map that has
    /// no other. A coarser one leaves out detail, so only the last keeps a bound on the error of all points.
    pub fn of_detail(&self, level: u32, options: &PatchesOptions) -> (Self, PatchesOptions) {
        let factor = 1_i32 << self.doublings(level);
        let times = f64::from(factor);
        let Cubes { side, offset } = self.cubes;
        let plan = Self {
            lattice: Lattice { pixel_size: times * self.lattice.pixel_size, ..self.lattice },
            cubes: Cubes { side: side / factor, offset: offset.map(|c| c / factor) },
            tolerance: times * self.tolerance,
            density: match factor {
                1 => self.density,
                _ => (times * times * self.density).min(MOST_SAMPLES),
            },
            details: 1,
            ..self.clone()
        };
        let max_error = options.max_error.filter(|_| factor == 1);
        let options = PatchesOptions { max_error, ..options.clone() };
        (plan, options)
    }
}

/// Learns a tile at all levels of detail, coarsest first, as [`learn_tile`] does; empty where no point lies in its cube.
/// A coarser level may be missing where rounding puts the only points into the next cube.
///
/// # Errors
/// As [`learn_tile`].
pub fn learn_details(
    task: &TileTask<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Option<PatchModel>>> {
    task.plan.check()?;
    let learned = (0..task.plan.details).map(|level| {
        let (plan, options) = task.plan.of_detail(level, task.options);
        // Sheets are those of the last level; a coarser one is learned from what they decode to.
        let known = if level + 1 == task.plan.details {
            task.known
        } else {
            Known { sheets: &[], n_kept: 0, ..task.known }
        };
        learn_tile(&TileTask { plan: &plan, options: &options, known, ..*task }, progress)
    });
    let learned: Vec<_> = learned.collect::<Result<_>>()?;
    Ok(if learned.last().is_some_and(Option::is_some) { learned } else { Vec::new() })
}
