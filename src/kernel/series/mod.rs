//! Series of a step: its start, the recurrences, and what is read from them.

pub mod carry;
pub mod clock;
pub mod clocked;
pub mod fours;
mod held;
mod linear;
mod lone;
mod low;
mod rows;
pub mod start;
