//! Motions: measures of runs, orbits, branches, maps, thresholds.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod branch;
mod map;
mod measures;
mod orbit;
mod rattle;
mod simulation;
mod steady;
