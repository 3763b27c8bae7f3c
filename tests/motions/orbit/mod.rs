//! The derivative of the motion, orbits and exponents.

mod common;
mod crossings;
mod differences;
mod exponents;
mod kinds;
mod numbers;
mod orbits;
mod shooting;
mod words;

use flank::{Simulation, orbit::Image, scene::Scene};
use serde_json::Value;

fn open(scene: Value) -> Simulation {
    Simulation::from_scene(Scene::from_value(scene, "test").unwrap()).unwrap()
}

/// Scales of the components along a motion: of all displacements, of all velocities, of each latched speed.
fn scales(simulation: &Simulation, image: &Image) -> Vec<f64> {
    let (n, sizes) = (simulation.structure.freedoms(), &image.sizes);
    let largest = |range: std::ops::Range<usize>| sizes[range].iter().fold(0.0, |m: f64, s| m.max(*s));
    let of = |i: usize| match i / n {
        0 => largest(0..n),
        1 => largest(n..2 * n),
        _ => sizes[i],
    };
    (0..sizes.len()).map(of).collect()
}

/// The derivative of `end` at 0 by central differences of six points, exact to the sixth order of the step.
fn six_points(step: f64, end: impl Fn(f64) -> Option<Vec<f64>>) -> Option<Vec<f64>> {
    let mut sum = Vec::new();
    for (steps, weight) in [(1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0)] {
        let (plus, minus) = (end(steps * step)?, end(-steps * step)?);
        sum.resize(plus.len(), 0.0);
        sum.iter_mut().zip(plus.iter().zip(&minus)).for_each(|(s, (p, m))| *s += weight * (p - m) / step);
    }
    Some(sum)
}
