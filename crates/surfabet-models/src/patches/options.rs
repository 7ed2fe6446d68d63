//! What to learn.

use super::model::MAX_LEVELS;
use crate::options::{Range, options};
use crate::quality::Quality;
use crate::sensor::Sensor;

/// Steps of depth per pixel of the finest level: [`PatchesOptions::depth_step`] is a number of them.
pub(super) const DEPTH_STEPS: f64 = 16.0;

/// Pixels and bounds. What follows from them in a file, the cells of points beside the patches, is at most five times as large
/// and at least half as large, and is read from 1e-9 m to 1e6 m.
const LENGTH: Range = Range::from_to(1e-8, 1e5);

options! {
    /// Options of [`learn`](super::learn).
    pub struct PatchesOptions {
        /// Small files or fine detail. Sets `resolution`, unless that is given: 'small' doubles it, 'fine' halves it.
        quality: Quality = Quality::Balanced;
        /// Side of a pixel of the finest level. Smaller detail is lost, and all lengths of the method follow it.
        resolution: Option<f64> = None, range = LENGTH, unit = "metres",
            none = "from the data: 2.25 spacings of the points, 3 on scan lines and of rounded coordinates, 1.25 standard deviations of their noise or half of max_error (with max_error_forward all of it, or of that where it is less), whichever is most";
        /// Levels of the hierarchy. Patches of the finest are 8 pixels wide; from level to level above it, pixels and
        /// patches double in size.
        levels: u32 = 2, range = Range::from_to(1.0, MAX_LEVELS as f64);
        /// Largest distance of any input point to the cloud that is decoded as measured at the default spacing. Points
        /// that would be further away are kept beside the patches.
        max_error: Option<f64> = None, range = LENGTH, unit = "metres", none = "no bound";
        /// Largest distance of any decoded point to the input, as measured or as a surface at the default spacing: no surface
        /// is filled in where nothing was measured. Patches lose what would be further away.
        max_error_forward: Option<f64> = None, range = LENGTH, unit = "metres", none = "no bound";
        /// Least share of the points that are within the tolerance of the cloud decoded as measured: two spacings, three
        /// standard deviations of the noise, or two thirds of a given `resolution`, whichever is most; twice as much for
        /// 'small'. Points beside the patches make up
        /// for what these leave out. With 0 there are none, and with `max_error` this has no effect.
        completeness: f64 = 0.99, range = Range::from_to(0.0, 1.0);
        /// Squared error that a bit of geometry must save (lambda), summed over pixels and both directions. Larger makes
        /// smaller files.
        rate: f64 = 1.4, range = Range::POSITIVE, unit = "squared pixels";
        /// Rounding of depths, in pixels of the finest level.
        depth_step: Option<f64> = None,
            range = Range::from_to(1.0 / DEPTH_STEPS, 256.0 / DEPTH_STEPS).in_steps_of(1.0 / DEPTH_STEPS),
            unit = "pixels",
            none = "0.75, or an eighth of the gap where surfaces lie close behind one another and that is less";
        /// Looks for what recurs in the scene: patches are left out where others, moved, give the same surface, if that makes the file
        /// smaller. Takes two to three times as long; for buildings with equal rooms, or many equal things.
        recurrence: bool = false;
        /// Rounds of choosing patches. Each uses the prices that the coder learned in the round before.
        rounds: u32 = 3, range = Range::from_to(1.0, 10.0);
        /// Rounding of luma of a single cell. Means over n cells are rounded about sqrt(n) times finer; larger makes
        /// smaller files.
        color_step: u32 = 115, range = Range::from_to(1.0, 1024.0), unit = "grey levels";
        /// Rounding of chroma as a multiple of that of luma.
        chroma_ratio: f64 = 1.0, range = Range::from_to(0.25, 4.0);
        /// Squared error that a bit of colour must save.
        color_rate: f64 = 0.15, range = Range::POSITIVE, unit = "squared colour steps";
        /// Attributes to keep, by name: 'colors', 'intensities', or any that the cloud has beside them. Integers of at most
        /// 32 different values are labels: each cell has the most frequent. All others are scalars, which are averaged.
        attributes: Option<Vec<String>> = None, none = "colours and intensities, where the cloud has them";
        /// Rounding of intensities and other scalars of a single cell, as a share of their standard deviation. Means over n
        /// cells are rounded about sqrt(n) times finer; larger makes smaller files.
        attribute_step: f64 = 0.5, range = Range::from_to(0.001, 100.0), unit = "standard deviations";
        /// Squared error that a bit of a scalar must save.
        attribute_rate: f64 = 0.15, range = Range::POSITIVE, unit = "squared steps";
        /// How the error of a range measurement grows with the range. 'structured-light' is with its square, as for
        /// Kinects. Without ranges all points weigh the same.
        sensor: Sensor = Sensor::StructuredLight;
        /// Keeps points that are far from all others. Otherwise those of which a few would make the scene many times as
        /// large as it is are left out, and counted in the report.
        keep_outliers: bool = false;
    }
}
