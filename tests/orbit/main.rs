//! The derivative of the motion, orbits and exponents.
#![allow(clippy::unwrap_used)] // helpers of tests are not recognised as tests

mod differences;
mod exponents;
mod numbers;
mod orbits;

use flank::{Simulation, scene::Scene};
use serde_json::Value;

fn open(scene: Value) -> Simulation {
    Simulation::from_scene(Scene::from_value(scene, "test").unwrap()).unwrap()
}
