//! The engine: flow, first event, jump, again.

mod advance;
mod alarm;
mod chatter;
mod observer;
mod outcome;
mod state;

pub use advance::Engine;
pub use observer::Observer;
pub use outcome::{EngineError, Outcome};
pub use state::{Counters, Options, State};
