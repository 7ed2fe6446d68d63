//! Criterion benchmarks of the workspace; run them with `cargo bench -p surfabet-benches`.

use std::time::Duration;

use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;
use surfabet_models::Stage;

/// Seconds of one stage of a run, as its own report times them.
pub fn seconds(stages: &[Stage], stage: &str) -> f64 {
    stages.iter().find(|s| s.name == stage).map_or(0.0, |s| s.seconds)
}

/// A benchmark of what takes `seconds()` of a run that takes much longer.
///
/// Rounds are chosen by these seconds alone, and would be thousands of runs: one run stands for all rounds of its sample,
/// and one is enough to warm up.
pub fn bench_part(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    mut seconds: impl FnMut() -> f64,
) {
    group.warm_up_time(Duration::from_millis(1));
    group.bench_function(name, |b| {
        b.iter_custom(|rounds| Duration::from_secs_f64(seconds() * rounds as f64));
    });
    // Criterion's own default.
    group.warm_up_time(Duration::from_secs(3));
}

/// A benchmark of each of some stages of a run.
pub fn bench_stages(
    group: &mut BenchmarkGroup<'_, WallTime>,
    stages: &[&str],
    mut run: impl FnMut() -> Vec<Stage>,
) {
    for stage in stages {
        bench_part(group, stage, || seconds(&run(), stage));
    }
}
