//! Gear trains: bodies and freedoms in, a linear structure with contacts out, and the automaton on top.
//!
//! Every train assembles into the same [`Spec`]; none has code of its own beyond this module.

mod assemble;
mod automaton;
mod contact_mode;
mod forces;
mod impact;
mod jet;
mod schedule;
mod spec;
mod sticking;

pub use assemble::{AssembleError, Contact, MAX_CONTACTS, Structure};
pub use automaton::{Start, StartError};
pub use contact_mode::{ContactMode, Watch, contact_mode, guard_id, guard_of, piece};
pub use spec::{ContactSpec, Flanks, LoadHarmonic, Spec};
