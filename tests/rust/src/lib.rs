//! Integration tests that cross crates: a member of its own, since a virtual workspace runs no top-level `tests/`.
//! Here is what several of them share.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use surfabet::{Limits, Model, Progress};
use surfabet_models::{Error, Result};

/// What a reader of untrusted files would allow.
pub const LIMITS: Limits = Limits { max_items: 1_000_000, max_bytes: 64 << 20 };

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

/// Whichever of its questions says so, `work` ends; how many it asks when nobody stops it.
pub fn assert_stops_when_asked<T>(work: impl Fn(&dyn Progress) -> Result<T>) -> usize {
    let never = StopsAt::new(usize::MAX);
    work(&never).unwrap();
    let asked = never.asked.into_inner();
    assert!(asked > 0);
    for question in (0..8).map(|i| i * (asked - 1) / 7) {
        let error = work(&StopsAt::new(question)).err();
        assert!(matches!(error, Some(Error::Cancelled(_))), "{question} of {asked}: {error:?}");
    }
    asked
}

/// Where files of earlier releases lie.
pub fn golden(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../golden").join(name)
}

/// Cut at any byte, a file is an error.
pub fn assert_cuts_are_errors(file: &[u8]) {
    for end in 0..file.len() {
        assert!(Model::from_bytes(&file[..end], &LIMITS).is_err(), "{end} of {}", file.len());
    }
}

/// With any bit flipped, a file is an error or gives the same model.
pub fn assert_flipped_bits_are_noticed(file: &[u8]) {
    let model = Model::from_bytes(file, &LIMITS).unwrap();
    for bit in 0..8 * file.len() {
        let mut damaged = file.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        if let Ok(found) = Model::from_bytes(&damaged, &LIMITS) {
            assert_eq!(found, model, "bit {bit}");
        }
    }
}

/// Two listings have the same lines of numbers, each within `tolerance` of its column and its expected value.
pub fn assert_same_numbers(found: &str, expected: &str, tolerance: impl Fn(usize, f64) -> f64) {
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').map(|n| n.parse().unwrap()).collect() };
    assert_eq!(found.lines().count(), expected.lines().count());
    for (found, expected) in found.lines().zip(expected.lines()) {
        let [f, e] = [found, expected].map(numbers);
        let near = |i: usize| (f[i] - e[i]).abs() <= tolerance(i, e[i]);
        assert!(
            f.len() == e.len() && (0..f.len()).all(near),
            "{found} where {expected} was written"
        );
    }
}
