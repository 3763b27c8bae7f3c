//! Sweeps: of a toy map through the library, of a gear pair through the command.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

#[cfg(all(feature = "cli", unix))]
mod command;
mod grid;
mod map;
mod picture;
