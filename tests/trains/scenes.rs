//! Scenes that are right: the examples, the presets, and what each choice builds.

use std::{
    collections::BTreeMap,
    f64::consts::{PI, TAU},
    fs,
    path::PathBuf,
};

use crate::presets::{self, ReferenceDamping, ReferenceStiffness};
use flank::{
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    scene::{BuiltScene, Duration, Scene},
    train::Freedoms,
};
use serde_json::{Value, json};

fn examples() -> Vec<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes");
    let all = fs::read_dir(folder).expect("folder of examples").map(|f| f.expect("file").path());
    let mut files: Vec<_> = all.filter(|file| file.extension().is_some_and(|end| end == "json")).collect();
    files.sort();
    files
}

#[test]
fn every_example_builds_and_resolves_to_itself() {
    for file in examples() {
        let scene = Scene::from_file(&file).unwrap_or_else(|e| panic!("{e}"));
        scene.build().unwrap_or_else(|e| panic!("{e}"));
        let again = Scene::from_json(&scene.resolved().to_string(), "again").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again.resolved(), scene.resolved(), "{}", file.display());
        assert_eq!(again.hash(), scene.hash());
        assert_eq!(again.build(), scene.build());
    }
}

fn example(name: &str) -> BuiltScene {
    let file = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
    Scene::from_file(file).and_then(|scene| scene.build()).unwrap_or_else(|e| panic!("{e}"))
}

fn build(scene: Value) -> BuiltScene {
    Scene::from_value(scene, "test").and_then(|scene| scene.build()).unwrap_or_else(|e| panic!("{e}"))
}

fn of_train(train: Value) -> BuiltScene {
    build(json!({ "flank": 1, "train": train, "run": { "t_end_s": 1 } }))
}

/// One free mass with one contact.
fn contact(contact: Value) -> BuiltScene {
    of_train(json!({ "kind": "matrices", "mass_kg": [1], "contacts": [contact] }))
}

#[test]
fn a_preset_is_the_stage_it_names() {
    let stage = |name: &str| of_train(json!({ "kind": "planetary", "preset": name })).spec;
    let light = presets::reference_light(500.0, 0.0).expect("light");
    let heavy = presets::reference_heavy(500.0, 500.0).expect("heavy");
    let float = presets::reference_float(500.0, 0.0).expect("float");
    let exact = presets::reference(&ReferenceStiffness::EXACT_FREQUENCIES, &ReferenceDamping::DEFAULT).expect("exact");
    assert_eq!(stage("reference-light"), light.assemble(&Freedoms::Full).expect("light"));
    assert_eq!(stage("reference-heavy"), heavy.assemble(&Freedoms::Full).expect("heavy"));
    assert_eq!(stage("reference-float"), float.assemble(&Freedoms::Full).expect("float"));
    assert_eq!(stage("reference").mass, stage("reference-light").mass);
    assert_eq!(stage("exact-frequencies"), exact.assemble(&Freedoms::Full).expect("exact"));
    let lin_parker = presets::lin_parker(3).assemble(&Freedoms::FullCarrier).expect("lin-parker");
    assert_eq!(stage("lin-parker"), lin_parker);
    assert_eq!(Scene::reference().and_then(|s| s.build()).expect("reference").spec, stage("reference-light"));
}

/// A number in a list that a preset brings is changed in place; the rest of the list stays.
#[test]
fn a_number_in_a_list_of_a_preset_is_changed_alone() {
    let scene = Scene::reference().expect("reference");
    let pointer = "/train/sun_mesh/error/1/amplitude_m";
    let mut wanted = scene.resolved().clone();
    *wanted.pointer_mut(pointer).expect("second harmonic") = json!(1e-6);
    let changed = scene.with(pointer, json!(1e-6)).expect("changed");
    assert_eq!(changed.resolved(), &wanted);
    assert!(scene.with("/train/sun_mesh/error/2/amplitude_m", json!(1e-6)).is_err());
}

#[test]
fn keys_beside_a_preset_replace_its_own() {
    let train = json!({
        "kind": "planetary", "preset": "lin-parker", "planets": 5, "freedoms": "torsional",
        "sun": { "mass_kg": 0.5, "inertia_kg_m2": 0.2 },
    });
    let mut stage = presets::lin_parker(5);
    stage.sun.rotary_mass = 0.2;
    assert_eq!(of_train(train).spec, stage.assemble(&Freedoms::Torsional).expect("five planets"));
    let law =
        json!({ "kind": "planetary", "preset": "reference-light", "sun_mesh": { "law": { "restitution": 0.5 } } });
    let Law::Power(power) = of_train(law).spec.contacts[0].law else { panic!("a power law") };
    assert_eq!(power.hysteresis, 0.75 * (1.0 - 0.25));
}

#[test]
fn a_stage_can_be_written_from_its_rack() {
    let body = |mass: f64, inertia: f64| json!({ "mass_kg": mass, "inertia_kg_m2": inertia });
    let mesh = json!({
        "law": { "kind": "power", "hysteresis": "lankarani-nikravesh", "restitution": 0.743 },
        "flanks": "drive", "half_backlash_m": 0, "stiffness": { "kind": "hertz" },
    });
    let built = of_train(json!({
        "kind": "planetary", "speed_rpm": 500, "planets": 3, "teeth": { "sun": 34, "planet": 31, "ring": 96 },
        "rack": {
            "module_m": 0.003, "pressure_angle_deg": 28,
            "profile_shift": { "sun": -0.02, "planet": 0.02, "ring": 0.02 },
        },
        "sun": body(2.7, 0.008), "planet": body(2.5, 0.007), "ring": body(5.3, 0.178), "carrier": body(10.0, 0.19),
        "sun_mesh": mesh, "ring_mesh": mesh,
    }));
    let reference = presets::reference_float(500.0, 0.0).expect("float").assemble(&Freedoms::Full).expect("float");
    assert_eq!(built.spec.freedoms, reference.freedoms);
    for (ours, theirs) in built.spec.contacts.iter().zip(&reference.contacts) {
        assert_eq!(ours.direction, theirs.direction);
        assert_eq!(ours.stiffness, theirs.stiffness);
        assert_eq!(ours.law, theirs.law);
    }
    assert!((built.carrier_speed.expect("a turning frame") - 500.0 / 60.0 * TAU * 34.0 / 130.0).abs() < 1.0e-12);
    assert!(built.warnings.iter().any(|w| w.message.contains("cannot be assembled")), "{:?}", built.warnings);
}

#[test]
fn no_gap_between_two_flanks_is_a_bilateral_mesh() {
    let law = json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": 2, "release": "force" });
    let built = contact(json!({ "direction": [1], "half_backlash_m": 0, "stiffness": 5, "law": law }));
    assert_eq!(built.spec.contacts[0].law, Law::Bilateral(Linear { damping: 2.0 }));
    assert!(built.warnings[0].message.contains("bilateral"), "{:?}", built.warnings);
    let one = contact(json!({ "direction": [1], "flanks": "drive", "half_backlash_m": 0, "stiffness": 5, "law": law }));
    assert_eq!(one.spec.contacts[0].law, Law::KelvinVoigt(Linear { damping: 2.0 }, Release::Force));
    assert_eq!(one.warnings, []);
}

#[test]
fn half_and_total_gap_are_the_same_gap() {
    let with = |key: &str, gap: f64| {
        contact(json!({ "direction": [1], key: gap, "stiffness": 5, "law": { "kind": "kelvin-voigt" } })).spec
    };
    assert_eq!(with("half_backlash_m", 5.0e-5), with("total_backlash_m", 1.0e-4));
}

#[test]
fn damping_in_the_gap_is_a_choice() {
    let pair = |in_gap: bool| {
        let train = json!({
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": in_gap, "mean_load": 0.1,
        });
        build(json!({ "flank": 1, "train": train, "run": { "t_end": 1 } })).spec
    };
    let (everywhere, contact_only) = (pair(true), pair(false));
    assert_eq!(everywhere.damping[(0, 0)], 0.1);
    assert_eq!(everywhere.contacts[0].law, Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection));
    assert_eq!(contact_only.damping[(0, 0)], 0.0);
    assert_eq!(contact_only.contacts[0].law, Law::KelvinVoigt(Linear { damping: 0.1 }, Release::Force));
}

#[test]
fn restitution_asked_and_obtained_are_both_told() {
    let law = |model: &str| {
        let law = json!({ "kind": "power", "hysteresis": model, "restitution": 0.5 });
        contact(json!({ "direction": [1], "half_backlash_m": 1, "stiffness": 5, "law": law }))
    };
    let message = law("lankarani-nikravesh").warnings[0].message.clone();
    assert!(message.contains("0.7252, not 0.5"), "{message}");
    assert_eq!(law("exact").warnings, []);
}

#[test]
fn exponents_are_ratios() {
    let ratio = |exponent: Value| {
        let law = json!({ "kind": "power", "exponent": exponent, "hysteresis": "none" });
        let built = contact(json!({ "direction": [1], "half_backlash_m": 1, "stiffness": 5, "law": law }));
        let Law::Power(power) = built.spec.contacts[0].law else { panic!("a power law") };
        (power.exponent.p, power.exponent.q)
    };
    assert_eq!(ratio(json!(1.5)), (3, 2));
    assert_eq!(ratio(json!("6/4")), (3, 2));
    assert_eq!(ratio(json!(10.0 / 9.0)), (10, 9));
    assert_eq!(ratio(json!("10/9")), (10, 9));
}

#[test]
fn a_trapezoidal_schedule_has_the_rectangular_mean() {
    let with = |kind: &str| {
        let mut stiffness = json!({ "kind": kind, "high": 3, "low": 1, "duty": 0.25, "period_s": 2 });
        if kind == "trapezoidal" {
            stiffness["ramp"] = json!(0.1);
        }
        let law = json!({ "kind": "kelvin-voigt" });
        let built = contact(json!({ "direction": [1], "half_backlash_m": 1, "stiffness": stiffness, "law": law }));
        built.spec.contacts[0].stiffness.clone()
    };
    assert!((with("trapezoidal").mean() - with("rectangular").mean()).abs() < 1.0e-15);
    assert_eq!(with("trapezoidal").maximum(), 3.0);
}

#[test]
fn example_numbers_are_the_doubles_written() {
    let torsional = example("W3");
    let period = 1.0 / (1000.0 / 60.0 * 34.0 * 96.0 / 130.0);
    assert_eq!(torsional.spec.omega, Some(TAU * (1000.0 / 60.0 * 34.0 * 96.0 / 130.0)));
    assert_eq!(torsional.spec.load[0], 5.0 / (0.5 * 3.0e-3 * 34.0 * (28.0 * PI / 180.0).cos()));
    let Stiffness::Periodic { period: written, pieces, .. } = &torsional.spec.contacts[0].stiffness else {
        panic!("a periodic schedule")
    };
    assert_eq!((*written, pieces[1].start), (period, 1.4 - 1.0));
    let pair = example("W1c-ch");
    assert_eq!(pair.spec.load_harmonics[0].vector[0], 0.5 * 0.8 * 0.8);
    assert_eq!((pair.q0, pair.v0), (vec![1.1], vec![0.0]));
    assert_eq!(pair.run.period, Some(TAU / 0.8));
    assert_eq!(example("W4").spec.freedoms.len(), 16);
    assert_eq!(example("W5a").run.duration, Duration::Cycles(30));
}

#[test]
fn the_hash_sees_the_physics_only() {
    let scene = |text: &str| Scene::from_json(text, "test").unwrap_or_else(|e| panic!("{e}"));
    let ball = scene(include_str!("../../examples/scenes/ball-on-wall.json"));
    let renamed = ball.with("/name", json!("other")).expect("renamed");
    let spelt = ball.with("/train/mass_kg", json!(1)).expect("spelt");
    let explicit = ball.with("/run/integrator/method", json!("auto")).expect("a default written out");
    let heavier = ball.with("/train/mass_kg", json!(2)).expect("heavier");
    assert_eq!(ball.hash().len(), 64);
    assert_eq!(ball.hash(), renamed.hash());
    assert_eq!(ball.hash(), spelt.hash());
    assert_eq!(ball.hash(), explicit.hash());
    assert_ne!(ball.hash(), heavier.hash());
    let stage = Scene::reference().expect("reference");
    let softer = stage.with("/train/sun_mesh/law/restitution", json!(0.5)).expect("softer");
    assert_ne!(stage.hash(), softer.hash());
    assert_eq!(stage.hash(), stage.with("/train/sun/mass_kg", json!(2.7)).expect("the preset's own").hash());
    assert!(stage.with("/train/speed_rpm/x", json!(1)).is_err());
}

/// Keys a schema allows along the path of a value, gathered over its alternatives.
fn allowed(schema: &Value, value: &Value, place: &str) {
    let mut cases = vec![schema];
    let mut keys: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    let mut items = Vec::new();
    let mut free = false;
    while let Some(case) = cases.pop() {
        for group in ["anyOf", "oneOf", "allOf"] {
            cases.extend(case[group].as_array().into_iter().flatten());
        }
        cases.extend(["then", "else"].iter().filter_map(|word| case.get(*word)));
        for (key, schema) in case["properties"].as_object().into_iter().flatten() {
            keys.entry(key).or_default().push(schema);
        }
        free |= case["additionalProperties"].is_object();
        items.extend(case.get("items"));
    }
    match value {
        Value::Object(map) if !free => {
            for (key, value) in map {
                let schemas = keys.get(key.as_str()).unwrap_or_else(|| panic!("{place}/{key} is not in the schema"));
                allowed(&json!({ "anyOf": schemas }), value, &format!("{place}/{key}"));
            }
        }
        Value::Array(list) => {
            list.iter()
                .enumerate()
                .for_each(|(i, value)| allowed(&json!({ "anyOf": items }), value, &format!("{place}/{i}")));
        }
        _ => {}
    }
}

#[test]
fn the_schema_knows_every_key_of_every_example() {
    let schema = flank::scene::schema();
    assert_eq!(schema["required"], json!(["flank", "train", "run"]));
    assert_eq!(schema["additionalProperties"], json!(false));
    for file in examples() {
        let scene = Scene::from_file(&file).unwrap_or_else(|e| panic!("{e}"));
        allowed(&schema, scene.resolved(), &file.display().to_string());
    }
}
