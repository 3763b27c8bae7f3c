//! The engine: flow, first event, jump, again.

mod advance;
mod alarm;
mod chatter;
mod observer;
mod outcome;

pub use advance::{Counters, Engine, Options, State};
pub use observer::Observer;
pub use outcome::{EngineError, Outcome};
