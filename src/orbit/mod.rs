//! Periodic orbits, their multipliers, exponents and words, by the derivative of the motion.
//!
//! A [`Tangent`] observes a run and carries columns of the derivative along arcs and across jumps. A [`SectionMap`] maps a state at phase 0
//! over whole cycles, with the derivative; Newton's method on it solves for orbits, stable or not. A [`GuardMap`] maps a state from one
//! event of a kind to the next, without need of a period.

pub(crate) mod approach;
pub(crate) mod averages;
mod crossing;
pub(crate) mod exponents;
pub(crate) mod frame;
pub(crate) mod kind;
mod mover;
mod newton;
mod partners;
pub mod pictures;
mod report;
pub(crate) mod rest;
mod search;
mod section;
mod shooting;
mod torus;
pub(crate) mod unknowns;
pub mod words;

pub use crate::tangent::{Corner, Tangent};
pub use approach::{Approach, ApproachEnd};
pub use crossing::{Crossing, GuardMap};
pub use exponents::{Averaging, Exponents, Finite, INTERRUPTED, Lyapunov, WithoutSaltation};
pub use kind::{Motion, MotionKind, WatchTime, decide};
pub(crate) use newton::MARGINAL;
pub use newton::{NewtonFailure, Orbit};
pub use report::components;
pub use search::{LONGEST, Search, SearchResult, SearchState};
pub use section::{Image, Section, SectionMap};
pub use torus::decide_on_torus;
pub use unknowns::Drift;
pub(crate) use unknowns::Unknowns;
