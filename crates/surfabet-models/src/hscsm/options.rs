//! What to learn, checked before anything is computed.

use super::model::MAX_SPARSITY;
use crate::error::{Error, Result, positive};
use crate::sensor::Sensor;

/// Most levels of a hierarchy.
pub const MAX_LEVELS: u32 = 8;

/// How places of patches are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Placement {
    /// Best coverage first, then aligned neighbours along its axes (HSCSM, section III-A).
    #[default]
    Greedy,
    /// By spatial subsampling at the patch size, without regard to coverage and alignment (SCSM).
    Subsampled,
}

/// Parameters of [`learn`](super::learn). [`Default`] is a good start for indoor scans.
#[derive(Debug, Clone, PartialEq)]
pub struct HscsmOptions {
    /// Side of a pixel (pr, "patch resolution") of the lowest level, metres.
    pub resolution: f64,
    /// Pixels per side of a patch, so that the patch size ps is `patch_pixels` times `resolution`; 2 to 32.
    pub patch_pixels: u32,
    /// Levels of the hierarchy, 1 to 8; each has pixels of twice the side of those below it.
    pub levels: u32,
    /// Largest standard deviation of depth in a pixel (rho_max_depth), metres: what deviates more goes to the
    /// level below; `None`: the resolution divided by the square root of three, at which every level accepts sheets as
    /// thick as those of the lowest. The lowest level takes all.
    pub max_depth_deviation: Option<f64>,
    /// Largest standard deviation of colour in a pixel (rho_max_rgb), root mean square of the channels, 0..255.
    pub max_color_deviation: f64,
    /// Fraction of its pixels that a patch covers at least, or it goes to the level below.
    pub min_coverage: f64,
    /// How places of patches are chosen.
    pub placement: Placement,
    /// Most entries of the depth dictionary of a level.
    pub depth_atoms: u32,
    /// Most entries of the colour dictionary of a level.
    pub color_atoms: u32,
    /// Most dictionary entries that describe one patch's depth (k, eq. 1).
    pub depth_sparsity: u32,
    /// Most dictionary entries that describe one patch's colour (k, eq. 1).
    pub color_sparsity: u32,
    /// Coding of depth stops at this root mean square error on the lowest level, metres; `None`: 0.2 times the
    /// resolution. Each level above has half the tolerance of the one below.
    pub depth_tolerance: Option<f64>,
    /// Coding of colour stops at this root mean square error on the lowest level, 0..255; halved likewise.
    pub color_tolerance: f64,
    /// Most iterations of wK-SVD.
    pub iterations: u32,
    /// How far a depth measurement can be trusted, for clouds that know their ranges.
    pub sensor: Sensor,
    /// Seed of the dictionaries' first entries.
    pub random_state: u64,
}

impl Default for HscsmOptions {
    fn default() -> Self {
        Self {
            resolution: 0.01,
            patch_pixels: 8,
            levels: 1,
            max_depth_deviation: None,
            max_color_deviation: 60.0,
            min_coverage: 0.9,
            placement: Placement::default(),
            depth_atoms: 128,
            color_atoms: 256,
            depth_sparsity: 6,
            color_sparsity: 12,
            depth_tolerance: None,
            color_tolerance: 7.0,
            iterations: 8,
            sensor: Sensor::default(),
            random_state: 0,
        }
    }
}

impl HscsmOptions {
    /// How many times the pixels of `level`, counted from the coarsest, were doubled; 0 at the lowest level.
    pub(super) fn doublings(&self, level: u32) -> u32 {
        self.levels - 1 - level
    }

    /// Side of a pixel (pr) of `level`, counted from the coarsest, metres.
    pub fn pixel_size(&self, level: u32) -> f64 {
        self.resolution * f64::from(1_u32 << self.doublings(level))
    }

    /// Side of a patch (ps) of `level`, metres.
    pub fn patch_size(&self, level: u32) -> f64 {
        self.pixel_size(level) * f64::from(self.patch_pixels)
    }

    /// Largest standard deviation of depth in force, metres.
    pub fn max_depth_deviation(&self) -> f64 {
        self.max_depth_deviation.unwrap_or(self.resolution / 3.0_f64.sqrt())
    }

    /// Depth tolerance in force at `level`, metres.
    pub fn depth_tolerance(&self, level: u32) -> f64 {
        let lowest = self.depth_tolerance.unwrap_or(0.2 * self.resolution);
        lowest / f64::from(1_u32 << self.doublings(level))
    }

    /// Colour tolerance in force at `level`, 0..255.
    pub fn color_tolerance(&self, level: u32) -> f64 {
        self.color_tolerance / f64::from(1_u32 << self.doublings(level))
    }

    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        positive("resolution", self.resolution, "a positive number of metres")?;
        if !(2..=32).contains(&self.patch_pixels) {
            return Err(Error::invalid("patch_pixels", self.patch_pixels, "2 to 32"));
        }
        if !(1..=MAX_LEVELS).contains(&self.levels) {
            return Err(Error::invalid("levels", self.levels, "1 to 8"));
        }
        let deviation = self.max_depth_deviation();
        positive("max_depth_deviation", deviation, "a positive number of metres")?;
        positive("max_color_deviation", self.max_color_deviation, "positive")?;
        if !(self.min_coverage > 0.0 && self.min_coverage <= 1.0) {
            return Err(Error::invalid("min_coverage", self.min_coverage, "above 0 and at most 1"));
        }
        for (name, value) in [("depth_atoms", self.depth_atoms), ("color_atoms", self.color_atoms)]
        {
            if !(1..=65_535).contains(&value) {
                return Err(Error::invalid(name, value, "1 to 65535"));
            }
        }
        for (name, value) in
            [("depth_sparsity", self.depth_sparsity), ("color_sparsity", self.color_sparsity)]
        {
            if !(1..=MAX_SPARSITY as u32).contains(&value) {
                return Err(Error::invalid(name, value, "1 to 64"));
            }
        }
        let tolerance = self.depth_tolerance(self.levels - 1);
        positive("depth_tolerance", tolerance, "a positive number of metres")?;
        if !(self.color_tolerance > 0.0 && self.color_tolerance <= 255.0) {
            return Err(Error::invalid(
                "color_tolerance",
                self.color_tolerance,
                "above 0 and at most 255",
            ));
        }
        if !(1..=1000).contains(&self.iterations) {
            return Err(Error::invalid("iterations", self.iterations, "1 to 1000"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_pass() {
        assert_eq!(HscsmOptions::default().check(), Ok(()));
    }

    #[test]
    fn sizes_double_and_tolerances_halve_from_level_to_level_above() {
        let options = HscsmOptions { levels: 3, ..HscsmOptions::default() };
        let levels = [0, 1, 2];
        assert_eq!(levels.map(|j| options.pixel_size(j)), [0.04, 0.02, 0.01]);
        assert_eq!(levels.map(|j| options.patch_size(j)), [0.32, 0.16, 0.08]);
        assert_eq!(levels.map(|j| options.depth_tolerance(j)), [0.0005, 0.001, 0.002]);
        assert_eq!(levels.map(|j| options.color_tolerance(j)), [1.75, 3.5, 7.0]);
    }

    #[test]
    fn a_refusal_names_value_and_limit() {
        let wrong = HscsmOptions { resolution: -1.0, ..HscsmOptions::default() };
        let message = wrong.check().unwrap_err().to_string();
        assert_eq!(message, "resolution is -1, but must be a positive number of metres");
        for wrong in [
            HscsmOptions { patch_pixels: 33, ..HscsmOptions::default() },
            HscsmOptions { levels: 0, ..HscsmOptions::default() },
            HscsmOptions { levels: 9, ..HscsmOptions::default() },
            HscsmOptions { max_depth_deviation: Some(0.0), ..HscsmOptions::default() },
            HscsmOptions { max_color_deviation: f64::NAN, ..HscsmOptions::default() },
            HscsmOptions { min_coverage: 1.5, ..HscsmOptions::default() },
            HscsmOptions { color_tolerance: f64::NAN, ..HscsmOptions::default() },
            HscsmOptions { depth_tolerance: Some(0.0), ..HscsmOptions::default() },
            HscsmOptions { depth_sparsity: 0, ..HscsmOptions::default() },
        ] {
            assert!(matches!(wrong.check(), Err(Error::InvalidParameter { .. })));
        }
    }
}
