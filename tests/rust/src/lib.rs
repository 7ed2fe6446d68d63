//! Integration tests that cross crates: a member of its own, since a virtual workspace runs no top-level `tests/`.
//! Here is what several of them share.
#![allow(clippy::unwrap_used)]

pub mod contract;
pub mod files;
pub mod interrupts;
pub mod scenes;

pub use files::{LIMITS, assert_same_numbers, golden};
pub use interrupts::{Stop, assert_stops_when_asked};
