//! How long work reports its progress, and learns that the caller wants it to stop.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

/// The caller asked for the work to stop; nothing was produced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled by the caller")]
pub struct Cancelled;

/// Receives progress and answers whether to go on.
///
/// Long loops call [`Progress::check`] at least ten times a second per thread, so that an interrupt is felt
/// within a second.
pub trait Progress: Sync {
    /// The work is in its stage `stage`, and `fraction` of all of it is done, 0 to 1.
    ///
    /// The fraction is that of the whole work that `self` was handed to, not of the stage. A caller that hands
    /// its own progress on to several parts gives each a [`Part`] of it, so that a bar runs from 0 to 1 once.
    fn update(&self, stage: &'static str, fraction: f32);

    /// True when the caller no longer wants the result.
    fn is_cancelled(&self) -> bool;

    /// `Err(Cancelled)` when the caller no longer wants the result, for use with `?`.
    fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// No progress shown, never cancelled.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn update(&self, _stage: &'static str, _fraction: f32) {}

    fn is_cancelled(&self) -> bool {
        false
    }
}

/// The progress of one part of larger work: its 0 to 1 becomes a range of the whole, and never runs backwards.
pub struct Part<'a> {
    whole: &'a dyn Progress,
    /// Shown instead of the names that the part gives its own stages, if any.
    stage: Option<&'static str>,
    range: Range<f32>,
    /// The largest fraction reported, as bits: those of non-negative numbers are in the order of the numbers.
    furthest: AtomicU32,
}

impl<'a> Part<'a> {
    /// The part of `whole` from `range.start` to `range.end`, both 0 to 1.
    pub fn new(whole: &'a dyn Progress, range: Range<f32>) -> Self {
        let furthest = AtomicU32::new(range.start.max(0.0).to_bits());
        Self { whole, stage: None, range, furthest }
    }

    /// The same under the name `stage`, whatever the part calls its own stages.
    pub fn named(whole: &'a dyn Progress, stage: &'static str, range: Range<f32>) -> Self {
        Self { stage: Some(stage), ..Self::new(whole, range) }
    }
}

impl Progress for Part<'_> {
    fn update(&self, stage: &'static str, fraction: f32) {
        let Range { start, end } = self.range;
        let at = (start + (end - start) * fraction.clamp(0.0, 1.0)).max(0.0);
        let furthest = self.furthest.fetch_max(at.to_bits(), Ordering::Relaxed);
        self.whole.update(self.stage.unwrap_or(stage), at.max(f32::from_bits(furthest)));
    }

    fn is_cancelled(&self) -> bool {
        self.whole.is_cancelled()
    }
}

/// Counts finished parts of parallel work, and asks after each whether to go on.
pub struct Meter<'a> {
    progress: &'a dyn Progress,
    stage: &'static str,
    total: usize,
    done: AtomicUsize,
}

impl<'a> Meter<'a> {
    /// Work of `total` parts in the stage `stage`.
    pub fn new(progress: &'a dyn Progress, stage: &'static str, total: usize) -> Self {
        Self { progress, stage, total, done: AtomicUsize::new(0) }
    }

    /// One more part is done.
    ///
    /// # Errors
    /// [`Cancelled`] when the caller no longer wants the result.
    pub fn step(&self) -> Result<(), Cancelled> {
        self.progress.check()?;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.progress.update(self.stage, done as f32 / self.total.max(1) as f32);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Default)]
    struct Seen(Mutex<Vec<(&'static str, f32)>>);

    impl Progress for Seen {
        fn update(&self, stage: &'static str, fraction: f32) {
            self.0.lock().unwrap().push((stage, fraction));
        }

        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_part_maps_to_its_range_and_never_runs_backwards() {
        let seen = Seen::default();
        let half = Part::named(&seen, "half", 0.5..1.0);
        let quarter = Part::new(&half, 0.0..0.5);
        quarter.update("inner", 0.5);
        quarter.update("inner", 1.0);
        quarter.update("inner", 0.0);
        half.update("inner", 0.25);
        half.update("inner", 2.0);
        assert!(half.is_cancelled());
        assert_eq!(*seen.0.lock().unwrap(), [0.625, 0.75, 0.75, 0.75, 1.0].map(|f| ("half", f)));
        Part::new(&seen, 0.0..1.0).update("own name", 0.5);
        assert_eq!(seen.0.lock().unwrap().last(), Some(&("own name", 0.5)));
    }
    #[test]
    fn a_meter_counts_parts_and_stops() {
        #[derive(Default)]
        struct Willing(Seen);
        impl Progress for Willing {
            fn update(&self, stage: &'static str, fraction: f32) {
                self.0.update(stage, fraction);
            }
            fn is_cancelled(&self) -> bool {
                false
            }
        }
        let willing = Willing::default();
        let meter = Meter::new(&willing, "parts", 4);
        assert!((0..4).all(|_| meter.step().is_ok()));
        let seen = [0.25, 0.5, 0.75, 1.0].map(|f| ("parts", f));
        assert_eq!(*willing.0.0.lock().unwrap(), seen);
        assert_eq!(Meter::new(&Seen::default(), "parts", 4).step(), Err(Cancelled));
    }
}
