//! The event semantics, line by line: the numbers are those of `docs/EVENTS.md`.

mod arcs;
mod bare;
mod causes;
mod clock;
mod crossing;
mod decimal;
mod drift;
mod endings;
mod ensemble;
mod first_root;
mod frequencies;
mod inherited;
mod instructions;
mod isolation;
mod leaps;
mod pressed;
mod release;
mod rest;
mod schedule;
mod several;
mod start;
pub mod support;
mod together;
