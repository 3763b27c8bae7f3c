//! Events, laws of contact and integrators, on single motions.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod events;
mod failures;
mod integrators;
mod lane;
mod loads;
mod measured;
mod power_laws;
mod reference;
mod restitution;
mod tolerance;
