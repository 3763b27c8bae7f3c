//! The engine: flow, first event, jump, again.

mod advance;
mod alarm;
mod chatter;
mod instant;
mod lane;
mod leap;
mod observer;
mod outcome;
mod state;
mod visit;

pub use advance::Engine;
pub(crate) use chatter::STALLED;
pub use observer::{JumpRecord, Observer};
pub use outcome::{EngineError, Outcome};
pub use state::{Counters, Options, State};
