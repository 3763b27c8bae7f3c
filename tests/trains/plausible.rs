//! Plausible mistakes: each is refused or warned of, with the key and words that lead to its cause. Sound scenes are not.

use flank::scene::Scene;
use serde_json::{Value, json};

fn example(name: &str) -> Value {
    let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn pair() -> Value {
    json!({
        "flank": 1,
        "train": {
            "kind": "gear-pair", "speed_rpm": 1000, "torque_nm": 40, "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
            "driving": { "teeth": 30, "mass_kg": 1.5, "inertia_kg_m2": 0.0015, "face_width_m": 0.02 },
            "driven": { "teeth": 45, "mass_kg": 3, "inertia_kg_m2": 0.006, "face_width_m": 0.02 },
            "mesh": { "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4,
                      "stiffness": { "kind": "tooth-pairs", "mean": 3e8 }, "error": [{ "order": 1, "amplitude_m": 3e-6 }] }
        },
        "run": { "cycles": 10 }
    })
}

fn stage() -> Value {
    let mesh =
        json!({ "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "half_backlash_m": 5e-5, "stiffness": 4e8 });
    let held = json!({ "stiffness_n_per_m": 1e9, "damping_ratio": 0.1 });
    json!({
        "flank": 1,
        "train": {
            "kind": "planetary", "freedoms": "torsional", "speed_rpm": 1000, "load": { "output_torque_nm": 200 },
            "teeth": { "sun": 30, "planet": 30, "ring": 90 }, "planets": 3,
            "rack": { "module_m": 0.003, "pressure_angle_deg": 20, "profile_shift": { "sun": 0, "planet": 0, "ring": 0 } },
            "sun": { "mass_kg": 1.2, "inertia_kg_m2": 0.0012, "rotation": { "stiffness_n_per_m": 1e6, "damping_ratio": 0.1 } },
            "planet": { "mass_kg": 1.2, "inertia_kg_m2": 0.0012 },
            "ring": { "mass_kg": 4, "inertia_kg_m2": 0.08, "rotation": held },
            "carrier": { "mass_kg": 5, "inertia_kg_m2": 0.05, "rotation": held }, "sun_mesh": mesh, "ring_mesh": mesh
        },
        "run": { "cycles": 10 }
    })
}

/// What is said of a scene: `place: words` of warnings, or of faults.
fn said(scene: &Value) -> (bool, Vec<String>) {
    match Scene::from_json(&scene.to_string(), "scene") {
        Ok(scene) => (true, scene.built().warnings.iter().map(ToString::to_string).collect()),
        Err(error) => {
            let words = |fault: &flank::scene::Fault| format!("{}: {}; {}", fault.pointer, fault.found, fault.allowed);
            (false, error.faults.iter().map(words).collect())
        }
    }
}

fn with(mut scene: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match scene.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => other[key] = value,
    }
    scene
}

#[test]
fn sound_scenes_are_not_warned_of() {
    let names =
        ["spur-20kw", "loose-gear", "four-planets", "three-gear-chain", "helical-pair", "three-shaft-box", "spur-pair"];
    for scene in names.map(example).into_iter().chain([pair(), stage()]) {
        assert_eq!(said(&scene), (true, vec![]), "{}", scene["name"]);
    }
}

#[test]
#[allow(clippy::too_many_lines)]
fn mistakes_are_told() {
    let [pair, stage, shafts, planets, loose] =
        [pair(), stage(), example("three-shaft-box"), example("four-planets"), example("loose-gear")];
    let placed = with(shafts.clone(), "/train/shafts/0/position_m", json!([0, 0]));
    let (warned, refused) = (true, false);
    // Scene, pointer, value, refused or warned of, place, words.
    let mistakes: Vec<(&Value, &str, Value, bool, &str, &str)> = vec![
        (
            &pair,
            "/train/mesh/total_backlash_m",
            json!(100),
            warned,
            "/train/mesh/total_backlash_m",
            "100 m between both flanks",
        ),
        (&pair, "/train/mesh/total_backlash_m", json!(0.1), warned, "/train/mesh/total_backlash_m", "3.0e-4 m"),
        (&shafts, "/train/mesh/total_backlash_m", json!(0.12), warned, "/train/mesh/total_backlash_m", "2.5e-4 m"),
        (&stage, "/train/sun_mesh/half_backlash_m", json!(0.05), warned, "/train/sun_mesh/half_backlash_m", "0.1 m"),
        (&pair, "/train/mesh/error/0/amplitude_m", json!(5), warned, "/train/mesh/error", "errors of 5 m"),
        (&shafts, "/train/mesh/error/0/amplitude_m", json!(4), warned, "/train/mesh/error", "errors of 4 m"),
        (&pair, "/train/mesh/error/0/amplitude_m", json!(0.003), warned, "/train/mesh/error", "0.02 modules"),
        (&pair, "/train/mesh/law/damping_ratio", json!(5), warned, "/train/mesh/law/damping_ratio", "0.01 to 0.2"),
        (&shafts, "/train/mesh/law/damping_ratio", json!(4), warned, "/train/mesh/law/damping_ratio", "0.01 to 0.2"),
        (
            &stage,
            "/train/ring_mesh/law/damping_ratio",
            json!(5),
            warned,
            "/train/ring_mesh/law/damping_ratio",
            "0.01 to 0.2",
        ),
        (
            &stage,
            "/train/sun/rotation/damping_ratio",
            json!(5),
            warned,
            "/train/sun/rotation/damping_ratio",
            "0.01 to 0.2",
        ),
        (&pair, "/train/torque_nm", json!(63660), warned, "/train/torque_nm", "N mm"),
        (&shafts, "/train/shafts/0/torque_nm", json!(40_000), warned, "/train/shafts/0/torque_nm", "N mm"),
        (&stage, "/train/load/output_torque_nm", json!(200_000), warned, "/train/load", "N mm"),
        (&pair, "/train/mesh/stiffness/mean", json!(300), warned, "/train/mesh/stiffness", "ISO 6336-1"),
        (&pair, "/train/mesh/stiffness/mean", json!(3e5), warned, "/train/mesh/stiffness", "4.1e8 N/m"),
        (&pair, "/train/mesh/stiffness/mean", json!(3e11), warned, "/train/mesh/stiffness", "ISO 6336-1"),
        (&shafts, "/train/mesh/stiffness/mean", json!(400), warned, "/train/mesh/stiffness", "ISO 6336-1"),
        (&stage, "/train/ring_mesh/stiffness", json!(4e5), warned, "/train/ring_mesh/stiffness", "ISO 6336-1"),
        (
            &pair,
            "/train/driving/inertia_kg_m2",
            json!(18),
            warned,
            "/train/driving/inertia_kg_m2",
            "radius of gyration",
        ),
        (&pair, "/train/driving/mass_kg", json!(1500), warned, "/train/driving/inertia_kg_m2", "radius of gyration"),
        (
            &shafts,
            "/train/shafts/0/gears/0/inertia_kg_m2",
            json!(500),
            warned,
            "/train/shafts/0/gears/0/inertia_kg_m2",
            "disc",
        ),
        (&stage, "/train/planet/inertia_kg_m2", json!(18), warned, "/train/planet/inertia_kg_m2", "radius of gyration"),
        (&pair, "/train/speed_rpm", json!(1e6), warned, "/train/speed_rpm", "pitch circle"),
        (&shafts, "/train/shafts/0/speed_rpm", json!(1e6), warned, "/train/shafts/0/speed_rpm", "pitch circle"),
        (&stage, "/train/speed_rpm", json!(1e6), warned, "/train/speed_rpm", "pitch circle"),
        (&stage, "/train/planets", json!(8), warned, "/train/planets", "overlap"),
        (&planets, "/train/stages/0/planets", json!(8), warned, "/train/stages/0", "overlap"),
        (&pair, "/train/rack/pressure_angle_deg", json!(0.349), refused, "/train/rack/pressure_angle_deg", "5 to 45"),
        (&shafts, "/train/rack/pressure_angle_deg", json!(0.349), refused, "rack/pressure_angle_deg", "5 to 45"),
        (&shafts, "/train/rack/helix_angle_deg", json!(0.349), warned, "/train/rack/helix_angle_deg", "radians"),
        (&pair, "/train/rack/module_m", json!(3), warned, "/train/rack/module_m", "millimetres"),
        (&shafts, "/train/rack/module_m", json!(2.5), warned, "/train/rack/module_m", "millimetres"),
        (&stage, "/train/rack/module_m", json!(3), warned, "/train/rack/module_m", "millimetres"),
        (&stage, "/train/teeth/ring", json!(102), refused, "/train/teeth", "+12 teeth"),
        (&planets, "/train/stages/0/ring/teeth", json!(114), refused, "/train/stages/0", "shafts 0.072000 m apart"),
        (
            &shafts,
            "/train/shafts/0/gears/0/face_width_m",
            json!(24),
            warned,
            "/train/shafts/0/gears/0/face_width_m",
            "millimetres",
        ),
        (
            &shafts,
            "/train/shafts/0/gears/0/runout_m",
            json!(0.02),
            warned,
            "/train/shafts/0/gears/0/runout_m",
            "0.02 modules",
        ),
        (
            &planets,
            "/train/stages/0/pin_errors_m",
            json!([0.05, 0, 0, 0]),
            warned,
            "/train/stages/0/pin_errors_m",
            "0.05 m",
        ),
        (
            &shafts,
            "/train/meshes/0/centre_distance_m",
            json!(0.12),
            refused,
            "/train/meshes/0",
            "shafts 0.120000 m apart",
        ),
        (
            &placed,
            "/train/shafts/1/position_m",
            json!([120, 0]),
            refused,
            "/train/meshes/0",
            "shafts 120.000000 m apart",
        ),
        (&shafts, "/train/shafts/1/translation", json!({}), refused, "/train/shafts/1", "nothing holds"),
        (&loose, "/train/shafts/1/drag", json!({ "torque_nm": 300 }), warned, "/train/shafts/1/drag", "N mm"),
        (&shafts, "/train/shafts/0/orders/0/torque_nm", json!(60_000), warned, "/train/shafts/0/orders", "base circle"),
        (&pair, "/train/driving/profile_shift", json!(1.5), warned, "/train/driving/profile_shift", "-0.8 to 1"),
        (&pair, "/train/rack/addendum", json!(0.003), refused, "/train/mesh/stiffness/contact_ratio", "contact ratio"),
    ];
    for (scene, pointer, value, is_warned, place, words) in mistakes {
        let (is_built, said) = said(&with(scene.clone(), pointer, value.clone()));
        let found = said.iter().find(|line| line.split(": ").next().unwrap().contains(place) && line.contains(words));
        assert!(found.is_some(), "{pointer} = {value}: {said:#?}");
        assert_eq!(is_built, is_warned, "{pointer} = {value}: {said:#?}");
    }
}

/// A mistake in a unit is one line: what follows from it is not told.
#[test]
fn one_cause_is_one_line() {
    for (pointer, value) in [("/train/rack/module_m", json!(2.5)), ("/train/mesh/total_backlash_m", json!(0.12))] {
        assert_eq!(said(&with(example("three-shaft-box"), pointer, value)).1.len(), 1, "{pointer}");
    }
}

/// Bearings that do not hold a shaft are named by the freedoms that move without stiffness.
#[test]
fn free_motions_are_named() {
    let (_, said) = said(&with(pair(), "/train/freedoms", json!("torsional-translational")));
    assert!(
        said.iter().any(|line| line.contains("natural frequencies are zero") && line.contains("x_1, y_1")),
        "{said:?}"
    );
}

#[test]
fn strict_scenes_have_no_warnings() {
    let scene = with(stage(), "/train/strict", json!(true));
    assert_eq!(said(&scene), (true, vec![]));
    let (is_built, said) = said(&with(scene, "/train/planets", json!(8)));
    assert!(!is_built && said[0].starts_with("/train/strict") && said[0].contains("overlap"), "{said:?}");
}
