//! A mode in the form that its steps read: actions of contacts, guards, norms, and columns for vector instructions.

pub mod compiled;
pub mod fold;
pub mod growth;
pub mod linear_mode;
pub mod motion;
