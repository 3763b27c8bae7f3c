//! Scenes that are wrong: each names the right place and a remedy, and none makes the reader panic.

use flank::{
    Simulation, Task,
    orbit::SectionMap,
    scene::{Scene, SceneError},
    study::steady::{Rule, steady},
};
use proptest::prelude::*;
use serde_json::{Value, json};

const WALL: &str = include_str!("../../examples/scenes/ball-on-wall.json");
const BOUNCE: &str = include_str!("../../examples/scenes/W2b.json");
const PAIR: &str = include_str!("../../examples/scenes/W1c-ss.json");
const HARMONIC: &str = include_str!("../../examples/scenes/W1b-ss.json");
const SPUR: &str = include_str!("../../examples/scenes/spur-pair.json");
const MATRICES: &str = include_str!("../../examples/scenes/W3.json");
const STAGE: &str = include_str!("../../examples/scenes/reference-light.json");

fn value(text: &str) -> Value {
    serde_json::from_str(text).expect("an example scene")
}

/// A scene with one place set to a value (or, where it ends in a new key, added).
fn set(text: &str, pointer: &str, new: Value) -> Value {
    let mut scene = value(text);
    match scene.pointer_mut(pointer) {
        Some(place) => *place = new,
        None => {
            let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
            scene.pointer_mut(parent).expect("a parent")[key] = new;
        }
    }
    scene
}

fn remove(text: &str, pointer: &str) -> Value {
    let mut scene = value(text);
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    scene.pointer_mut(parent).and_then(Value::as_object_mut).expect("a parent").remove(key);
    scene
}

fn refused(scene: Value, what: &str) -> SceneError {
    let error = Scene::from_value(scene, "bad").expect_err(what);
    for fault in &error.faults {
        assert!(!fault.remedy.is_empty() && !fault.allowed.is_empty() && !fault.found.is_empty(), "{what}: {error}");
    }
    error
}

#[test]
fn a_wrong_value_is_reported_where_it_stands() {
    let cases: Vec<(&str, &str, Value, &str)> = vec![
        (WALL, "/flank", json!(2), "/flank"),
        (WALL, "/colour", json!("red"), "/colour"),
        (WALL, "/train/kind", json!("wal"), "/train/kind"),
        (WALL, "/train/kind", json!(7), "/train/kind"),
        (WALL, "/train", json!([]), "/train"),
        (WALL, "/name", json!("n".repeat(201)), "/name"),
        // The next piece of the stiffness would be more cycles away than can be counted.
        (PAIR, "/train/base_frequency", json!(1e30), "/train"),
        (WALL, "/train/mass_kg", json!(0), "/train/mass_kg"),
        (WALL, "/train/mass_kg", json!("1"), "/train/mass_kg"),
        (WALL, "/train/mass_kg", Value::Null, "/train/mass_kg"),
        (WALL, "/train/mass", json!(1), "/train/mass"),
        (WALL, "/train/wall/side", json!("left"), "/train/wall/side"),
        (WALL, "/train/wall", json!({ "side": "both", "half_gap_m": -1 }), "/train/wall/half_gap_m"),
        (WALL, "/train/wall", json!({ "side": "both", "half_gap_m": 0 }), "/train/wall/half_gap_m"),
        (WALL, "/train/law/kind", json!("hertz"), "/train/law/kind"),
        (WALL, "/train/law", json!({ "kind": "bilateral" }), "/train/law/kind"),
        (WALL, "/train/law/restitution", json!(1.1), "/train/law/restitution"),
        (WALL, "/train/law/restitution", json!(-0.1), "/train/law/restitution"),
        (WALL, "/train/contact_stiffness", json!(1.0e9), "/train/contact_stiffness"),
        (
            WALL,
            "/train/load_harmonics",
            json!([{ "amplitude_n": 1, "frequency_rad_per_s": 0 }]),
            "/train/load_harmonics/0/frequency_rad_per_s",
        ),
        (
            WALL,
            "/train/load_harmonics",
            json!([{ "amplitude_n": 1, "frequency_hz": 2 }]),
            "/train/load_harmonics/0/frequency_hz",
        ),
        (WALL, "/initial/q", json!([1, 2]), "/initial/q"),
        (WALL, "/initial/q", json!({ "y": 1 }), "/initial/q/y"),
        (WALL, "/initial/q", json!([-1]), "/initial"),
        (WALL, "/initial", json!("static"), "/initial"),
        (WALL, "/initial", json!("moving"), "/initial"),
        (WALL, "/run/cycles", json!(10), "/run/t_end_s"),
        (WALL, "/run", json!({ "cycles": 10 }), "/run/period_s"),
        (WALL, "/run/t_end_s", json!(0), "/run/t_end_s"),
        (WALL, "/run/dt", json!(1.0e-3), "/run/dt"),
        (WALL, "/run/integrator", json!({ "method": "rk4" }), "/run/integrator/method"),
        (WALL, "/run/integrator", json!({ "tolerance": 0 }), "/run/integrator/tolerance"),
        (WALL, "/run/event_budget", json!(1.5), "/run/event_budget"),
        (STAGE, "/run/event_tolerance", json!(0.01), "/run/event_tolerance"),
        (WALL, "/run/event_tolerance", json!(1e-6), "/run/event_tolerance"),
        (BOUNCE, "/train/law/exponent", json!(1.23456), "/train/law/exponent"),
        (BOUNCE, "/train/law/exponent", json!("3/0"), "/train/law/exponent"),
        (BOUNCE, "/train/law/exponent", json!(0.5), "/train/law/exponent"),
        (BOUNCE, "/train/law/hysteresis", json!("hunt-crossley"), "/train/law/hysteresis_coefficient"),
        (BOUNCE, "/train/law/restitution", json!(0.5), "/train/law/restitution"),
        (BOUNCE, "/train/law/speed_floor_m_per_s", json!(0), "/train/law/speed_floor_m_per_s"),
        (BOUNCE, "/train/contact_stiffness", json!(-1), "/train/contact_stiffness"),
        (BOUNCE, "/train/contact_stiffness", Value::Null, "/train/contact_stiffness"),
        (BOUNCE, "/train/contact_stiffness", json!({ "kind": "fourrier" }), "/train/contact_stiffness/kind"),
        (BOUNCE, "/run/transient_cycles", json!(25), "/run/transient_cycles"),
        (PAIR, "/train/half_backlash", json!(-1), "/train/half_backlash"),
        (PAIR, "/train/backlash", json!(1), "/train/backlash"),
        (PAIR, "/train/release", json!("force"), "/train/release"),
        (PAIR, "/train/damping_in_gap", json!("yes"), "/train/damping_in_gap"),
        (PAIR, "/train/damping_ratio", json!(-0.05), "/train/damping_ratio"),
        (PAIR, "/train/stiffness/duty", json!(1), "/train/stiffness/duty"),
        (PAIR, "/train/stiffness/period", json!(-1), "/train/stiffness/period"),
        (PAIR, "/train/stiffness/period_s", json!(1), "/train/stiffness/period_s"),
        (
            PAIR,
            "/train/stiffness",
            json!({ "kind": "switched", "levels": [1, 2], "times": [2, 1] }),
            "/train/stiffness/times",
        ),
        (
            PAIR,
            "/train/stiffness",
            json!({ "kind": "switched", "levels": [1], "times": [1] }),
            "/train/stiffness/levels",
        ),
        (
            PAIR,
            "/train/stiffness",
            json!({ "kind": "tooth-pairs", "mean": 1, "contact_ratio": 0.9, "period": 1 }),
            "/train/stiffness/contact_ratio",
        ),
        (HARMONIC, "/train/transmission_error/0/frequency", json!(1.0e200), "/train"),
        (PAIR, "/run/t_end_s", json!(1), "/run/t_end_s"),
        (HARMONIC, "/train/stiffness/harmonics/0/frequency", json!(-0.8), "/train/stiffness/harmonics/0/frequency"),
        (MATRICES, "/train/mass_kg", json!([1, 1, 1, 1, 0]), "/train/mass_kg"),
        (MATRICES, "/train/mass_kg", json!([[1, 2], [0, 1]]), "/train/mass_kg"),
        (MATRICES, "/train/mass_kg", json!([[1, 2], [0]]), "/train/mass_kg/1"),
        (MATRICES, "/train/mass_kg", json!([]), "/train/mass_kg"),
        (MATRICES, "/train/load_n", json!([1, 2]), "/train/load_n"),
        (MATRICES, "/train/damping_n_s_per_m", json!([1]), "/train/damping_n_s_per_m"),
        (MATRICES, "/train/freedoms", json!(["a", "b", "a", "c", "d"]), "/train/freedoms/2"),
        (MATRICES, "/train/contacts/2/direction", json!([1, 1]), "/train/contacts/2/direction"),
        (MATRICES, "/train/contacts/2/direction", json!([0, 0, 0, 0, 0]), "/train/contacts/2/direction"),
        (MATRICES, "/train/contacts/2/half_backlash_m", json!(-1.0e-5), "/train/contacts/2/half_backlash_m"),
        (MATRICES, "/train/contacts/2/half_backlash_m", Value::Null, "/train/contacts/2/half_backlash_m"),
        (MATRICES, "/train/contacts/2/total_backlash_m", json!(1.0e-4), "/train/contacts/2/total_backlash_m"),
        (MATRICES, "/train/contacts/2/backlash_m", json!(1.0e-4), "/train/contacts/2/backlash_m"),
        (MATRICES, "/train/contacts/2/law", json!({ "kind": "bilateral" }), "/train/contacts/2/half_backlash_m"),
        (MATRICES, "/train/contacts/2/flanks", json!("back"), "/train/contacts/2/flanks"),
        (MATRICES, "/train/contacts/2/law/release", json!("never"), "/train/contacts/2/law/release"),
        (SPUR, "/train/driving/teeth", json!(0), "/train/driving/teeth"),
        (SPUR, "/train/driving/rotary_mass_kg", json!(1), "/train/driving/rotary_mass_kg"),
        (SPUR, "/train/rack/pressure_angle_deg", json!(120), "/train/rack/pressure_angle_deg"),
        (SPUR, "/train/rack/addendum", json!(0.2), "/train/mesh/stiffness/contact_ratio"),
        (SPUR, "/train/rack/addendum", json!(30), "/train/rack"),
        (SPUR, "/train/speed_rpm", json!(0), "/train/speed_rpm"),
        (STAGE, "/train/preset", json!("reference-lite"), "/train/preset"),
        (STAGE, "/train/planets", json!(0), "/train/planets"),
        (STAGE, "/train/positions_deg", json!([]), "/train/positions_deg"),
        (STAGE, "/train/phases", json!({ "sun": [0, 0], "ring": [0, 0, 0] }), "/train/phases/sun"),
        (STAGE, "/train/phases", json!("inphase"), "/train/phases"),
        (STAGE, "/train/freedoms", json!(["u_s", "u_q"]), "/train/freedoms"),
        (STAGE, "/train/freedoms", json!("torsion"), "/train/freedoms"),
        (STAGE, "/train/strict", json!(true), "/train/strict"),
        (STAGE, "/train/speed_rpm", json!(-500), "/train/speed_rpm"),
        (STAGE, "/train/load_nm", json!(20), "/train/load_nm"),
        (STAGE, "/run/integrator", json!({ "instructions": "mmx" }), "/run/integrator/instructions"),
        // No processor has all of them.
        (
            STAGE,
            "/run/integrator",
            json!({ "instructions": if cfg!(target_arch = "aarch64") { "sse2" } else { "neon" } }),
            "/run/integrator/instructions",
        ),
    ];
    for (text, pointer, new, place) in cases {
        let what = format!("{pointer} = {new}");
        let error = refused(set(text, pointer, new), &what);
        assert!(error.faults.iter().any(|f| f.pointer == place), "{what}: expected {place}\n{error}");
    }
}

/// Times that the clock does not resolve are refused with their numbers, before a run would stand still or go back in time.
#[test]
fn times_that_the_clock_does_not_resolve_are_refused() {
    let forced = |omega: f64, run: Value| {
        json!({ "flank": 1, "run": run, "train": {
            "kind": "wall", "mass_kg": 1, "load_harmonics": [{ "amplitude_n": 1, "frequency_rad_per_s": omega }],
            "wall": { "side": "above", "position_m": 1 }, "law": { "kind": "rigid", "restitution": 0.8 } } })
    };
    let switched = |period: f64| {
        json!({ "flank": 1, "run": { "cycles": 3 }, "train": {
            "kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": true, "mean_load": 0.1, "base_frequency": 0.6,
            "transmission_error": [{ "amplitude": 0.2, "frequency": 0.6 }],
            "stiffness": { "kind": "rectangular", "high": 1.2, "low": 0.8, "duty": 0.5, "period": period } } })
    };
    for (scene, place, number) in [
        (forced(1e15, json!({ "t_end_s": 1e10 })), "/run/t_end_s", "1.592e24 periods"),
        (forced(std::f64::consts::PI, json!({ "cycles": 1, "period_s": 1e155 })), "/run/cycles", "1e155 s"),
        (forced(5e-324, json!({ "cycles": 3 })), "/train", "5e-324 rad/s"),
        (forced(1e200, json!({ "cycles": 3 })), "/train", "1e200 rad/s"),
        (switched(1e-30), "/train", "5e-31"),
    ] {
        let error = refused(scene, number);
        let [fault] = &error.faults[..] else { panic!("{error}") };
        assert!(fault.pointer == place && fault.found.contains(number), "{error}");
    }
    for scene in [
        forced(1e30, json!({ "cycles": 1000 })),
        forced(1e-30, json!({ "cycles": 1000 })),
        forced(6.3, json!({ "t_end_s": 1e15 })),
        forced(6.3, json!({ "start_cycle": 1_000_000_000_000_000u64, "cycles": 3 })),
        switched(1e-9),
    ] {
        Scene::from_value(scene, "sound").expect("a scene");
    }
}

#[test]
fn a_missing_key_is_reported_where_it_belongs() {
    for (text, pointer) in [
        (WALL, "/flank"),
        (WALL, "/train"),
        (WALL, "/train/kind"),
        (WALL, "/train/mass_kg"),
        (WALL, "/train/law"),
        (WALL, "/train/law/restitution"),
        (WALL, "/run"),
        (PAIR, "/train/damping_in_gap"),
        (PAIR, "/train/stiffness/high"),
        (MATRICES, "/train/contacts/1/half_backlash_m"),
        (MATRICES, "/train/contacts/1/stiffness"),
        (SPUR, "/train/mesh/law/kind"),
    ] {
        let error = refused(remove(text, pointer), pointer);
        assert_eq!(error.faults.len(), 1, "{error}");
        assert_eq!(error.faults[0].pointer, pointer, "{error}");
    }
}

#[test]
fn a_text_that_is_not_a_scene_is_refused() {
    let deep = "[".repeat(10_000);
    for (text, word) in [
        ("", "empty"),
        ("  \n", "empty"),
        ("\u{feff}", "empty"),
        ("[]", "a list of 0"),
        ("7", "7"),
        ("{", "EOF"),
        ("{\"flank\": 1,}", "trailing comma"),
        ("{\"flank\": NaN}", "expected value"),
        ("{\"flank\": -Infinity}", "line 1"),
        ("{\"flank\": 1e999}", "out of range"),
        ("{\"flank\": 1} {}", "trailing characters"),
        ("// scene\n{}", "expected value"),
        (&deep, "recursion limit"),
        ("\u{0}\u{1}\u{2}", "expected value"),
    ] {
        let error = Scene::from_json(text, "bad").expect_err(word);
        assert!(error.faults[0].found.contains(word), "{word}: {error}");
        assert!(!error.faults[0].remedy.is_empty(), "{error}");
    }
    let nan = Scene::from_json("{\"flank\": NaN}", "bad").expect_err("NaN").to_string();
    assert!(nan.contains("no NaN"), "{nan}");
}

#[test]
fn a_key_written_twice_is_refused() {
    let text = WALL.replace("\"mass_kg\": 1.0", "\"mass_kg\": 1.0, \"mass_kg\": 2.0");
    let error = Scene::from_json(&text, "twice").expect_err("twice");
    assert_eq!(error.faults[0].pointer, "/train/mass_kg", "{error}");
}

#[test]
fn a_file_that_is_not_text_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("binary.json");
    std::fs::write(&path, [0xff, 0xfe, 0x7b, 0x00]).expect("a file");
    assert!(Scene::from_file(&path).expect_err("binary").to_string().contains("UTF-8"));
    assert!(Scene::from_file(folder.path().join("none.json")).is_err());
    assert!(Scene::from_file(folder.path()).is_err());
}

#[test]
fn a_byte_order_mark_is_no_fault() {
    assert!(Scene::from_json(&format!("\u{feff}{WALL}"), "marked").is_ok());
}

#[test]
fn all_faults_come_at_once() {
    let mut scene = set(MATRICES, "/train/load_n", json!([1]));
    scene["run"] = json!({ "cycle": 1 });
    scene["initial"] = json!("moving");
    let error = refused(scene, "three faults");
    for place in ["/train/load_n", "/run/cycle", "/run/cycles", "/initial"] {
        assert!(error.faults.iter().any(|f| f.pointer == place), "{place}: {error}");
    }
    let text = error.to_string();
    assert!(text.contains("did you mean \"cycles\"?"), "{text}");
    assert!(text.contains("choose one of the allowed words"), "{text}");
}

#[test]
fn a_bare_backlash_names_both_right_keys() {
    let error = refused(set(MATRICES, "/train/contacts/0/backlash", json!(1)), "backlash").to_string();
    assert!(error.contains("half_backlash") && error.contains("total_backlash"), "{error}");
}

/// A preset gives way to each key alone; two of the scene that exclude each other are refused, as without a preset.
#[test]
fn keys_that_exclude_each_other_are_refused_over_a_preset_too() {
    let scene = |mesh: Value| {
        let train = json!({ "kind": "planetary", "preset": "reference", "speed_rpm": 650, "sun_mesh": mesh });
        Scene::from_value(json!({ "flank": 1, "train": train, "run": { "cycles": 10 } }), "preset")
    };
    for alone in [json!({ "half_backlash_m": 1e-5 }), json!({ "total_backlash_m": 2e-5 })] {
        let scene = scene(alone).unwrap();
        assert_eq!(scene.built().spec.contacts[0].half_backlash, 1e-5);
        for other in ["half_backlash_m", "total_backlash_m"] {
            let changed = scene.with(&format!("/train/sun_mesh/{other}"), json!(4e-5));
            assert_eq!(changed.is_ok(), scene.given()["train"]["sun_mesh"].get(other).is_some(), "{other}");
        }
    }
    let error = scene(json!({ "half_backlash_m": 1e-5, "total_backlash_m": 2e-5 })).unwrap_err();
    assert!(error.to_string().contains("2 keys that exclude each other"), "{error}");
}

#[test]
fn a_key_stands_for_its_only_place() {
    let gearbox =
        Scene::from_file(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/scenes/three-shaft-box.json")).unwrap();
    // Given once, for all meshes, though each mesh has it in the end.
    assert_eq!(gearbox.pointer("total_backlash_m").unwrap(), "/train/mesh/total_backlash_m");
    assert_eq!(gearbox.pointer("/run/cycles").unwrap(), "/run/cycles");
    // A default of the scene.
    assert_eq!(gearbox.pointer("event_budget").unwrap(), "/run/event_budget");
    let several = gearbox.pointer("teeth").unwrap_err().to_string();
    assert!(several.contains("4 places") && several.contains("/train/shafts/0/gears/0/teeth"), "{several}");
    let unknown = gearbox.pointer("speed_rmp").unwrap_err().to_string();
    assert!(unknown.contains("did you mean \"speed_rpm\"?"), "{unknown}");
}

/// All pointers of a value.
fn places(value: &Value, here: String, all: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| places(v, format!("{here}/{k}"), all)),
        Value::Array(items) => items.iter().enumerate().for_each(|(i, v)| places(v, format!("{here}/{i}"), all)),
        _ => {}
    }
    all.push(here);
}

fn replacement() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        prop_oneof![Just(0.0), Just(-0.0), Just(1.0), Just(-1.0), Just(1.0e308), Just(5.0e-324), Just(1.0e-200)]
            .prop_map(Value::from),
        prop_oneof![Just(0), Just(1), Just(2), Just(u64::MAX)].prop_map(Value::from),
        ".{0,12}".prop_map(Value::from),
        Just(json!([])),
        Just(json!({})),
        Just(json!([[1.0]])),
        Just(json!([1.0, "a", null])),
        prop::sample::select(vec!["rest", "static", "power", "rigid", "bilateral", "kelvin-voigt", "both", "drive"])
            .prop_map(Value::from),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn no_mutation_of_a_scene_makes_it_panic(
        scene in prop::sample::select(vec![WALL, BOUNCE, PAIR, HARMONIC, SPUR, MATRICES, STAGE]),
        written_out in any::<bool>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), prop::option::of(replacement())), 1..4),
    ) {
        let mut scene = value(scene);
        if written_out {
            scene = Scene::from_value(scene, "base").expect("an example").resolved().clone();
        }
        for (index, new) in edits {
            let mut all = Vec::new();
            places(&scene, String::new(), &mut all);
            let place = &all[index.index(all.len())];
            match (new, place.rsplit_once('/')) {
                (None, Some((parent, key))) => {
                    if let Some(Value::Object(map)) = scene.pointer_mut(parent) {
                        map.remove(key);
                    }
                }
                (Some(new), _) => {
                    if let Some(node) = scene.pointer_mut(place) {
                        *node = new;
                    }
                }
                (None, None) => {}
            }
        }
        match Scene::from_value(scene, "mutant") {
            Ok(scene) => {
                let built = scene.build();
                prop_assert!(built.is_ok());
                let again = Scene::from_json(&scene.resolved().to_string(), "again");
                prop_assert_eq!(again.map(|s| s.hash()), Ok(scene.hash()));
            }
            Err(error) => {
                prop_assert!(!error.faults.is_empty());
                prop_assert!(error.faults.iter().all(|f| !f.remedy.is_empty()), "{}", error);
            }
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "\\PC{0,200}") {
        let _ = Scene::from_json(&text, "noise");
    }
}

/// What keeps a scene from being read, from having an orbit, or from being swept.
fn complaint(scene: &Value, asked: &str) -> Option<String> {
    let scene = match Scene::from_value(scene.clone(), "asked") {
        Ok(scene) => scene,
        Err(error) => return Some(error.to_string()),
    };
    let simulation = Simulation::from_scene(&scene).and_then(Simulation::in_common_cycles);
    let simulation = simulation.expect("a scene that was read");
    match asked {
        "orbit" => SectionMap::new(&simulation).and_then(|map| map.repeats()).err().map(|error| error.to_string()),
        "sweep" => steady(scene, None, &Rule::default(), Task::default()).err().map(|error| error.to_string()),
        "run" => simulation.run().err().map(|error| error.to_string()),
        _ => None,
    }
}

#[test]
fn a_key_named_as_a_remedy_is_one_that_the_same_scene_accepts() {
    let switched = json!({ "kind": "switched", "levels": [1.0, 2.0], "times": [30.0] });
    let with = |text: &str, changes: &[(&str, Value)]| {
        changes.iter().fold(value(text), |scene, (pointer, new)| set(&scene.to_string(), pointer, new.clone()))
    };
    let no_period = json!({ "flank": 1, "train": { "kind": "wall", "mass_kg": 1, "load_n": -9.81,
        "wall": { "side": "below", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 } },
        "initial": { "q": [1] }, "run": { "cycles": 5 } });
    let released = json!({ "damping_in_gap": true, "release": "force" });
    // Scene, what is asked of it, the key that the message names, and its remedy.
    let cases: [(Value, &str, &str, (&str, Value)); 5] = [
        (with(PAIR, &[("/train/stiffness", switched)]), "orbit", "/run/start_cycle", ("/run/start_cycle", json!(50))),
        (
            with(BOUNCE, &[("/run/event_budget", json!(3))]),
            "sweep",
            "/run/event_budget",
            ("/run/event_budget", json!(1e6)),
        ),
        (with(BOUNCE, &[("/run/step_budget", json!(5))]), "run", "run.step_budget", ("/run/step_budget", json!(1e7))),
        (no_period, "read", "period_s", ("/run/period_s", json!(1.0))),
        (
            with(
                PAIR,
                &[
                    ("/train/damping_in_gap", released["damping_in_gap"].clone()),
                    ("/train/release", released["release"].clone()),
                ],
            ),
            "read",
            "damping_in_gap",
            ("/train/damping_in_gap", json!(false)),
        ),
    ];
    for (scene, asked, key, remedy) in cases {
        let told = complaint(&scene, asked).unwrap_or_else(|| panic!("{key}: no complaint"));
        assert!(told.contains(key), "{key}: {told}");
        assert_eq!(complaint(&with(&scene.to_string(), &[remedy]), asked), None, "{key}");
    }
}
