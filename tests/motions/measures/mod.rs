//! Measures of runs: energy ledgers, contact statistics, sampled trajectories, event rows, spectra.

mod bearings;
mod contacts;
mod extremes;
mod impacts;
mod ledger;
mod rows;
mod scaled;
mod settle;
mod shown;
mod spectrum;
mod trains;
mod transmission;
