//! How event-driven and penalty codes fail, case by case: the letters and numbers are those of `docs/FAILURES.md`.

mod accumulation;
mod finding;
mod laws;
mod long_runs;
mod ordering;
mod reports;
