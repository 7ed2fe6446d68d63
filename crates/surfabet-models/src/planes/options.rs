//! What to learn, checked before anything is computed.

use crate::error::{Error, Result, positive};

/// Most patches to start from, and most that a model holds.
pub const MAX_PATCHES: usize = 1 << 20;

/// Parameters of [`learn`](super::learn), with the paper's symbols.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanesOptions {
    /// Number of patches to start from, placed at random; 0 takes them from the data: cells that are flat.
    pub initial_patches: usize,
    /// Grid size (G, section II-E) that the learned one does not fall below, metres. `None` takes the data's own
    /// resolution: twice the median spacing of the points.
    pub min_grid_size: Option<f64>,
    /// Weight of a point at distance G before normalisation (W, eq. 2). Points further from all patches than G
    /// support none.
    pub weight_at_grid_size: f64,
    /// A patch is split where its density falls below this share of the mean (section II-C).
    pub split_threshold: f64,
    /// Most that points of either of two patches may be further from their common plane than from their own for
    /// the two to merge, as a factor. Infinite leaves the paper's two conditions alone (section II-D).
    pub merge_tolerance: f64,
    /// Passes of E-step, M-step and trimming before each split and each merge (EMPF, section II-A).
    pub em_steps: usize,
    /// Iterations after which patches are added where many points support none (section II-B).
    pub new_patches_every: usize,
    /// Most iterations of EMPF, split, EMPF, merge.
    pub max_iterations: usize,
    /// Learning ends when the mean distance of points to their patches and the share of points that support one
    /// change by less than this share.
    pub tolerance: f64,
    /// Points that a patch needs. `None` takes a thousandth of all points, 30 at least.
    pub min_points: Option<usize>,
    /// Least share of the points before and behind a patch, up to the grid size, that support it; lower ones lie in
    /// the middle of clutter. 0 keeps them. Patches with 20 times `min_points` are kept whatever this and the next
    /// two say.
    pub min_purity: f64,
    /// Least share of a patch's rectangle that its supported tiles cover. 0 keeps all.
    pub min_fill: f64,
    /// Largest ratio of the standard deviation of points about their patch to that about the mean of their tile;
    /// larger ones are bent or lie across a corner. Infinite keeps all.
    pub max_bend: f64,
    /// Rounding of the colours of tiles, grey levels (0..255).
    pub color_step: u32,
    /// Seed of the initial patches.
    pub random_state: u64,
}

impl Default for PlanesOptions {
    fn default() -> Self {
        Self {
            initial_patches: 0,
            min_grid_size: None,
            weight_at_grid_size: 0.01,
            split_threshold: 2.0 / 3.0,
            merge_tolerance: 1.25,
            em_steps: 2,
            new_patches_every: 5,
            max_iterations: 30,
            tolerance: 0.01,
            min_points: None,
            min_purity: 0.85,
            min_fill: 0.6,
            max_bend: 1.55,
            color_step: 8,
            random_state: 0,
        }
    }
}

impl PlanesOptions {
    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        if self.initial_patches > MAX_PATCHES {
            return Err(Error::invalid("initial_patches", self.initial_patches, "0 to 1048576"));
        }
        if let Some(size) = self.min_grid_size {
            positive("min_grid_size", size, "a positive number of metres")?;
        }
        let open = |v: f64| v > 0.0 && v < 1.0;
        if !open(self.weight_at_grid_size) {
            let value = self.weight_at_grid_size;
            return Err(Error::invalid("weight_at_grid_size", value, "between 0 and 1"));
        }
        if !(0.0..1.0).contains(&self.split_threshold) {
            return Err(Error::invalid("split_threshold", self.split_threshold, "0 to below 1"));
        }
        if self.merge_tolerance.is_nan() || self.merge_tolerance < 1.0 {
            return Err(Error::invalid("merge_tolerance", self.merge_tolerance, "at least 1"));
        }
        for (name, value) in [("min_purity", self.min_purity), ("min_fill", self.min_fill)] {
            if !(0.0..=1.0).contains(&value) {
                return Err(Error::invalid(name, value, "0 to 1"));
            }
        }
        if self.max_bend.is_nan() || self.max_bend < 1.0 {
            return Err(Error::invalid("max_bend", self.max_bend, "at least 1"));
        }
        for (name, value) in [
            ("em_steps", self.em_steps),
            ("new_patches_every", self.new_patches_every),
            ("max_iterations", self.max_iterations),
        ] {
            if !(1..=10_000).contains(&value) {
                return Err(Error::invalid(name, value, "1 to 10000"));
            }
        }
        positive("tolerance", self.tolerance, "a positive number")?;
        if !(1..=64).contains(&self.color_step) {
            return Err(Error::invalid("color_step", self.color_step, "1 to 64"));
        }
        if self.min_points.is_some_and(|n| n < 3) {
            return Err(Error::invalid("min_points", self.min_points.unwrap_or(0), "at least 3"));
        }
        Ok(())
    }
}
