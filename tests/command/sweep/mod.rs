//! Sweeps: of a toy map through the library, of a gear pair through the command.

#[cfg(all(feature = "cli", unix))]
mod command;
mod grid;
mod map;
mod picture;
