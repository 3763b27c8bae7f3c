//! Studies of a scene: its motion after the transient, and the change of that with its numbers.
//!
//! [`steady`](mod@steady) runs a [`Simulation`](crate::Simulation) until its motion is periodic and measures it. [`identify`](mod@identify)
//! finds numbers of a scene from properties of a train. [`advise`] compares a scene with simpler models of itself.

pub mod advise;
pub mod branches;
mod changes;
#[cfg(feature = "plot")]
pub mod check_page;
pub mod claims;
mod error;
mod expression;
mod figures;
mod file;
pub mod fit;
pub mod identify;
mod kind;
mod measures;
#[cfg(feature = "plot")]
pub mod page;
pub mod plan;
mod questions;
pub mod rattle;
mod record;
#[cfg(feature = "plot")]
pub mod run_page;
pub mod sound;
pub mod steady;
mod steady_sweep;
#[cfg(test)]
#[path = "../../tests/unit/study.rs"]
mod tests;
mod threshold;
mod values;

pub use error::StudyError;
pub use figures::Context;
pub use kind::FigureKind;
pub(crate) use measures::{Measures, numbered};
pub(crate) use steady::measured;
pub use steady_sweep::{ContactMeasures, SteadySweep, SweepRow};
