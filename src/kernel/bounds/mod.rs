//! Bounds on the truncation of a step, its length, and the guards with their errors.

pub mod bound;
pub mod defect;
pub mod guards;
mod reach;
pub mod sizes;
