//! What learning and describing report.

use super::channels::dictionary::Learning;
use super::model::{Channel, Level};
use super::placement::OwnedPatch;
use crate::report::{Figures, Report, figures};

/// The report of learning and of describing.
pub type HscsmReport = Report<Option<HscsmFigures>>;

figures! {
    /// What learning and describing count, over all levels.
    pub struct HscsmFigures {
        /// Points of the cloud.
        pub points: usize = "points",
        /// Places that the points were merged to.
        pub samples: usize = "samples",
        /// Samples that belong to a patch.
        pub samples_covered: usize = "samples covered",
        /// Patches.
        pub patches: usize = "patches",
        /// Pixels of all patches that are set.
        pub set_pixels: usize = "set pixels",
        /// Area of the set pixels, square metres.
        pub area: f64 = "area",
        /// Entries of the dictionaries of depth.
        pub depth_entries: usize = "depth dictionary entries",
        /// Entries of the dictionaries of colour.
        pub color_entries: usize = "colour dictionary entries",
        /// Entries for depth that were asked for and not needed, where dictionaries were learned.
        pub depth_cropped: Option<usize> = "depth dictionary entries cropped",
        /// Entries for colour that were asked for and not needed, where dictionaries were learned.
        pub color_cropped: Option<usize> = "colour dictionary entries cropped",
    }
}

figures! {
    /// The same of a level.
    pub(super) struct LevelFigures {
        /// Side of a pixel, metres.
        pub pixel_size: f64 = "pixel size",
        /// Samples that belong to a patch.
        pub samples_covered: usize = "samples covered",
        /// Patches.
        pub patches: usize = "patches",
        /// Pixels that are set.
        pub set_pixels: usize = "set pixels",
        /// Area of the set pixels, square metres.
        pub area: f64 = "area",
        /// Entries of the dictionary of depth.
        pub depth_entries: usize = "depth dictionary entries",
        /// Entries of the dictionary of colour.
        pub color_entries: usize = "colour dictionary entries",
        /// Mean number of set pixels of a patch.
        pub pixels_per_patch: f64 = "set pixels per patch",
        /// Mean distance of a patch to the nearest other, metres.
        pub neighbor_distance: Option<f64> = "distance of neighbouring patches",
    }
}

impl LevelFigures {
    /// Of a level, its patches, and the mean distance of neighbours among them.
    pub fn new(level: &Level, patches: &[OwnedPatch], neighbor_distance: Option<f64>) -> Self {
        let entries = |channel: &Channel| channel.dictionary.n_atoms();
        let set_pixels = level.set_pixels();
        Self {
            pixel_size: level.pixel_size,
            samples_covered: patches.iter().map(|p| p.owned).sum(),
            patches: level.len(),
            set_pixels,
            area: level.covered_area(),
            depth_entries: entries(&level.depth),
            color_entries: level.color.as_ref().map_or(0, entries),
            pixels_per_patch: set_pixels as f64 / level.len().max(1) as f64,
            neighbor_distance,
        }
    }
}

/// A level, and how it came about.
pub(super) struct LearnedLevel {
    pub level: Level,
    pub figures: LevelFigures,
    /// How the dictionary of depth was learned; `None`: it was given, or there is nothing to code.
    pub depth: Option<Learning>,
    /// The same of colour.
    pub color: Option<Learning>,
}

impl HscsmFigures {
    /// Of all levels of a model of `points` points, merged to `samples`.
    fn new(points: usize, samples: usize, levels: &[LearnedLevel], one_dictionary: bool) -> Self {
        let sum = |of: fn(&LevelFigures) -> usize| levels.iter().map(|l| of(&l.figures)).sum();
        // Levels with one dictionary have its entries in common.
        let entries = |of: fn(&LevelFigures) -> usize| match (one_dictionary, levels.first()) {
            (true, Some(first)) => of(&first.figures),
            _ => sum(of),
        };
        let cropped = |of: fn(&LearnedLevel) -> &Option<Learning>| {
            levels.iter().filter_map(|l| of(l).as_ref()).map(|l| l.cropped).reduce(|a, b| a + b)
        };
        Self {
            points,
            samples,
            samples_covered: sum(|l| l.samples_covered),
            patches: sum(|l| l.patches),
            set_pixels: sum(|l| l.set_pixels),
            area: levels.iter().map(|l| l.figures.area).sum(),
            depth_entries: entries(|l| l.depth_entries),
            color_entries: entries(|l| l.color_entries),
            depth_cropped: cropped(|l| &l.depth),
            color_cropped: cropped(|l| &l.color),
        }
    }
}

/// The report of a run over `points` points, merged to `samples`, as far as it follows from the levels.
pub(super) fn report(
    points: usize,
    samples: usize,
    levels: &[LearnedLevel],
    one_dictionary: bool,
) -> HscsmReport {
    let mut report = HscsmReport {
        figures: Some(HscsmFigures::new(points, samples, levels, one_dictionary)),
        levels: levels.iter().map(|l| l.figures.named()).collect(),
        ..HscsmReport::default()
    };
    for (j, level) in levels.iter().enumerate() {
        let channels = [("learning depth", &level.depth), ("learning colour", &level.color)];
        for (channel, learning) in channels {
            let Some(learning) = learning else { continue };
            let name = if levels.len() == 1 || one_dictionary {
                channel.to_owned()
            } else {
                format!("{channel}, level {j}")
            };
            report.iterations += learning.iterations;
            report.objectives.push((name, learning.objective.clone()));
        }
    }
    report
}
