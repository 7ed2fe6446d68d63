//! From a cloud to planes, step by step.

use surfabet_geom::{PointCloud, Progress};

use super::coding::rounded;
use super::fit::{Fit, Iteration, PublishedFit, Trace};
use super::model::PlaneModel;
use super::options::PlanesOptions;
use super::patch::Patch;
use super::points::{Points, check_weights};
use crate::contract::SurfaceModel;
use crate::error::Result;
use crate::options::Options;
use crate::report::{AttributeFigures, Report, figures, lost};
use crate::stages::Stages;
use crate::start::{Leave, Start};

/// The stages and their shares of the progress: the time of each in per cent, on scans of a room and of a street.
const STAGES: &[(&str, f32)] = &[
    ("measuring the cloud", 2.0),
    ("sorting points", 2.0),
    ("first patches", 4.0),
    ("fitting", 92.0),
    ("rounding patches", 2.0),
];

/// What the file keeps of a cloud beyond positions.
const KEPT: [&str; 3] = ["colors", "intensities", "normals"];

/// Where the least grid size comes from when it is not given.
const GRID_SIZE_REASON: &str = "by the spacing of the points and their noise";

/// The report of [`learn`].
pub type PlanesReport = Report<Option<PlanesFigures>>;

figures! {
    /// What [`learn`] counts and measures.
    pub struct PlanesFigures {
        /// Points of the cloud.
        pub points: usize = "points",
        /// Points at different places.
        pub distinct_points: usize = "distinct points",
        /// Patches that the fit started from.
        pub first_patches: usize = "first patches",
        /// Patches of the model.
        pub patches: usize = "patches",
        /// The grid size G that was found, metres.
        pub grid_size: f64 = "grid size",
        /// Points of the cloud that support no patch.
        pub outliers: u64 = "outliers",
    }
}

/// Learns planar patches from a cloud; `weights` are by how much each point counts, one if `None`.
///
/// A cloud without anything flat, of a single point or a line, gives a model without patches, in which every point is
/// an outlier. The result depends on cloud, weights and options alone, not on the number of threads or the order of
/// the points.
///
/// # Errors
/// [`crate::Error::EmptyCloud`], [`crate::Error::InvalidParameter`] for options or weights outside their domain,
/// [`crate::Error::TooLarge`] when the scene does not fit the position step, [`crate::Error::Cancelled`].
pub fn learn(
    cloud: &PointCloud,
    weights: Option<&[f32]>,
    options: &PlanesOptions,
    progress: &dyn Progress,
) -> Result<PlaneModel> {
    options.check()?;
    check_weights(cloud.len(), weights)?;
    let mut stages = Stages::new(STAGES, progress);
    let n_given = cloud.len();
    let leave = Leave::unless(options.keep_outliers, Leave::Strays);
    let mut start = stages.run("measuring the cloud", |progress| {
        Start::of(cloud, options.quality, leave, progress)
    })?;
    let cloud = start.cloud.clone();
    let cloud: &PointCloud = &cloud;
    let weights = weights.map(|weights| start.kept(weights));
    let weights = weights.as_deref();
    // Distinct points along a space-filling curve, in a tree of boxes.
    let points = stages.run("sorting points", |_| Points::new(cloud, weights))?;
    let points = if options.published {
        // The paper knows neither viewpoints nor scan lines.
        points.without_facing()
    } else {
        points.on_lines(start.survey.line_spacing)
    };
    let Fitted { patches, grid_size, smallest_grid_size, first_patches, trace } =
        fitted(&points, options, &mut stages)?;
    // The integers of the file; labels of the points, colours and intensities of the tiles (III).
    let model = stages.run("rounding patches", |progress| {
        rounded(cloud, &points, &patches, grid_size, options, progress)
    })?;
    let model = model.with_points_left_out(&start.left_out, n_given);
    let figures = PlanesFigures {
        points: cloud.len(),
        distinct_points: points.len(),
        first_patches,
        patches: patches.len(),
        grid_size,
        outliers: model.header().n_outliers,
    };
    let present = [model.has_color(), model.has_intensity()];
    let attributes = AttributeFigures::of_last_streams(&model.price(), present);
    let of = |value: fn(&Iteration) -> f64| trace.iterations.iter().map(value).collect();
    let mut report = PlanesReport {
        stages: stages.finish(),
        figures: Some(figures),
        objectives: vec![
            ("mean distance".into(), of(|i| i.mean_distance)),
            ("share of points that support a patch".into(), of(|i| i.supporting)),
            ("patches".into(), of(|i| i.patches as f64)),
            ("grid size".into(), of(|i| i.grid_size)),
        ],
        iterations: trace.iterations.len(),
        stop_reason: trace.stop_reason,
        attributes,
        not_kept: lost(cloud, &KEPT),
        ..Report::default()
    };
    if let Some(smallest) = smallest_grid_size {
        start.note("min_grid_size", smallest, GRID_SIZE_REASON.to_owned());
    }
    start.report(0.0, &mut report);
    Ok(model.with_report(report))
}

/// What comes out of a fit.
struct Fitted {
    patches: Vec<Patch>,
    grid_size: f64,
    /// Where it follows from the data.
    smallest_grid_size: Option<f64>,
    first_patches: usize,
    trace: Trace,
}

/// Fits patches to the points, by the method as printed where the options say so.
fn fitted(points: &Points, options: &PlanesOptions, stages: &mut Stages<'_>) -> Result<Fitted> {
    if options.published {
        let mut fit = stages.run("first patches", |p| PublishedFit::new(points, options, p))?;
        let first_patches = fit.patches.len();
        let trace = stages.run("fitting", |progress| fit.run(progress))?;
        let PublishedFit { patches, grid_size, .. } = fit;
        return Ok(Fitted { patches, grid_size, smallest_grid_size: None, first_patches, trace });
    }
    // Patches where cells are flat, or at random (II-B, III).
    let mut fit = stages.run("first patches", |progress| Fit::new(points, options, progress))?;
    let first_patches = fit.patches().len();
    // EMPF, split, EMPF and merge in turn, until distances are stable (II-B).
    let trace = stages.run("fitting", |progress| fit.run(progress))?;
    let (grid_size, smallest) = (fit.grid_size(), fit.smallest_grid_size());
    let smallest_grid_size = options.min_grid_size.is_none().then_some(smallest);
    let patches = fit.into_patches();
    Ok(Fitted { patches, grid_size, smallest_grid_size, first_patches, trace })
}
