//! Gear trains: bodies and freedoms in, a linear structure with contacts out, and the automaton on top.
//!
//! Every train assembles into the same [`Spec`]; none has code of its own beyond this module.

mod spec;

pub use spec::{ContactSpec, Flanks, LoadHarmonic, Spec};
