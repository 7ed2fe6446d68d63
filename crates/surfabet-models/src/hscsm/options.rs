//! What to learn.

use super::constants::{
    MAX_COLOR_ATOMS, MAX_COLOR_DEVIATION, MAX_DEPTH_ATOMS, MAX_PIXEL_OFFSET,
    PATCHES_PER_COLOR_ATOM, PATCHES_PER_DEPTH_ATOM, PUBLISHED_COLOR_ATOMS, PUBLISHED_DEPTH_ATOMS,
};
use super::model::MAX_SPARSITY;
use crate::options::{Range, choices, options};
use crate::quality::Quality;
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
choices!(Placement { Greedy = "greedy", Subsampled = "subsampled" });

options! {
    /// Options of [`learn`](super::learn).
    pub struct HscsmOptions {
        /// Small files or fine detail. Sets `resolution`, unless that is given: 'small' doubles it, 'fine' halves it.
        quality: Quality = Quality::Balanced;
        /// The method as printed in the paper, without what was added to it: the options from `fine_masks` to
        /// `max_training_signals` do not count then, and the dictionaries have the paper's sizes where none are given.
        published: bool = false;
        /// Side of a pixel of the lowest level (pr, the patch resolution). Smaller detail is lost.
        resolution: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "from the data: two and a half spacings of the points, or 1.25 standard deviations of their noise where that is more";
        /// Pixels per side of a patch. The patch size (ps) is this times `resolution`.
        patch_pixels: u32 = 8, range = Range::from_to(2.0, 32.0);
        /// Levels of the hierarchy; one is SCSM. Pixels of each are twice as wide as those of the level below it.
        levels: u32 = 3, range = Range::from_to(1.0, MAX_LEVELS as f64);
        /// Largest standard deviation of depth in a pixel (rho_max_depth). What deviates more goes to the level below;
        /// the lowest level takes all.
        max_depth_deviation: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "`resolution` / sqrt(3), at which every level accepts sheets as thick as those of the lowest",
            another_scene = true;
        /// Largest standard deviation of colour in a pixel (rho_max_rgb), root mean square of the channels.
        max_color_deviation: f64 = MAX_COLOR_DEVIATION, range = Range::POSITIVE, unit = "grey levels", another_scene = true;
        /// Least fraction of its pixels that a patch covers. The level below describes what covers less.
        min_coverage: f64 = 0.9, range = Range::above_to(0.0, 1.0), another_scene = true;
        /// How places of patches are chosen. 'greedy' takes the best coverage first, then aligned neighbours;
        /// 'subsampled' takes a patch per cube, as SCSM does, to compare with.
        placement: Placement = Placement::Greedy, another_scene = true;
        /// Most entries of a depth dictionary. Those that no patch uses are dropped.
        depth_atoms: Option<u32> = None, range = Range::from_to(1.0, 65_535.0), none = "one for each 80 patches, 16 to 128; 500 with `published`";
        /// Most entries of a colour dictionary. Those that no patch uses are dropped.
        color_atoms: Option<u32> = None, range = Range::from_to(1.0, 65_535.0), none = "one for each 40 patches, 32 to 256; 3500 with `published`";
        /// Most dictionary entries that describe the depth of one patch (k, eq. 1).
        depth_sparsity: u32 = 6, range = Range::from_to(1.0, MAX_SPARSITY as f64), another_scene = true;
        /// Most dictionary entries that describe the colour of one patch (k, eq. 1).
        color_sparsity: u32 = 12, range = Range::from_to(1.0, MAX_SPARSITY as f64), another_scene = true;
        /// Root mean square error at which coding of a patch's depth ends, on the lowest level. Each level above has
        /// half the tolerance of the one below, since its errors spread over larger patches.
        depth_tolerance: Option<f64> = None, range = Range::LENGTH, unit = "metres",
            none = "a fifth of `resolution`", another_scene = true;
        /// Root mean square error at which coding of a patch's colour ends, on the lowest level. It is halved from level
        /// to level likewise.
        color_tolerance: f64 = 7.0, range = Range::from_to(0.001, 255.0), unit = "grey levels", another_scene = true;
        /// Most iterations of weighted K-SVD per dictionary.
        iterations: u32 = 8, range = Range::from_to(1.0, 1000.0);
        /// Bitmasks of all levels have pixels of the lowest one: coarse patches then have the gaps and rims of the scan.
        /// Otherwise a bitmask has the pixels of its patch, as printed.
        fine_masks: bool = true, another_scene = true;
        /// All levels have one dictionary per channel, learned from what all of them have to code, in tolerances of their
        /// level. Otherwise each level learns its own, as printed.
        one_dictionary: bool = true;
        /// A patch takes the samples that growth from its middle reaches in steps of depth up to a gate: a pixel at
        /// the lowest level. Otherwise it takes all in its cube, as printed.
        growth_gate: bool = true, another_scene = true;
        /// Pixels that the mean place of a pixel's samples may be off its centre above the lowest level, where bitmasks
        /// are not fine. With infinity there is no such rule, as printed.
        max_pixel_offset: f64 = MAX_PIXEL_OFFSET, range = Range::above_to(0.0, f64::INFINITY), unit = "pixels", another_scene = true;
        /// Means of each patch are coded apart, those of colour as luma and chroma. Otherwise they are part of the sparse
        /// codes, as printed.
        means_apart: bool = true, another_scene = true;
        /// Entries of dictionaries are rounded to 8 bits. Otherwise to 16, which stand for the paper's real numbers.
        small_atoms: bool = true;
        /// A sample belongs to one patch. Otherwise a patch shows all samples in its cube that its level has to describe,
        /// and patches overlap, as printed.
        disjoint: bool = true, another_scene = true;
        /// Most patches that a dictionary is learned from, those with most energy.
        max_training_signals: usize = 6000, range = Range::count_from(1.0);
        /// How the error of a range measurement grows with the range. 'structured-light' is with its square, as for
        /// Kinects. Ranges are those of the cloud, or distances to its viewpoints; without both all points weigh the same.
        sensor: Sensor = Sensor::StructuredLight, another_scene = true;
        /// Keeps points that are far from all others. Otherwise those of which a few would make the scene many times as
        /// large as it is are left out, and counted in the report.
        keep_outliers: bool = false, another_scene = true;
        /// Seed of the first entries of the dictionaries.
        random_state: u64 = 0, range = Range::SEED;
    }
}

impl HscsmOptions {
    /// These options with all that is not in the paper switched off, where the method as printed was asked for.
    #[must_use]
    pub(super) fn in_force(&self) -> Self {
        if !self.published {
            return self.clone();
        }
        Self {
            depth_atoms: self.depth_atoms.or(Some(PUBLISHED_DEPTH_ATOMS)),
            color_atoms: self.color_atoms.or(Some(PUBLISHED_COLOR_ATOMS)),
            fine_masks: false,
            one_dictionary: false,
            growth_gate: false,
            max_pixel_offset: f64::INFINITY,
            means_apart: false,
            small_atoms: false,
            disjoint: false,
            max_training_signals: usize::MAX,
            ..self.clone()
        }
    }

    /// Most entries of the depth dictionary of `n_patches` patches.
    pub(super) fn depth_atoms(&self, n_patches: usize) -> usize {
        let of_patches =
            (n_patches / PATCHES_PER_DEPTH_ATOM).clamp(MAX_DEPTH_ATOMS / 8, MAX_DEPTH_ATOMS);
        self.depth_atoms.map_or(of_patches, |n| n as usize)
    }

    /// Most entries of the colour dictionary of `n_patches` patches.
    pub(super) fn color_atoms(&self, n_patches: usize) -> usize {
        let of_patches =
            (n_patches / PATCHES_PER_COLOR_ATOM).clamp(MAX_COLOR_ATOMS / 8, MAX_COLOR_ATOMS);
        self.color_atoms.map_or(of_patches, |n| n as usize)
    }

    /// Side of a pixel of the lowest level in force, metres. Learning chooses it before anything asks.
    pub fn resolution(&self) -> f64 {
        self.resolution.unwrap_or(f64::NAN)
    }

    /// How many times the pixels of `level`, counted from the coarsest, were doubled; 0 at the lowest level.
    pub(super) fn doublings(&self, level: u32) -> u32 {
        self.levels - 1 - level
    }

    /// Side of a pixel (pr) of `level`, counted from the coarsest, metres.
    pub fn pixel_size(&self, level: u32) -> f64 {
        self.resolution() * f64::from(1_u32 << self.doublings(level))
    }

    /// Side of a patch (ps) of `level`, metres.
    pub fn patch_size(&self, level: u32) -> f64 {
        self.pixel_size(level) * f64::from(self.patch_pixels)
    }

    /// Largest standard deviation of depth in force, metres.
    pub fn max_depth_deviation(&self) -> f64 {
        self.max_depth_deviation.unwrap_or(self.resolution() / 3.0_f64.sqrt())
    }

    /// Mask pixels per side of a pixel of `level`.
    pub fn mask_scale(&self, level: u32) -> u32 {
        if self.fine_masks { 1 << self.doublings(level) } else { 1 }
    }

    /// Depth tolerance in force at `level`, metres.
    pub fn depth_tolerance(&self, level: u32) -> f64 {
        let lowest = self.depth_tolerance.unwrap_or(0.2 * self.resolution());
        lowest / f64::from(1_u32 << self.doublings(level))
    }

    /// Colour tolerance in force at `level`, 0..255.
    pub fn color_tolerance(&self, level: u32) -> f64 {
        self.color_tolerance / f64::from(1_u32 << self.doublings(level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dictionaries_grow_with_the_patches_unless_they_are_given() {
        let options = HscsmOptions::default();
        assert_eq!(
            [0, 1280, 4000, 10_240, 100_000].map(|n| options.depth_atoms(n)),
            [16, 16, 50, 128, 128]
        );
        assert_eq!(
            [0, 1280, 4000, 10_240, 100_000].map(|n| options.color_atoms(n)),
            [32, 32, 100, 256, 256]
        );
        let published = HscsmOptions { published: true, ..options.clone() }.in_force();
        assert_eq!((published.depth_atoms(10), published.color_atoms(10)), (500, 3500));
        let given = HscsmOptions { depth_atoms: Some(7), ..options };
        assert_eq!((given.depth_atoms(0), given.depth_atoms(100_000)), (7, 7));
    }

    #[test]
    fn sizes_double_and_tolerances_halve_from_level_to_level_above() {
        let options = HscsmOptions { levels: 3, resolution: Some(0.01), ..HscsmOptions::default() };
        let levels = [0, 1, 2];
        assert_eq!(levels.map(|j| options.pixel_size(j)), [0.04, 0.02, 0.01]);
        assert_eq!(levels.map(|j| options.patch_size(j)), [0.32, 0.16, 0.08]);
        assert_eq!(levels.map(|j| options.depth_tolerance(j)), [0.0005, 0.001, 0.002]);
        assert_eq!(levels.map(|j| options.color_tolerance(j)), [1.75, 3.5, 7.0]);
    }
}
