//! Measures of runs: energy ledgers, contact statistics, sampled trajectories, event rows.

mod contacts;
mod ledger;
mod rows;
mod trains;
