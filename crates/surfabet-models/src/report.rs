//! What a learning run tells about itself, whatever the family.

use std::time::Instant;

use surfabet_geom::PointCloud;

/// One stage of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// What was done.
    pub name: &'static str,
    /// Wall-clock seconds it took.
    pub seconds: f64,
}

/// How a model came about. It is not part of the file: a model read back has an empty report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Seconds per stage, in order, over all levels.
    pub stages: Vec<Stage>,
    /// Counts and measures by name, in order: points in, patches, atoms, ...
    pub figures: Vec<(&'static str, f64)>,
    /// Counts and measures of each level of a hierarchy, coarsest first.
    pub levels: Vec<Vec<(&'static str, f64)>>,
    /// Objective per iteration, by the name of what was minimised.
    pub objectives: Vec<(String, Vec<f64>)>,
    /// Iterations per objective, summed.
    pub iterations: usize,
    /// Why learning ended.
    pub stop_reason: &'static str,
    /// What the cloud had and the model does not keep.
    pub not_kept: Vec<&'static str>,
}

impl Report {
    /// Runs `work` as the stage `name` and notes its time.
    pub(crate) fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let value = work();
        self.add_time(name, start.elapsed().as_secs_f64());
        value
    }

    /// Adds to the time of the stage `name`, which may come back level after level.
    pub(crate) fn add_time(&mut self, name: &'static str, seconds: f64) {
        match self.stages.iter_mut().find(|stage| stage.name == name) {
            Some(stage) => stage.seconds += seconds,
            None => self.stages.push(Stage { name, seconds }),
        }
    }

    /// Adds to the figure `name`.
    pub(crate) fn add_figure(&mut self, name: &'static str, value: f64) {
        match self.figures.iter_mut().find(|figure| figure.0 == name) {
            Some(figure) => figure.1 += value,
            None => self.figures.push((name, value)),
        }
    }
}

/// A value carried beside a model: models that differ in it alone are equal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Beside<T>(pub T);

impl<T> PartialEq for Beside<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What `cloud` has beyond positions and is not among `kept`, by name.
pub(crate) fn lost(cloud: &PointCloud, kept: &[&str]) -> Vec<&'static str> {
    [
        ("colors", cloud.colors().is_some()),
        ("intensities", cloud.intensities().is_some()),
        ("normals", cloud.normals().is_some()),
        ("ranges", cloud.ranges().is_some()),
        ("viewpoints", cloud.viewpoints().is_some()),
    ]
    .into_iter()
    .filter_map(|(name, present)| (present && !kept.contains(&name)).then_some(name))
    .collect()
}
