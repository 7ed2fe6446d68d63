//! Callers that ask long work to stop.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use surfabet::Progress;
use surfabet_models::{Error, Result};

/// Nobody waits for the result.
#[derive(Debug, Clone, Copy)]
pub struct Stop;

impl Progress for Stop {
    fn update(&self, _stage: &'static str, _fraction: f32) {}

    fn is_cancelled(&self) -> bool {
        true
    }
}

/// Asks to stop from a certain question on.
struct StopsAt {
    question: usize,
    asked: AtomicUsize,
}

impl StopsAt {
    fn new(question: usize) -> Self {
        Self { question, asked: AtomicUsize::new(0) }
    }
}

impl Progress for StopsAt {
    fn update(&self, _stage: &'static str, fraction: f32) {
        assert!((0.0..=1.0).contains(&fraction), "{fraction}");
    }

    fn is_cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.question
    }
}

/// Asks to stop as soon as a stage is named; without one, notes the stages.
struct StopsIn {
    stage: Option<&'static str>,
    reached: AtomicBool,
    stages: Mutex<BTreeSet<&'static str>>,
}

impl StopsIn {
    fn new(stage: Option<&'static str>) -> Self {
        Self { stage, reached: AtomicBool::new(false), stages: Mutex::default() }
    }
}

impl Progress for StopsIn {
    fn update(&self, stage: &'static str, _fraction: f32) {
        self.stages.lock().unwrap().insert(stage);
        if self.stage == Some(stage) {
            self.reached.store(true, Ordering::Relaxed);
        }
    }

    fn is_cancelled(&self) -> bool {
        self.reached.load(Ordering::Relaxed)
    }
}

fn assert_cancelled<T>(result: Result<T>, when: &str) {
    let error = result.err();
    assert!(matches!(error, Some(Error::Cancelled(_))), "{when}: {error:?}");
}

/// Whichever of its questions is answered with a stop, `work` ends; the number of its questions when none is.
pub fn assert_stops_when_asked<T>(work: impl Fn(&dyn Progress) -> Result<T>) -> usize {
    let never = StopsAt::new(usize::MAX);
    work(&never).unwrap();
    let asked = never.asked.into_inner();
    assert!(asked > 0);
    for question in (0..8).map(|i| i * (asked - 1) / 7) {
        assert_cancelled(work(&StopsAt::new(question)), &format!("question {question} of {asked}"));
    }
    asked
}

/// Stopped in any of its stages, `work` ends; the names of its stages.
pub fn assert_stops_in_every_stage<T>(
    work: impl Fn(&dyn Progress) -> Result<T>,
) -> BTreeSet<&'static str> {
    let never = StopsIn::new(None);
    work(&never).unwrap();
    let stages = never.stages.into_inner().unwrap();
    for &stage in &stages {
        assert_cancelled(work(&StopsIn::new(Some(stage))), stage);
    }
    stages
}
