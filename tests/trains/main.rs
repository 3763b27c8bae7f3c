//! Gears, stages and scenes: geometry, forces at rest, natural frequencies, faults of scenes, imported files.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod bad_scenes;
mod gearbox;
mod gears;
mod import;
mod light_load;
mod mesh_forces;
mod pairs;
mod plausible;
mod presets;
mod scenes;
mod stages;
