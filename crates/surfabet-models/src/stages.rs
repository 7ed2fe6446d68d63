//! The stages of a learning run: each has its name and its share of the progress in one table.

use std::time::Instant;

use surfabet_geom::{Part, Progress};

use crate::error::Result;
use crate::report::Stage;

/// Runs the stages of a method one after the other: shows their names and how far the whole run is, and takes
/// their times for the report.
///
/// A method lists its stages once, in the order in which they run:
///
/// ```ignore
/// const STAGES: &[(&str, f32)] = &[("sorting points", 1.0), ("first patches", 2.0), ("fitting", 7.0)];
///
/// let mut stages = Stages::new(STAGES, progress);
/// let points = stages.run("sorting points", |_| Points::new(cloud))?;
/// let patches = stages.run("fitting", |progress| fit(&points, progress))?;
/// report.stages = stages.finish();
/// ```
pub struct Stages<'a> {
    /// Names and shares.
    table: &'static [(&'static str, f32)],
    progress: &'a dyn Progress,
    /// The sum of the shares that are done.
    done: f32,
    times: Vec<Stage>,
}

impl<'a> Stages<'a> {
    /// Stages with their shares of the progress: roughly the times that they take, in any unit.
    pub fn new(table: &'static [(&'static str, f32)], progress: &'a dyn Progress) -> Self {
        Self { table, progress, done: 0.0, times: Vec::new() }
    }

    /// Runs `work` as the stage `name`. Its progress, 0 to 1, becomes the share of the stage under the stage's
    /// name, whatever names `work` gives to what it does.
    ///
    /// # Errors
    /// Those of `work`; [`crate::Error::Cancelled`] when the caller asked to stop before it or in its course.
    pub fn run<T>(
        &mut self,
        name: &'static str,
        work: impl FnOnce(&dyn Progress) -> Result<T>,
    ) -> Result<T> {
        // Stages that this run leaves out count as done.
        let before = self.table.iter().take_while(|stage| stage.0 != name);
        self.done = before.map(|stage| stage.1).sum::<f32>().max(self.done);
        self.run_round(name, 1, work)
    }

    /// Runs `work` as one of `rounds` rounds of the stage `name`, which comes back level after level, other stages
    /// in between. The share of the stage is that of all of its rounds.
    ///
    /// # Errors
    /// As [`Stages::run`].
    pub fn run_round<T>(
        &mut self,
        name: &'static str,
        rounds: usize,
        work: impl FnOnce(&dyn Progress) -> Result<T>,
    ) -> Result<T> {
        let share = self.table.iter().find(|stage| stage.0 == name).map(|stage| stage.1);
        debug_assert!(share.is_some(), "the table of stages has no {name:?}");
        let end = self.done + share.unwrap_or(0.0) / rounds as f32;
        let total: f32 = self.table.iter().map(|stage| stage.1).sum();
        // Parts of shares need not add up to the whole exactly.
        let share_of_all = |done: f32| (done / total).min(1.0);
        let range = share_of_all(self.done)..share_of_all(end);
        let part = Part::named(self.progress, name, range);
        part.check()?;
        part.update(name, 0.0);
        let start = Instant::now();
        let value = work(&part)?;
        self.add_time(name, start.elapsed().as_secs_f64());
        part.check()?;
        part.update(name, 1.0);
        self.done = end;
        Ok(value)
    }

    /// The seconds that each stage took, in the order of their first runs.
    pub fn finish(self) -> Vec<Stage> {
        self.times
    }

    /// Adds to the time of the stage `name`.
    fn add_time(&mut self, name: &'static str, seconds: f64) {
        match self.times.iter_mut().find(|stage| stage.name == name) {
            Some(stage) => stage.seconds += seconds,
            None => self.times.push(Stage { name, seconds }),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicBool, Ordering};

    use surfabet_geom::Cancelled;

    use super::*;
    use crate::Error;

    const STAGES: &[(&str, f32)] =
        &[("first", 1.0), ("left out", 1.0), ("placing", 4.0), ("coding", 2.0)];

    #[derive(Default)]
    struct Watch {
        seen: Mutex<Vec<(&'static str, f32)>>,
        stop: AtomicBool,
    }

    impl Progress for Watch {
        fn update(&self, stage: &'static str, fraction: f32) {
            self.seen.lock().unwrap().push((stage, fraction));
        }

        fn is_cancelled(&self) -> bool {
            self.stop.load(Ordering::Relaxed)
        }
    }

    #[test]
    fn progress_runs_once_from_0_to_1_and_times_are_summed_by_stage() {
        let watch = Watch::default();
        let mut stages = Stages::new(STAGES, &watch);
        let two = stages.run("first", |progress| {
            progress.update("an inner name", 0.5);
            Ok(2)
        });
        assert_eq!(two, Ok(2));
        for _ in 0..2 {
            stages.run_round("placing", 2, |_| Ok(())).unwrap();
            stages.run_round("coding", 2, |_| Ok(())).unwrap();
        }
        let names: Vec<&str> = stages.finish().iter().map(|stage| stage.name).collect();
        assert_eq!(names, ["first", "placing", "coding"]);
        let seen = watch.seen.into_inner().unwrap();
        assert_eq!(seen[..3], [("first", 0.0), ("first", 0.0625), ("first", 0.125)]);
        assert!(seen.is_sorted_by(|a, b| a.1 <= b.1), "{seen:?}");
        assert_eq!(seen.iter().filter(|s| s.0 == "placing").count(), 4);
    }

    #[test]
    fn a_stage_that_is_left_out_counts_as_done() {
        let watch = Watch::default();
        let mut stages = Stages::new(STAGES, &watch);
        stages.run("placing", |_| Ok(())).unwrap();
        stages.run("coding", |_| Ok(())).unwrap();
        let expected = [("placing", 0.25), ("placing", 0.75), ("coding", 0.75), ("coding", 1.0)];
        assert_eq!(watch.seen.into_inner().unwrap(), expected);
    }

    #[test]
    fn a_cancelled_run_ends_before_and_after_a_stage() {
        let watch = Watch::default();
        let mut stages = Stages::new(STAGES, &watch);
        let inside = stages.run("first", |_| {
            watch.stop.store(true, Ordering::Relaxed);
            Ok(())
        });
        assert_eq!(inside, Err(Error::Cancelled(Cancelled)));
        let before = stages.run("placing", |_| -> Result<()> { panic!("not reached") });
        assert_eq!(before, Err(Error::Cancelled(Cancelled)));
    }
}
