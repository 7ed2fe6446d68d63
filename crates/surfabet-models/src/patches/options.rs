//! What to learn, checked before anything is computed.

use super::model::MAX_SPARSITY;
use super::sensor::Sensor;
use crate::error::{Error, Result};

/// Parameters of [`learn`](super::learn). [`Default`] is a good start for indoor scans.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchOptions {
    /// Side of a pixel (pr, "patch resolution"), metres.
    pub resolution: f64,
    /// Pixels per side of a patch, so that the patch size ps is `patch_pixels` times `resolution`; 2 to 32.
    pub patch_pixels: u32,
    /// Number of levels in the hierarchy.
    pub levels: u32,
    /// Most entries of the depth dictionary.
    pub depth_atoms: u32,
    /// Most entries of the colour dictionary.
    pub color_atoms: u32,
    /// Most dictionary entries that describe one patch's depth (k, eq. 1).
    pub depth_sparsity: u32,
    /// Most dictionary entries that describe one patch's colour (k, eq. 1).
    pub color_sparsity: u32,
    /// Coding of depth stops at this root mean square error, metres; `None`: 0.2 times the resolution.
    pub depth_tolerance: Option<f64>,
    /// Coding of colour stops at this root mean square error, 0..255.
    pub color_tolerance: f64,
    /// Most iterations of wK-SVD.
    pub iterations: u32,
    /// How far a depth measurement can be trusted, for clouds that know their ranges.
    pub sensor: Sensor,
    /// Seed of the dictionaries' first entries.
    pub random_state: u64,
}

impl Default for PatchOptions {
    fn default() -> Self {
        Self {
            resolution: 0.01,
            patch_pixels: 8,
            levels: 1,
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

impl PatchOptions {
    /// Side of a patch (ps), metres.
    pub fn patch_size(&self) -> f64 {
        self.resolution * f64::from(self.patch_pixels)
    }

    /// Depth tolerance in force, metres.
    pub fn depth_tolerance(&self) -> f64 {
        self.depth_tolerance.unwrap_or(0.2 * self.resolution)
    }

    /// Refuses values outside their domain.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] naming the first one.
    pub fn check(&self) -> Result<()> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !positive(self.resolution) {
            return Err(Error::invalid(
                "resolution",
                self.resolution,
                "a positive number of metres",
            ));
        }
        if !(2..=32).contains(&self.patch_pixels) {
            return Err(Error::invalid("patch_pixels", self.patch_pixels, "2 to 32"));
        }
        if self.levels != 1 {
            return Err(Error::invalid("levels", self.levels, "1 in this version (SCSM)"));
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
        if !positive(self.depth_tolerance()) {
            return Err(Error::invalid(
                "depth_tolerance",
                self.depth_tolerance(),
                "a positive number of metres",
            ));
        }
        if !(positive(self.color_tolerance) && self.color_tolerance <= 255.0) {
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
        assert_eq!(PatchOptions::default().check(), Ok(()));
    }

    #[test]
    fn a_refusal_names_value_and_limit() {
        let wrong = PatchOptions { resolution: -1.0, ..PatchOptions::default() };
        let message = wrong.check().unwrap_err().to_string();
        assert_eq!(message, "resolution is -1, but must be a positive number of metres");
        for wrong in [
            PatchOptions { patch_pixels: 33, ..PatchOptions::default() },
            PatchOptions { levels: 2, ..PatchOptions::default() },
            PatchOptions { color_tolerance: f64::NAN, ..PatchOptions::default() },
            PatchOptions { depth_tolerance: Some(0.0), ..PatchOptions::default() },
            PatchOptions { depth_sparsity: 0, ..PatchOptions::default() },
        ] {
            assert!(matches!(wrong.check(), Err(Error::InvalidParameter { .. })));
        }
    }
}
