//! Measures of runs: energy ledgers, contact statistics, sampled trajectories, event rows.
#![allow(clippy::unwrap_used)] // helpers of tests are not recognised as tests

mod contacts;
mod ledger;
mod rows;
mod trains;
