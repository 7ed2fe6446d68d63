//! What to learn.

use crate::options::{Range, options};
use crate::quality::Quality;

/// Most patches to start from, and most that a model holds.
pub const MAX_PATCHES: usize = 1 << 20;

/// Most iterations of any loop.
const MOST_ITERATIONS: f64 = 10_000.0;

options! {
    /// Options of [`learn`](super::learn), with the paper's symbols.
    pub struct PlanesOptions {
        /// Small files or fine detail. Sets `min_grid_size`, unless that is given: 'small' doubles it, 'fine' halves it.
        quality: Quality = Quality::Balanced;
        /// Number of patches to start from, placed at random. With 0 they are taken from the data: cells that are flat.
        initial_patches: usize = 0, range = Range::from_to(0.0, MAX_PATCHES as f64);
        /// The method as printed in the paper, from random patches (10 where `initial_patches` is 0), without what was
        /// added to it. Options that it does not know, from `merge_tolerance` to `min_probability`, do not count then.
        published: bool = false;
        /// Grid size (G, section II-E) that the learned one does not fall below. Flat is what is flat at this size.
        min_grid_size: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "the median spacing of the points, or three times their noise where that is more";
        /// Weight of a point at distance G before normalisation (W, eq. 2). Points further than G from all patches
        /// support none.
        weight_at_grid_size: f64 = 0.01, range = Range::between(0.0, 1.0);
        /// A patch is split where its density falls below this share of the mean (section II-C).
        split_threshold: f64 = 2.0 / 3.0, range = Range::from_below(0.0, 1.0);
        /// Factor by which points of either of two patches may be further from their common plane than from their own
        /// for the two to merge (section II-D). With infinity only the paper's two conditions hold.
        merge_tolerance: f64 = 1.25, range = Range::at_least(1.0);
        /// Passes of E-step, M-step and trimming before each split and each merge (EMPF, section II-A).
        em_steps: usize = 2, range = Range::from_to(1.0, MOST_ITERATIONS);
        /// Iterations after which patches are added where many points support none (section II-B).
        new_patches_every: usize = 5, range = Range::from_to(1.0, MOST_ITERATIONS);
        /// Most iterations of EMPF, split, EMPF, merge.
        max_iterations: usize = 30, range = Range::from_to(1.0, MOST_ITERATIONS);
        /// Learning ends when the mean distance of points to their patches and the share of points that support one
        /// change by less than this share.
        tolerance: f64 = 0.01, range = Range::POSITIVE;
        /// Points that a patch needs.
        min_points: Option<usize> = None, range = Range::count_from(3.0),
            none = "one in 4000 of all points, at least 30";
        /// Least probability that a patch is one surface, from what the likelihood loses without it, how its points spread
        /// about its plane, whether it is bent, how much of its rectangle is filled, what is beside it, and its size. Patches in the middle
        /// of clutter, across a corner or along something bent have less; with 0 all are kept. Of patches with 16 times `min_points` a third
        /// of it is asked.
        min_probability: f64 = 0.6, range = Range::from_to(0.0, 1.0);
        /// Rounding of the colours of tiles.
        color_step: u32 = 8, range = Range::from_to(1.0, 64.0), unit = "grey levels";
        /// Rounding of the mean intensities of tiles, as a share of their standard deviation.
        attribute_step: f64 = 0.125, range = Range::from_to(0.001, 100.0), unit = "standard deviations";
        /// Keeps points that are far from all others. Otherwise those of which a few would make the scene many times as
        /// large as it is are left out, and counted in the report.
        keep_outliers: bool = false;
        /// Seed of the patches that are placed at random.
        random_state: u64 = 0, range = Range::SEED;
    }
}
