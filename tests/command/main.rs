//! The command line, from outside.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod cli;
mod folders;
mod map_cli;
mod orbits_cli;
mod parts;
mod sweep;
mod verify;
