//! What a learning run tells about itself, whatever the family.

use std::time::Instant;

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
    /// Seconds per stage, in order.
    pub stages: Vec<Stage>,
    /// Counts and measures by name, in order: points in, patches, atoms, ...
    pub figures: Vec<(&'static str, f64)>,
    /// Objective per iteration, by the name of what was minimised.
    pub objectives: Vec<(&'static str, Vec<f64>)>,
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
        self.stages.push(Stage { name, seconds: start.elapsed().as_secs_f64() });
        value
    }
}
