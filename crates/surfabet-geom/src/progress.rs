//! How long work tells how far it is, and learns that nobody waits for it any more.

/// The caller asked for the work to stop; nothing was produced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled by the caller")]
pub struct Cancelled;

/// Receives progress and answers whether to go on.
///
/// Long loops call [`Progress::check`] at least ten times a second per thread, so that an interrupt is felt
/// within a second.
pub trait Progress: Sync {
    /// Work named `stage` is at `fraction` of its way, 0 to 1.
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
