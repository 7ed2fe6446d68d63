//! The whole way from a cloud to planes.

use surfabet_geom::{PointCloud, Progress};

use super::fit::{Fit, Iteration, stable};
use super::model::PlaneModel;
use super::options::PlanesOptions;
use super::points::Points;
use crate::error::Result;
use crate::options::Options;
use crate::report::{Report, lost};
use crate::stages::Stages;

/// The stages and their shares of the progress: the time of each in per cent, on scans of a room and of a street.
const STAGES: &[(&str, f32)] = &[
    ("sorting points", 2.0),
    ("first patches", 4.0),
    ("fitting", 92.0),
    ("rounding patches", 2.0),
];

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
    let mut report = Report::default();
    let mut stages = Stages::new(STAGES, progress);
    let points = stages.run("sorting points", |_| Points::new(cloud, weights))?;
    let mut fit = stages.run("first patches", |progress| Fit::new(&points, options, progress))?;
    report.add_figure("points", cloud.len() as f64);
    report.add_figure("distinct points", points.len() as f64);
    report.add_figure("first patches", fit.patches().len() as f64);
    let (trace, stop_reason) =
        stages.run("fitting", |progress| run(&mut fit, options, progress))?;
    report.add_figure("patches", fit.patches().len() as f64);
    report.add_figure("grid size", fit.grid_size());
    report.iterations = trace.len();
    report.stop_reason = stop_reason;
    let of = |value: fn(&Iteration) -> f64| trace.iter().map(value).collect::<Vec<f64>>();
    report.objectives = vec![
        ("mean distance".into(), of(|i| i.mean_distance)),
        ("share of points that support a patch".into(), of(|i| i.supporting)),
        ("patches".into(), of(|i| i.patches as f64)),
        ("grid size".into(), of(|i| i.grid_size)),
    ];
    report.not_kept = lost(cloud, &["colors", "normals"]);
    let (size, step) = (fit.grid_size(), options.color_step);
    let mut model = stages.run("rounding patches", |progress| {
        PlaneModel::new(cloud, &points, fit.patches(), size, step, report, progress)
    })?;
    model.report_mut().stages = stages.finish();
    Ok(model)
}

/// Iterates until stable and no flat points are left without a patch.
fn run(
    fit: &mut Fit<'_>,
    options: &PlanesOptions,
    progress: &dyn Progress,
) -> Result<(Vec<Iteration>, &'static str)> {
    let mut trace: Vec<Iteration> = Vec::new();
    let mut stop_reason = "reached the largest number of iterations";
    // Patches are added once to what has settled; then it settles once more.
    let mut complete = false;
    for i in 0..options.max_iterations {
        progress.update("fitting", i as f32 / options.max_iterations as f32);
        let now = fit.iterate(progress)?;
        let settled = trace.last().is_some_and(|last| stable(last, &now, options.tolerance));
        trace.push(now);
        if settled && complete {
            stop_reason = "distances to the patches are stable";
            break;
        }
        if settled || (i + 1) % options.new_patches_every == 0 {
            let added = fit.add_patches(progress)?;
            complete = settled;
            if settled && added == 0 {
                stop_reason = "distances to the patches are stable";
                break;
            }
        }
    }
    fit.finish(progress)?;
    Ok((trace, stop_reason))
}
