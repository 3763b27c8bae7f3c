//! Studies and comparisons, and the pictures and texts that they write.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod advise;
mod baseline;
mod claims;
mod compare;
mod figures;
mod fit;
mod identify;
mod output;
mod plot;
mod report;
mod sound;
mod stability;
mod study;
