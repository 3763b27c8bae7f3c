//! Terms of a hybrid automaton: modes, guards, flows, instants. This module contains no algorithm.
//!
//! `docs/EVENTS.md` defines the terms.

mod columns;
mod contact;
mod decimal;
mod flow;
mod guard;
mod instant;
mod lane;
mod mode;
mod power;
mod rows;
mod system;

pub use columns::Columns;
pub use contact::{ContactMode, ContactView, Watch};
pub use flow::VectorField;
pub(crate) use flow::{AGREED, ARRIVED, GATHERED, MOST_MODES, are_finite, normalise};
pub(crate) use lane::{PASSED, RECORDED};
// Data between the engine and the series of a train: public for the traits that name them, without a promise.
#[doc(hidden)]
pub use flow::{
    FULL_PRECISION, GuardValue, Jet, JetField, JetRequest, Leap, LeapCounts, Passage, Power, SAMPLES, Samples,
    StepQuantity, share_of,
};
pub use guard::{GuardId, GuardSet};
pub use instant::{Clock, Instant, Wide};
#[doc(hidden)]
pub use lane::{Lane, LaneEvent, LaneHost, LaneLimits, LanePoint, LaneRecords, LaneTangent, Lap, LapEnd, Rebound};
pub use mode::Mode;
pub use power::{EnergyJump, PowerBalance, Powers, Transition};
#[doc(hidden)]
pub use rows::{ContactRows, Four, LANES, ORDER, ROW, Series, StepRows};
pub use system::{HybridSystem, Jump, ModelError, Rates};
