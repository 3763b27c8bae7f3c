//! Events to a tolerance: `run.event_tolerance`.

use flank::{
    Simulation,
    engine::{Engine, Options},
    integrate::Taylor,
    scene::Scene,
};

use serde_json::json;

use crate::arcs::arc;

#[test]
fn an_arc_adds_no_more_than_the_tolerance_to_the_time_of_its_event() {
    for scene in ["W1b-ds", "W2b", "W3", "W4", "W5b-p", "reference-light"] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let (system, period) = (&simulation.structure, simulation.period().unwrap());
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let mut state = simulation.start().unwrap();
            for _ in 0..40 {
                let (exact, after, _) = arc(system, &state, Options::default());
                let options = Options { event_tolerance: tolerance, ..Options::default() };
                let (loose, ..) = arc(system, &state, options);
                let (Some(exact), Some(loose)) = (exact, loose) else { panic!("{scene}: no event") };
                assert_eq!((&exact.fired, &exact.to), (&loose.fired, &loose.to), "{scene} {tolerance}");
                let apart = simulation.clock().between(exact.at, loose.at).abs();
                assert!(apart <= tolerance * period, "{scene} {tolerance}: {:e} periods", apart / period);
                let stated = exact.conditioning.time + loose.conditioning.time;
                assert!(apart <= stated, "{scene} {tolerance}: {apart:e} apart, {stated:e} stated");
                state = after;
            }
        }
    }
}

#[test]
fn a_tolerance_saves_work() {
    let simulation = Simulation::from_file("examples/scenes/reference-light.json").unwrap();
    let steps = |event_tolerance: f64| {
        let end = simulation.clock().at(20, 0.0);
        let options = Options { event_tolerance, ..Options::default() };
        let state = simulation.start().unwrap();
        let mut engine = Engine::new(&simulation.structure, Box::new(Taylor::default()), options, state);
        engine.run(end, &mut ()).unwrap();
        engine.counters().steps
    };
    // To 1e-5 sixteen terms hold for 3.3 rad, to 1e-16 twenty-four for 2.2; what is proven of a step grows with its length besides.
    let [all, few] = [steps(0.0), steps(1e-3)];
    assert!(10 * few < 9 * all, "{few} of {all}");
}

/// Coarse steps and steps to rounding take turns, and what they show is told by the same series.
#[test]
fn measures_with_a_tolerance_are_those_to_rounding() {
    let scene = Scene::from_file("examples/scenes/reference-light.json").unwrap();
    let scene = scene.with("/run", json!({ "cycles": 12, "transient_cycles": 2 })).unwrap();
    let exact = Simulation::from_scene(&scene).unwrap().run().unwrap().summary;
    let loose = Simulation::from_scene(scene.with("/run/event_tolerance", 1e-4.into()).unwrap()).unwrap();
    let loose = loose.run().unwrap().summary;
    // Fewer steps also where the run is cut by its end.
    assert!(10 * loose.work.steps < 9 * exact.work.steps, "{} of {}", loose.work.steps, exact.work.steps);
    for (a, b) in exact.contacts.iter().zip(&loose.contacts) {
        for (a, b, size) in
            [(a.force_mean, b.force_mean, a.force_abs_max), (a.energy_lost, b.energy_lost, a.energy_lost)]
        {
            // A hundredth of the tolerance is left out of a rate by each step.
            assert!((a - b).abs() <= 1e-4 * size, "{a} {b}");
        }
    }
}
