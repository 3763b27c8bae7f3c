//! Loads in steps and ramps, flanks that differ, dampers in the gap: against closed forms and each other.

use std::{f64::consts::TAU, fs};

use approx::assert_relative_eq;
use flank::{
    Simulation,
    analysis::{EventKind, EventRow},
    gear::Stiffness,
    scene::{Scene, SceneError},
};
use serde_json::{Value, json};

fn build(scene: &Value) -> Result<Scene, SceneError> {
    Scene::from_value(scene.clone(), "loads")
}

fn run(scene: &Value) -> Vec<EventRow> {
    let record = Simulation::from_scene(build(scene).unwrap()).unwrap().run().unwrap();
    // What is unexplained of the energy is rounding.
    let energy = &record.summary.energy;
    assert!(energy.residual.abs() <= 1e-12 * energy.throughput.max(1e-300), "{energy:?}");
    record.events
}

fn times(events: &[EventRow], kind: EventKind) -> Vec<f64> {
    let of_kind = events.iter().filter(|row| row.contacts.iter().any(|contact| contact.kind == kind));
    of_kind.map(|row| row.t.parse().unwrap()).collect()
}

/// A free mass in front of a rigid wall at 1 m.
fn thrown(load: Value) -> Value {
    json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 2.0, "load_n": load, "wall": { "side": "above", "position_m": 1.0 },
            "law": { "kind": "rigid", "restitution": 0.0 }
        },
        "run": { "t_end_s": 10.0 }
    })
}

/// A mass on a spring between dead stops under a square force (Julia Discourse, August 2020, "Simulating limit stops in a spring-mass system";
/// numbers in closed form to 20 digits): it is let go at the steps exactly, and strikes the other stop 1.388 s later.
#[test]
fn a_square_force_lets_go_at_its_steps() {
    let scene = json!({
        "flank": 1,
        "train": {
            "kind": "wall", "mass_kg": 1.0, "stiffness_n_per_m": 1.0, "damping_n_s_per_m": 0.2,
            "load_n": { "points": [[0, -5], [2, 5]], "through": "steps", "period_s": 4 },
            "wall": { "side": "both", "half_gap_m": 3.0 }, "law": { "kind": "rigid", "restitution": 0.0 }
        },
        "initial": { "q": [1.0], "v": [1.0] }, "run": { "t_end_s": 10.0 }
    });
    let events = run(&scene);
    let impacts = times(&events, EventKind::Impact);
    let later = 1.388_094_548_843_300_2;
    let expected = [1.458_241_875_674_662, 2.0 + later, 4.0 + later, 6.0 + later, 8.0 + later];
    assert_eq!(impacts.len(), expected.len());
    for (found, expected) in impacts.iter().zip(expected) {
        assert_relative_eq!(*found, expected, max_relative = 1e-15);
    }
    let releases: Vec<&EventRow> = events.iter().filter(|row| row.contacts[0].kind == EventKind::Release).collect();
    assert_eq!(releases.len(), 4);
    for (row, expected) in releases.iter().zip([2.0, 4.0, 6.0, 8.0]) {
        assert_relative_eq!(row.t.parse::<f64>().unwrap(), expected, max_relative = 1e-16);
        // A known time is exact.
        assert!(row.switch && row.uncertainty == 0.0, "{row:?}");
    }
}

/// `2 ẍ = p(t)` with p = 3 up to 0.5 s, then a ramp to −1 over 1 s, and a step to 4 at 2 s.
#[test]
fn a_free_mass_follows_steps_and_ramps_to_the_wall() {
    let load = json!({ "points": [[0.5, 3], [1.5, -1], [2, -1], [2, 4]] });
    // Position and velocity at the corners, by integration.
    let (x1, v1) = (0.5 * 1.5 * 0.25, 1.5 * 0.5);
    let wall_in = |t: f64| x1 + v1 * t + 0.5 * 1.5 * t * t - 2.0 * t.powi(3) / 6.0;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if wall_in(middle) < 1.0 { low = middle } else { high = middle }
    }
    let events = run(&thrown(load));
    assert_relative_eq!(times(&events, EventKind::Impact)[0], 0.5 + low, max_relative = 1e-14);
    // At rest it is pressed by p > 0 up to 1.25 s, where the ramp passes zero; the step throws it back.
    assert_relative_eq!(times(&events, EventKind::Release)[0], 1.25, max_relative = 1e-15);
    let fall = |a: f64, t: f64| 0.5 * a * t * t;
    // From 1.25 s: p = −4 (t − 1.25) to 1.5 s, −1 to 2 s, then 4.
    let (x, v) = (-4.0 / 2.0 * 0.25_f64.powi(3) / 6.0, -4.0 / 2.0 * 0.25_f64.powi(2) / 2.0);
    let (x, v) = (x + v * 0.5 + fall(-0.5, 0.5), v - 0.5 * 0.5);
    let back = (-v + (v * v - 2.0 * 2.0 * x).sqrt()) / 2.0;
    assert_relative_eq!(times(&events, EventKind::Impact)[1], 2.0 + back, max_relative = 1e-14);
}

/// The same load as steps, as lines with double points, from a table, scaled, in milliseconds and with decimals in quotation marks.
#[test]
fn one_load_can_be_written_in_many_ways() {
    let lines = json!({ "points": [[0, 2], [0.1, 2], [0.1, -1], [0.3, -1], [0.3, 5]] });
    let expected = run(&thrown(lines));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("load.csv"), "time [ms];force [kN]\n0;0,002\n100;-0,001\n300;0,005\n").unwrap();
    let file = folder.path().join("scene.json");
    fs::write(&file, thrown(json!({ "table": "load.csv", "through": "steps" })).to_string()).unwrap();
    let table = Simulation::from_scene(Scene::from_file(&file).unwrap()).unwrap().run().unwrap().events;
    let others = [
        run(&thrown(json!({ "points": [[0, 2], [0.1, -1], [0.3, 5]], "through": "steps" }))),
        run(&thrown(json!({ "points": [["0", 4], ["0.1", -2], ["0.3", 10]], "through": "steps", "scale": 0.5 }))),
        run(&thrown(json!({ "points": [[-1, 2], [-0.9, -1], [-0.7, 5]], "through": "steps", "origin_s": 1 }))),
        table,
    ];
    for other in &others {
        assert_eq!(other.len(), expected.len());
        for (a, b) in other.iter().zip(&expected) {
            assert_relative_eq!(a.t.parse::<f64>().unwrap(), b.t.parse::<f64>().unwrap(), max_relative = 1e-15);
        }
    }
}

fn gearbox(torque: Value, rest: Value) -> Value {
    let rack = json!({ "module_m": 0.003, "pressure_angle_deg": 20 });
    let law = json!({ "kind": "kelvin-voigt", "damping_ratio": 0.2 });
    json!({
        "flank": 1,
        "train": {
            "kind": "gearbox", "rack": rack,
            "shafts": [
                { "name": "motor", "speed_rpm": 3000, "torque_nm": torque, "gears": [{ "name": "z30", "teeth": 30, "inertia_kg_m2": 0.0018 }] },
                { "name": "output", "torque_nm": rest, "gears": [{ "name": "z45", "teeth": 45, "inertia_kg_m2": 0.0085 }] }
            ],
            "meshes": [{ "gears": ["z30", "z45"], "law": law, "total_backlash_m": 1e-4, "stiffness": 3e8 }]
        },
        "initial": "static",
        "run": { "t_end_s": 0.2 }
    })
}

/// After a step the mesh comes to rest under the new torque; a gear pair, a gearbox and a planetary stage say so alike.
#[test]
fn a_mesh_settles_under_the_new_torque() {
    let step = json!({ "points": [[0, 20], [0.05, 60]], "through": "steps" });
    let base = 0.045 * 20_f64.to_radians().cos();
    let last = |scene: &Value| {
        let record = Simulation::from_scene(build(scene).unwrap()).unwrap();
        let structure = &record.structure;
        let mut engine = record.engine(record.start().unwrap()).unwrap();
        engine.run(record.clock().instant(0.2), &mut ()).unwrap();
        let state = engine.state();
        flank::hybrid::ContactView::force(structure, 0, &state.jump.mode, state.at, &state.x)
    };
    assert_relative_eq!(last(&gearbox(step.clone(), json!("balance"))), 60.0 / base, max_relative = 1e-9);
    let mut pair = json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
            "driving": { "teeth": 30, "mass_kg": 1.5, "inertia_kg_m2": 0.0018 },
            "driven": { "teeth": 45, "mass_kg": 3.4, "inertia_kg_m2": 0.0085 },
            "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": 0.2 }, "total_backlash_m": 1e-4, "stiffness": 3e8 },
            "speed_rpm": 3000, "torque_nm": step
        },
        "initial": "static", "run": { "t_end_s": 0.2 }
    });
    assert_relative_eq!(last(&pair), 60.0 / base, max_relative = 1e-9);
    // The start is the equilibrium under the first value: nothing moves before the step.
    pair["run"]["t_end_s"] = json!(0.05);
    let simulation = Simulation::from_scene(build(&pair).unwrap()).unwrap();
    let mut engine = simulation.engine(simulation.start().unwrap()).unwrap();
    engine.run(simulation.clock().instant(0.04), &mut ()).unwrap();
    let n = simulation.structure.freedoms();
    assert!(engine.state().x[n..].iter().all(|v| v.abs() < 1e-12), "{:?}", engine.state().x);
}

/// What takes off the rest follows a torque that counts once, and the mean of one that repeats.
#[test]
fn the_balance_takes_off_the_mean_of_what_repeats() {
    let spec = |scene: &Value| build(scene).unwrap().build().unwrap().spec;
    let once = spec(&gearbox(json!({ "points": [[0, 20], [0.05, 60]], "through": "steps" }), json!("balance")));
    let [load] = &once.load_schedules[..] else { panic!("one load") };
    assert!(once.load.iter().all(|f| *f == 0.0) && load.vector.iter().all(|f| *f != 0.0), "{once:?}");
    // 10 and 30 N m for half a turn each: 20 N m on average.
    let turn = json!({ "points": [[0, 10], [180, 30]], "place": "deg", "through": "steps", "over": "turn" });
    let turns = spec(&gearbox(turn, json!("balance")));
    let [load] = &turns.load_schedules[..] else { panic!("one load") };
    let Stiffness::Periodic { period, .. } = load.factor else { panic!("it repeats") };
    assert_relative_eq!(period, 0.02, max_relative = 1e-15);
    assert_eq!(load.vector.iter().filter(|f| **f != 0.0).count(), 1);
    let given = spec(&gearbox(json!(20.0), json!("balance")));
    for (a, b) in turns.resting_load().iter().zip(&given.load) {
        assert_relative_eq!(*a, *b, max_relative = 1e-12);
    }
}

/// A periodic load between its points has a periodic orbit; one that counts once has none.
#[test]
fn orbits_need_a_load_that_repeats() {
    let scene = |load: Value| {
        json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [1.0], "damping_n_s_per_m": [0.3], "stiffness_n_per_m": [1.0], "load_schedules": [load],
                "contacts": [{ "name": "stop", "direction": [1], "half_backlash_m": 0.4, "stiffness": 20.0,
                               "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": 0.4 } }],
                "base_frequency_rad_per_s": TAU / 5.0
            },
            "run": { "cycles": 50 }
        })
    };
    let square = json!({ "vector_n": [1.0], "points": [[0, 1], [2.5, -1]], "through": "steps", "period_s": 5 });
    let simulation = Simulation::from_scene(build(&scene(square)).unwrap()).unwrap();
    let map = flank::orbit::SectionMap::new(&simulation).unwrap();
    assert!(map.image(&map.start().unwrap(), 1).is_ok());
    let once = json!({ "vector_n": [1.0], "points": [[0, 1], [2.5, -1]], "through": "steps" });
    let simulation = Simulation::from_scene(build(&scene(once)).unwrap()).unwrap();
    let refused = flank::orbit::SectionMap::new(&simulation).unwrap().repeats().unwrap_err().to_string();
    assert!(refused.contains("load 1 changes at 2.5 s") && refused.contains("/run/start_cycle"), "{refused}");
}

/// Every fault of a load is told with its place.
#[test]
fn faults_of_loads_are_told() {
    let fault = |load: Value| build(&thrown(load)).unwrap_err().to_string();
    let cases = [
        (json!({ "points": [[0, 1], [0, 2], [0, 3]] }), "at most two points at one time"),
        (json!({ "points": [[1, 1], [0.5, 2]] }), "times that rise"),
        (json!({ "points": [[0, 1], [1, 2]], "period_s": 2 }), "a load from 0 to 0.5 of its period"),
        (json!({ "points": [[0, 1], [2, 3]], "period_s": 2 }), "its end lies 2e0 above its beginning"),
        (json!({ "points": [[0, 1], [3, 3]], "period_s": 2, "through": "steps" }), "times within one period"),
        (json!({ "points": [[0, 1], [180, 3]], "place": "deg" }), "\"s\" or \"ms\""),
        (json!({ "points": [[0, "a"]] }), "/train/load_n/points/0/1"),
        (json!({ "through": "steps" }), "points"),
        (json!({ "points": [[0, 1]], "over": "turn" }), "over"),
    ];
    for (load, words) in cases {
        let found = fault(load.clone());
        assert!(found.contains("/train/load_n") && found.contains(words), "{load}: {found}");
    }
}

/// A ball between two flanks at rest that return it: the back flank's own place and restitution of its law.
#[test]
fn a_back_flank_of_its_own_stands_where_its_error_says() {
    let scene = |back: Value, gap_damping: f64| {
        json!({
            "flank": 1,
            "train": {
                "kind": "matrices", "mass_kg": [2.0],
                "contacts": [{ "name": "gap", "direction": [1], "half_backlash_m": 0.5, "error_offset_m": 0.1,
                               "law": { "kind": "rigid", "restitution": 0.5 }, "back_flank": back, "gap_damping_n_s_per_m": gap_damping }]
            },
            "initial": { "q": [0.0], "v": [1.0] }, "run": { "t_end_s": 3.0 }
        })
    };
    // Flanks at 0.6 and −0.3.
    let events = run(&scene(json!({ "error_offset_m": 0.2 }), 0.0));
    let impacts: Vec<&EventRow> = events.iter().filter(|row| row.contacts[0].kind == EventKind::Impact).collect();
    assert_relative_eq!(impacts[0].seconds, 0.6, max_relative = 1e-14);
    assert_relative_eq!(impacts[1].seconds, 0.6 + 0.9 / 0.5, max_relative = 1e-14);
    let [drive, back] = [&impacts[0].contacts[0], &impacts[1].contacts[0]];
    assert_eq!((drive.mesh, &*drive.name, back.mesh, &*back.name), (0, "gap", 0, "gap"));
    assert_relative_eq!(drive.deflection, 0.5, max_relative = 1e-14);
    assert_relative_eq!(back.deflection, -0.5, max_relative = 1e-14);
    assert_relative_eq!(back.approach.unwrap(), 0.5, max_relative = 1e-14);
    assert_relative_eq!(back.impulse.unwrap(), 2.0 * 0.5 * 1.5, max_relative = 1e-14);
    // With a damper in the gap: x = v m/c (1 − exp(−c t/m)).
    let events = run(&scene(json!({}), 0.8));
    let expected = -(1.0 - 0.6 * 0.8 / 2.0_f64).ln() * 2.0 / 0.8;
    assert_relative_eq!(times(&events, EventKind::Impact)[0], expected, max_relative = 1e-14);
}

/// Flanks with the same numbers give the motion of the contact with two flanks, under every law.
#[test]
fn equal_flanks_of_their_own_move_as_one_contact() {
    let laws = [
        (json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.3 }), json!(30.0)),
        (json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 0.3, "release": "deflection" }), json!(30.0)),
        (json!({ "kind": "power", "exponent": "3/2", "hysteresis": "exact", "restitution": 0.7 }), json!(200.0)),
        (json!({ "kind": "rigid", "restitution": 0.6 }), Value::Null),
    ];
    for (law, stiffness) in laws {
        let scene = |back: Option<Value>| {
            let mut contact = json!({ "name": "mesh", "direction": [1], "half_backlash_m": 0.1, "law": law,
                "error": [{ "amplitude_m": 0.05, "frequency_rad_per_s": 2.0 }] });
            if !stiffness.is_null() {
                contact["stiffness"] = stiffness.clone();
            }
            back.into_iter().for_each(|back| contact["back_flank"] = back);
            json!({
                "flank": 1,
                "train": { "kind": "matrices", "mass_kg": [1.0], "load_n": [0.1], "contacts": [contact],
                           "load_harmonics": [{ "vector_n": [1.0], "frequency_rad_per_s": 1.0 }] },
                "run": { "cycles": 4 }
            })
        };
        let (one, two) = (run(&scene(None)), run(&scene(Some(json!({})))));
        assert!(one.len() > 10, "{law}: {} events", one.len());
        assert_eq!(one.len(), two.len(), "{law}");
        for (a, b) in one.iter().zip(&two) {
            let rows = |row: &EventRow| row.contacts.iter().map(|c| (c.kind, c.from, c.to)).collect::<Vec<_>>();
            assert_eq!(rows(a), rows(b), "{law}");
            assert_relative_eq!(a.seconds, b.seconds, max_relative = 1e-12);
            for (x, y) in a.contacts.iter().zip(&b.contacts) {
                for (x, y) in [(x.approach, y.approach), (x.impulse, y.impulse), (x.peak_force, y.peak_force)] {
                    assert_eq!(x.is_some(), y.is_some(), "{law}");
                    assert_relative_eq!(x.unwrap_or(0.0), y.unwrap_or(0.0), max_relative = 1e-9, epsilon = 1e-12);
                }
            }
        }
    }
}

/// An excess of tooth thickness narrows the gap on both sides; more than the backlash is refused.
#[test]
fn thickness_narrows_the_gap() {
    let scene = |thickness: f64| {
        let mut scene = gearbox(json!(5.0), json!("balance"));
        scene["train"]["meshes"][0]["thickness_error"] =
            json!([{ "order": 1, "amplitude_m": thickness, "phase_rad": 0.4 }]);
        scene
    };
    let spec = build(&scene(2e-5)).unwrap().build().unwrap().spec;
    let contact = &spec.contacts[0];
    let back = contact.back.as_ref().unwrap();
    for t in [0.0, 1e-4, 3.3e-4] {
        let thick = 2e-5 * (TAU * 1500.0 * t + 0.4).sin();
        let of = |list: &[flank::gear::Harmonic]| {
            list.iter().map(|h| h.amplitude * (h.omega * t + h.phase).cos()).sum::<f64>()
        };
        assert_relative_eq!(of(&contact.error), -0.5 * thick, max_relative = 1e-9, epsilon = 1e-18);
        assert_relative_eq!(of(&back.error), 0.5 * thick, max_relative = 1e-9, epsilon = 1e-18);
    }
    let refused = build(&scene(1.1e-4)).unwrap_err().to_string();
    assert!(refused.contains("close the gap"), "{refused}");
}

/// Degrees, sines, cosines and absolute amplitudes are the same harmonics as radians of the usual function and relative amplitudes.
#[test]
fn conventions_of_harmonics_agree() {
    let scene = |error: Value, stiffness: Value, order: Value| {
        let mut scene = gearbox(json!(5.0), json!("balance"));
        scene["train"]["meshes"][0]["error"] = json!([error]);
        scene["train"]["meshes"][0]["stiffness"] = json!({ "kind": "harmonic", "mean": 3e8, "harmonics": [stiffness] });
        scene["train"]["shafts"][0]["orders"] = json!([order]);
        scene
    };
    let [phase, ahead] = [0.3, 0.3 + 0.25 * TAU];
    let usual = scene(
        json!({ "order": 1, "amplitude_m": 5e-6, "phase_rad": phase }),
        json!({ "order": 1, "amplitude": 0.2, "phase_rad": phase }),
        json!({ "order": 2, "torque_nm": 3, "phase_rad": phase }),
    );
    let other = scene(
        json!({ "order": 1, "amplitude_m": 5e-6, "phase_rad": phase - 0.25 * TAU, "function": "cosine" }),
        json!({ "order": 1, "amplitude_n_per_m": 6e7, "phase_deg": ahead.to_degrees(), "function": "sine" }),
        json!({ "order": 2, "torque_nm": 3, "phase_deg": phase.to_degrees() }),
    );
    let spec = |scene: &Value| build(scene).unwrap().build().unwrap().spec;
    let (usual, other) = (spec(&usual), spec(&other));
    let near = |a: f64, b: f64| assert_relative_eq!(a, b, max_relative = 1e-14, epsilon = 1e-14);
    near(usual.contacts[0].error[0].phase, other.contacts[0].error[0].phase);
    near(usual.load_harmonics[0].phase, other.load_harmonics[0].phase);
    let harmonic = |spec: &flank::system::Spec| match &spec.contacts[0].stiffness {
        Stiffness::Harmonic { harmonics, .. } => harmonics[0],
        other => panic!("{other:?}"),
    };
    near(harmonic(&usual).amplitude, harmonic(&other).amplitude);
    near(harmonic(&usual).phase, harmonic(&other).phase);
    let both = json!({ "order": 1, "amplitude_m": 5e-6, "phase_rad": 1, "phase_deg": 20 });
    let refused = build(&scene(both, json!({ "order": 1, "amplitude": 0.1 }), json!({ "order": 1, "torque_nm": 1 })));
    assert!(refused.unwrap_err().to_string().contains("phase_deg"));
}
