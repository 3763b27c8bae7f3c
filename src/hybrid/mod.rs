//! Terms of a hybrid automaton: modes, guards, flows, instants. This module contains no algorithm.
//!
//! `docs/EVENTS.md` defines the terms.

mod contact;
mod decimal;
mod flow;
mod guard;
mod instant;
mod lane;
mod mode;
mod power;
mod system;

pub use contact::{ContactMode, ContactView, Watch};
pub(crate) use flow::{ARRIVED, normalise};
pub use flow::{
    FULL_PRECISION, GuardValue, Jet, JetField, JetRequest, Leap, LeapCounts, Passage, Power, SAMPLES, Samples,
    StepQuantity, VectorField, share_of,
};
pub use guard::{GuardId, GuardSet};
pub use instant::{Clock, Instant, Wide};
pub use lane::{Budget, Lane, LaneHost, LanePoint, Lap, LapEnd, Rebound};
pub use mode::Mode;
pub use power::{EnergyJump, PowerBalance, Powers, Transition};
pub use system::{HybridSystem, Jump, ModelError, Rates};
