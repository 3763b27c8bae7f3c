//! `run.event_tolerance`: what an arc may add to the time of an event, and what it costs.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Counters, Observer},
    event::EventRecord,
    hybrid::Mode,
    scene::Scene,
    verify::Verifier,
};
use serde_json::{Value, json};

/// The trains that are moved by series: linear contacts and power laws of many degrees of freedom.
const SCENES: [(&str, u64); 3] = [("W3", 100), ("W4", 60), ("reference-light", 120)];

fn simulation(name: &str, cycles: u64, tolerance: f64) -> Simulation {
    let scene = Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let scene = scene.with("/run/cycles", cycles.into()).unwrap().with("/run/transient_cycles", 0.into()).unwrap();
    Simulation::from_scene(scene.with("/run/event_tolerance", tolerance.into()).unwrap()).unwrap()
}

/// Takes down how well each event is known, s.
#[derive(Default)]
struct Stated(Vec<f64>);

impl Observer for Stated {
    fn wants_steps(&self, _: &Mode, _: flank::hybrid::Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        self.0.push(record.conditioning.time);
        ControlFlow::Continue(())
    }
}

/// A run that is checked arc by arc: its work, and what its events state.
fn verified(simulation: &Simulation) -> (Counters, Vec<f64>) {
    let start = simulation.start().unwrap();
    let mut verifier: Verifier<'_, _> = simulation.verifier(&start);
    let mut engine = simulation.limited(start, u64::MAX).unwrap().0;
    let mut stated = Stated::default();
    engine.run(simulation.instants()[2], &mut (&mut verifier, &mut stated)).unwrap();
    verifier.finish(engine.state().at).unwrap();
    let tally = verifier.verification();
    assert_eq!(tally.difference, None);
    assert!(tally.series.compared > 10 * tally.series.not_judged, "{tally:?}");
    (engine.counters(), stated.0)
}

/// Every event is where a run at full precision from the same instant has it, within what it states. What it states is within the
/// tolerance, or counted. Such runs take fewer steps.
#[test]
fn events_keep_their_tolerance() {
    for (name, cycles) in SCENES {
        let mut full = 0.0;
        for tolerance in [0.0, 1e-9, 1e-6, 1e-3] {
            let simulation = simulation(name, cycles, tolerance);
            let (work, stated) = verified(&simulation);
            let limit = tolerance * simulation.clock().period().unwrap().value();
            let beyond = stated.iter().filter(|time| tolerance > 0.0 && **time > limit).count();
            assert_eq!(work.near_touches, beyond as u64);
            assert!(100 * beyond <= stated.len(), "{name} {tolerance:e}: {beyond} of {}", stated.len());
            // Chaotic motions have other events: steps count for each.
            let steps = work.steps as f64 / work.events as f64;
            assert!(
                tolerance == 0.0 || steps < 0.95 * full,
                "{name} {tolerance:e}: {steps} steps, {full} at full precision"
            );
            full = if tolerance == 0.0 { steps } else { full };
        }
    }
}

/// Four masses that do not feel each other. The first swings as `sin 2t` and misses both its flanks by 1e-11: near touches where what is
/// left out is more than that, and nothing at full precision.
#[test]
fn near_touches_are_counted() {
    let scene = json!({ "flank": 1,
        "train": { "kind": "matrices", "freedoms": ["a", "b", "c", "d"], "mass_kg": [1, 1, 1, 1],
            "stiffness_n_per_m": [4, 9, 16, 25], "contacts": [
                { "name": "flank", "direction": [1, 0, 0, 0], "half_backlash_m": 0.9 * (1.0 + 1e-11), "stiffness": 10,
                    "error": [{ "amplitude_m": 0.1, "frequency_rad_per_s": 2, "phase_rad": -std::f64::consts::FRAC_PI_2 }],
                    "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.1, "release": "deflection" } }] },
        "initial": { "q": [0, 0, 0, 0], "v": [2, 0, 0, 0] }, "run": { "cycles": 3 } });
    let scene = Scene::from_value(scene, "four masses").unwrap();
    for (tolerance, is_near) in [(0.0, false), (1e-12, false), (1e-6, true), (1e-3, true)] {
        let simulation = at(&scene, tolerance);
        let (mut engine, _) = simulation.limited(simulation.start().unwrap(), u64::MAX).unwrap();
        let mut seen = Stated::default();
        engine.run(simulation.instants()[2], &mut seen).unwrap();
        let (work, limit) = (engine.counters(), tolerance * std::f64::consts::PI);
        assert_eq!(work.near_touches > 0, is_near, "{tolerance:e}: {work:?}");
        let beyond = seen.0.iter().filter(|time| **time > limit).count() as u64;
        assert!(
            tolerance == 0.0 || (beyond..=beyond + work.grazes).contains(&work.near_touches),
            "{tolerance:e}: {work:?}"
        );
    }
}

/// Four masses in a row; the first meets a contact.
fn row(loads: [f64; 2], speed: f64, contact: Value, cycles: u64) -> Scene {
    let initial = if speed == 0.0 { json!("static") } else { json!({ "v": [speed, 0, 0, 0] }) };
    let scene = json!({ "flank": 1,
        "train": { "kind": "matrices", "freedoms": ["a", "b", "c", "d"], "mass_kg": [1, 1.2, 0.8, 1.5],
            "stiffness_n_per_m": [[2, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 2]], "load_n": [loads[0], 0, 0, 0],
            "load_harmonics": [{ "vector_n": [0, 0, 0, loads[1]], "frequency_rad_per_s": 1 }], "contacts": [contact] },
        "initial": initial, "run": { "cycles": cycles } });
    Scene::from_value(scene, "row of masses").unwrap()
}

fn at(scene: &Scene, tolerance: f64) -> Simulation {
    Simulation::from_scene(scene.with("/run/event_tolerance", tolerance.into()).unwrap()).unwrap()
}

/// What steps leave out adds up over hundreds of periods, and makes no event of a contact that stays pressed by half a metre.
#[test]
fn a_long_arc_has_no_event() {
    let contact = json!({ "name": "m", "direction": [1, 0, 0, 0], "half_backlash_m": 1, "stiffness": 1e5,
        "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 60, "release": "deflection" } });
    for cycles in [132, 1000] {
        let simulation = at(&row([43_765.515_043, 0.5], 0.0, contact.clone(), cycles), 1e-3);
        let start = simulation.start().unwrap();
        let (mut engine, _) = simulation.limited(start.clone(), u64::MAX).unwrap();
        engine.run(simulation.instants()[2], &mut Stated::default()).unwrap();
        let work = engine.counters();
        assert_eq!((work.events, work.grazes, work.near_touches), (0, 0, 0), "{cycles} cycles");
        assert_eq!(engine.state().jump.mode, start.jump.mode);
    }
}

/// A contact that lets go by its force is detached with a force that is exactly zero, and the state agrees to rounding.
#[test]
fn forces_that_fall_through_zero_are_zero() {
    let contact = json!({ "name": "m", "direction": [1, 0, 0, 0], "half_backlash_m": 0.2, "stiffness": 20,
        "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.5 } });
    for tolerance in [1e-8, 1e-6, 1e-4, 1e-3] {
        let (work, _) = verified(&at(&row([0.0, 1.0], 1.0, contact.clone(), 20), tolerance));
        assert!(work.events > 10, "{tolerance:e}: {work:?}");
    }
}

/// A rigid contact that rests while a power law is closed: what the steps in a root clock have left out moves the time of its release.
#[test]
fn a_release_beside_a_power_law_tells_its_uncertainty() {
    let scene =
        Scene::from_file(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/scenes/release-beside-power.json"))
            .unwrap();
    for tolerance in [1e-8, 1e-6, 1e-4, 1e-3] {
        let (work, _) = verified(&at(&scene, tolerance));
        assert!(work.events > 0, "{tolerance:e}: {work:?}");
    }
}
