//! Bounds on the truncation of a step, its length, and the guards with their errors.
//!
//! A value of a guard has three errors:
//! - the truncation of the series, `tail`,
//! - the rounding of its row, `rounding`. Truncation and rounding at the root, over the slope there, are the uncertainty Δt of an event.
//! - the rounding of a value that is formed from the state alone, `afresh`. It limits the alarms, and the values that count as zero together.

pub mod bound;
pub mod defect;
pub mod guards;
mod reach;
pub mod sizes;
