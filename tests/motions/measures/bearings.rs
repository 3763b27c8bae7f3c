//! Forces of bearings and shares of planets against balances of momentum and samples of the motion.

use std::f64::consts::TAU;

use flank::{
    Simulation, Task,
    analysis::{Grid, Sample, Trajectory},
    gear::Harmonic,
    scene::Scene,
    study::steady::{Rule, Steady, steady},
};
use serde_json::{Value, json};

fn example(name: &str, changes: &[(&str, Value)]) -> Scene {
    let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::from_file(path).unwrap();
    scene.with_all(changes.iter().map(|(pointer, value)| (*pointer, value.clone()))).unwrap()
}

/// Gears of 30 and 45 teeth on soft bearings, with impacts.
fn pair() -> Scene {
    let bearing = json!({ "stiffness_n_per_m": 2e8, "damping_ratio": 0.05 });
    let mut scene = example("spur-20kw", &[("/train/shafts/0/torque_nm", json!(5.0))]).given().clone();
    for shaft in 0..2 {
        scene["train"]["shafts"][shaft]["mass_kg"] = json!(2.0);
        scene["train"]["shafts"][shaft]["translation"] = bearing.clone();
    }
    Scene::from_json(&scene.to_string(), "pair").unwrap()
}

fn found(scene: Scene) -> Steady {
    steady(scene, None, &Rule::default(), Task::default()).unwrap()
}

/// The momentum of a body is the same after a period: bearing and mesh balance in the mean.
#[test]
fn mean_force_of_a_bearing_is_that_of_the_mesh() {
    let found = found(pair());
    let mesh = &found.contacts[0].report;
    assert!(found.motion.period.is_some() && mesh.impacts.drive > 0, "{:?}", found.motion);
    assert_eq!(found.bearings.len(), 2);
    let angle = 20f64.to_radians();
    for (bearing, side) in found.bearings.iter().zip([1.0, -1.0]) {
        // The driving gear is pushed back: its bearing carries the mesh force against the line of action.
        let push = [-side * angle.sin() * mesh.force_mean, -side * angle.cos() * mesh.force_mean];
        let [x, y] = &bearing.directions[..] else { panic!("{:?}", bearing.directions) };
        for (force, exact) in [(x, push[0].abs()), (y, push[1].abs())] {
            assert!((force.mean.abs() - exact).abs() <= 1e-8 * mesh.force_mean, "{}: {force:?} {exact}", bearing.name);
        }
        assert!((bearing.force_mean - mesh.force_mean).abs() <= 1e-8 * mesh.force_mean);
        assert!((mesh.impulse - mesh.force_mean * mesh.time).abs() <= 1e-14 * mesh.impulse);
    }
}

/// Deviation and largest force beside sums over dense samples of the state. Of a force with corners a mean of equal steps h is wrong by some
/// h² of its slopes.
#[test]
fn bearing_forces_of_the_samples() {
    let simulation = Simulation::from_scene(pair()).unwrap();
    let (mut squares, mut sums, mut largest, mut count) = ([0.0; 2], [0.0; 2], 0f64, 0.0);
    let spec = simulation.structure.spec();
    let bearing = &spec.bearings[0];
    let state = simulation.start().unwrap();
    let [_, from, end] = simulation.instants();
    let mut samples =
        Trajectory::new(&simulation.structure, Grid::Phases { per_cycle: 4096 }, from, |s: &Sample<'_>| {
            let force = [0, 1].map(|i| bearing.springs[i].force(s.x));
            for i in 0..2 {
                sums[i] += force[i];
                squares[i] += force[i] * force[i];
            }
            largest = largest.max(force[0].hypot(force[1]));
            count += 1.0;
            std::ops::ControlFlow::Continue(())
        });
    simulation.engine(state).unwrap().run(end, &mut samples).unwrap();
    let record = simulation.run().unwrap();
    let report = &record.bearings[0];
    let variance: f64 = (0..2).map(|i| squares[i] / count - (sums[i] / count).powi(2)).sum();
    assert!((report.force_deviation - variance.sqrt()).abs() <= 1e-6 * report.force_deviation, "{report:?} {variance}");
    let below = report.force_max - largest;
    assert!((0.0..=1e-5 * largest).contains(&below), "{report:?} {largest}");
}

/// Alike planets share alike; of unlike ones the shares still add up to their number.
#[test]
fn planets_share_the_load() {
    let shares = |scene| -> Vec<f64> { found(scene).contacts.iter().map(|c| c.report.load_share.unwrap()).collect() };
    for share in shares(example("four-planets", &[])) {
        assert!((share - 1.0).abs() < 1e-6, "{share}");
    }
    // A planet whose tooth is thicker carries more, if only a little: the sun gives way. The shares add up to the number of planets.
    let mut built = example("reference-heavy", &[]).build().unwrap();
    built.spec.contacts[0].error_offset -= 5e-6;
    let record = Simulation::from_built("unlike", built).unwrap().run().unwrap();
    let all: Vec<f64> = record.contacts.iter().map(|contact| contact.load_share.unwrap()).collect();
    for mesh in all.chunks(3) {
        assert!((mesh.iter().sum::<f64>() - 3.0).abs() < 1e-12, "{mesh:?}");
    }
    assert!(all[0] > 1.001 * all[1], "{all:?}");
    assert_eq!(found(pair()).contacts[0].report.load_share, None);
}

/// One harmonic: `Γ = m_e A ω²/F`; two of them: the largest sum over a period.
#[test]
fn rattle_index_of_an_error() {
    let record = Simulation::from_scene(example("spur-20kw", &[])).unwrap().run().unwrap();
    let radii = [0.045, 0.0675].map(|r| r * 20f64.to_radians().cos());
    let masses = [0.0018 / (radii[0] * radii[0]), 0.0085 / (radii[1] * radii[1])];
    let mass = masses[0] * masses[1] / (masses[0] + masses[1]);
    let omega = TAU * 1500.0;
    let index = mass * 5e-6 * omega * omega / record.contacts[0].force_mean;
    let found = record.contacts[0].rattle_index.unwrap();
    assert!((found - index).abs() <= 1e-12 * index, "{found} {index}");
    let mut contact = Simulation::from_scene(example("spur-20kw", &[])).unwrap().structure.spec().contacts[0].clone();
    let first = contact.error[0];
    contact.error.push(Harmonic { amplitude: 0.3 * first.amplitude, omega: 2.0 * omega, phase: first.phase + 1.0 });
    let at = |angle: f64| ((angle + first.phase).cos() + 1.2 * (2.0 * angle + first.phase + 1.0).cos()).abs();
    let largest = (0..100_000).map(|i| at(TAU * f64::from(i) / 1e5)).fold(0.0, f64::max);
    let exact = first.amplitude.abs() * omega * omega * largest;
    // The largest of 100,000 samples of a wave of order 2 is wrong by (2π/10⁵)²·2.
    assert!((contact.largest_acceleration() - exact).abs() <= 1e-8 * exact);
}
