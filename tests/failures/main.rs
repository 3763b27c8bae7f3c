//! How event-driven and penalty codes fail, case by case: the letters and numbers are those of `docs/FAILURES.md`.
#![allow(clippy::unwrap_used)] // helpers of tests are not recognised as tests

mod accumulation;
mod finding;
mod laws;
mod long_runs;
mod ordering;
mod reports;
#[path = "../events/support.rs"]
mod support;
