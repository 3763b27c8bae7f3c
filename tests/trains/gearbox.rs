//! Gearboxes: kinematics, phases, loads and faults against independent numbers.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use approx::assert_relative_eq;
use flank::{
    Task,
    gear::{BasicRack, Gear, Stiffness},
    orbit::MotionKind,
    scene::{BuiltScene, Scene},
    simulation::Simulation,
    study::steady::{Rule, steady},
    system::{Spec, bonded_modes, equilibrium},
};
use serde_json::{Value, json};

fn scene(train: &Value, initial: &Value) -> Value {
    json!({ "flank": 1, "train": train, "initial": initial, "run": { "cycles": 40 } })
}

fn built(train: &Value) -> BuiltScene {
    Scene::from_json(&scene(train, &json!("static")).to_string(), "test").unwrap().build().unwrap()
}

fn spec(train: &Value) -> Spec {
    built(train).spec
}

/// Faults of a train: place and what was found.
fn faults(train: &Value) -> Vec<(String, String)> {
    let built = Scene::from_json(&scene(train, &json!("rest")).to_string(), "test").and_then(|scene| scene.build());
    let Err(error) = built else { return vec![] };
    error.faults.iter().map(|fault| (fault.pointer.clone(), fault.found.clone())).collect()
}

fn example(name: &str) -> Value {
    let path = format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn mesh() -> Value {
    json!({ "law": { "kind": "kelvin-voigt", "damping_ratio": 0.05 }, "total_backlash_m": 1e-4,
            "stiffness": { "kind": "tooth-pairs", "mean": 3e8 }, "error": [{ "order": 1, "amplitude_m": 1e-6 }] })
}

/// A gearbox of one gear on each shaft: `(teeth, shift, internal)`, driven in a row, mesh angles in degrees.
fn row(gears: &[(u32, f64, bool)], angles: &[f64]) -> Value {
    let shafts: Vec<Value> = gears
        .iter()
        .enumerate()
        .map(|(i, (teeth, shift, internal))| {
            json!({ "name": format!("s{i}"), "speed_rpm": if i == 0 { json!(600) } else { Value::Null },
                    "torque_nm": if i == 0 { json!(50) } else if i + 1 == gears.len() { json!("balance") } else { json!(0) },
                    "gears": [{ "name": format!("g{i}"), "teeth": teeth, "profile_shift": shift, "internal": internal,
                                "inertia_kg_m2": 0.002 }] })
        })
        .collect();
    let meshes: Vec<Value> = (1..gears.len())
        .map(|i| json!({ "gears": [format!("g{}", i - 1), format!("g{i}")], "angle_deg": angles[i - 1] }))
        .collect();
    json!({ "kind": "gearbox", "rack": { "module_m": 0.002, "pressure_angle_deg": 20 }, "mesh": mesh(), "shafts": shafts,
            "meshes": meshes })
}

/// Mesh phases, read from errors of order 1 that have phase 0 in the clock of their mesh.
fn phases(spec: &Spec) -> Vec<f64> {
    spec.contacts.iter().map(|c| ((c.error[0].phase + FRAC_PI_2) / TAU).rem_euclid(1.0)).collect()
}

fn apart(one: f64, two: f64) -> f64 {
    let d = (one - two).rem_euclid(1.0);
    d.min(1.0 - d)
}

/// The same numbers to the last bit: a pair is a gearbox of two shafts.
#[test]
fn a_pair_is_a_gearbox_of_two_shafts() {
    for helix in [0.0, 15.0] {
        let rack = json!({ "module_m": 0.003, "pressure_angle_deg": 20, "helix_angle_deg": helix });
        let pair = json!({ "kind": "gear-pair", "rack": rack, "speed_rpm": 3000, "torque_nm": 63.66, "mesh": mesh(),
            "driving": { "teeth": 30, "mass_kg": 1.5, "inertia_kg_m2": 0.0018, "face_width_m": 0.04 },
            "driven": { "teeth": 45, "mass_kg": 3.4, "inertia_kg_m2": 0.0085, "profile_shift": 0.2 } });
        let gear = |name: &str, teeth: u32, inertia: f64, shift: f64| json!([{ "name": name, "teeth": teeth, "inertia_kg_m2": inertia, "face_width_m": 0.04, "profile_shift": shift }]);
        let gearbox = json!({ "kind": "gearbox", "rack": rack, "mesh": mesh(),
            "shafts": [{ "name": "1", "speed_rpm": 3000, "torque_nm": 63.66, "gears": gear("a", 30, 0.0018, 0.0) },
                       { "name": "2", "torque_nm": "balance", "gears": gear("b", 45, 0.0085, 0.2) }],
            "meshes": [{ "gears": ["a", "b"], "name": "mesh" }] });
        let (one, two) = (spec(&pair), spec(&gearbox));
        assert_eq!(
            (&one.freedoms, &one.mass, &one.contacts[0].direction),
            (&two.freedoms, &two.mass, &two.contacts[0].direction)
        );
        assert_eq!(one.contacts[0].law, two.contacts[0].law);
        // The mesh frequency comes from the speed in another order of products.
        let (Stiffness::Periodic { pieces: a, .. }, Stiffness::Periodic { pieces: b, .. }) =
            (&one.contacts[0].stiffness, &two.contacts[0].stiffness)
        else {
            panic!()
        };
        for (a, b) in a.iter().zip(b) {
            assert_relative_eq!(a.start, b.start, max_relative = 1e-15);
            assert_relative_eq!(a.value, b.value, max_relative = 1e-15);
        }
        assert_relative_eq!(one.omega.unwrap(), two.omega.unwrap(), max_relative = 1e-15);
        assert_relative_eq!(one.load[1], two.load[1], max_relative = 1e-15);
    }
}

/// A common value that no mesh takes has no effect, and the scene says so.
#[test]
fn a_common_value_that_every_mesh_replaces_is_reported() {
    let warnings = |change: &dyn Fn(&mut Value)| -> Vec<String> {
        let mut train = row(&[(20, 0.0, false), (30, 0.0, false), (40, 0.0, false)], &[0.0, 0.0]);
        change(&mut train);
        built(&train).warnings.iter().filter(|w| w.message.contains("no effect")).map(|w| w.pointer.clone()).collect()
    };
    assert!(warnings(&|train| train["meshes"][0]["total_backlash_m"] = json!(2e-4)).is_empty());
    let both = |train: &mut Value| {
        (0..2).for_each(|i| train["meshes"][i]["half_backlash_m"] = json!(1e-4));
        (0..2).for_each(|i| train["meshes"][i]["rack"] = json!({ "module_m": 0.002 }));
    };
    assert_eq!(warnings(&both), ["/train/mesh/total_backlash_m", "/train/rack/module_m"]);
}

/// A stage as a part of a gearbox has the frequencies and phases of the same stage alone.
#[test]
fn a_stage_is_a_part_of_a_gearbox() {
    let bearing = json!({ "stiffness_n_per_m": 5e8, "damping_ratio": 0.02 });
    let (ring_radius, rack) =
        (34.0 * 3e-3 * 20f64.to_radians().cos(), json!({ "module_m": 0.003, "pressure_angle_deg": 20 }));
    let with_shifts = json!({ "module_m": 0.003, "pressure_angle_deg": 20, "profile_shift": { "sun": 0.0, "planet": 0.0, "ring": 0.0 } });
    let stage = json!({ "kind": "planetary", "freedoms": "full", "speed_rpm": 1500, "load": { "output_torque_nm": 200 },
        "teeth": { "sun": 28, "planet": 20, "ring": 68 }, "rack": with_shifts, "planets": 4,
        "sun": { "mass_kg": 1.2, "inertia_kg_m2": 0.0012, "translation": bearing },
        "planet": { "mass_kg": 0.6, "inertia_kg_m2": 0.0003, "translation": bearing },
        "ring": { "mass_kg": 4, "inertia_kg_m2": 0.05, "translation": bearing,
                  "rotation": { "stiffness_n_per_m": 1e9, "damping_ratio": 0.1 } },
        "carrier": { "mass_kg": 5, "inertia_kg_m2": 0.03 }, "sun_mesh": mesh(), "ring_mesh": mesh() });
    let part = json!({ "kind": "gearbox", "rack": rack, "mesh": mesh(),
        "shafts": [{ "name": "in", "speed_rpm": 1500, "torque_nm": "balance", "translation": bearing },
                   { "name": "out", "torque_nm": -200, "inertia_kg_m2": 0.03, "mass_kg": 5 },
                   { "name": "housing", "fixed": true, "translation": bearing,
                     "rotation": { "stiffness_nm_per_rad": 1e9 * ring_radius * ring_radius, "damping_ratio": 0.1 } }],
        "stages": [{ "name": "stage", "carrier": "out", "planets": 4,
            "sun": { "shaft": "in", "teeth": 28, "mass_kg": 1.2, "inertia_kg_m2": 0.0012 },
            "planet": { "teeth": 20, "mass_kg": 0.6, "inertia_kg_m2": 0.0003, "translation": bearing },
            "ring": { "shaft": "housing", "teeth": 68, "mass_kg": 4, "inertia_kg_m2": 0.05 } }] });
    let (one, two) = (spec(&stage), spec(&part));
    let [a, b] = [&one, &two].map(|spec| bonded_modes(spec).unwrap().omega);
    for (a, b) in a.iter().zip(&b) {
        // Roots of eigenvalues that carry 1e-16 of the largest one.
        assert!((a - b).abs() <= 1e-7 * a.max(1000.0), "{a} {b}");
    }
    for (a, b) in phases(&one).into_iter().zip(phases(&two)) {
        assert!(apart(a, b) < 1e-12, "{a} {b}");
    }
    // Load sharing: T/(N r_b) of the output over the ratio, 1 + 68/28.
    let force = 200.0 / (1.0 + 68.0 / 28.0) / 4.0 / (0.042 * 20f64.to_radians().cos());
    let of = example("four-planets");
    assert_relative_eq!(force, 369.5, max_relative = 1e-4);
    for force_in_mesh in equilibrium(&spec(&of["train"])).unwrap().forces {
        assert_relative_eq!(force_in_mesh, force, max_relative = 1e-9);
    }
}

/// Natural frequencies of a free chain of three equal gears: 0, √(k/m), √(3k/m).
#[test]
fn a_chain_of_equal_gears() {
    let chain = spec(&row(&[(40, 0.0, false); 3], &[0.0, 0.0]));
    let base = 0.04 * 20f64.to_radians().cos();
    let m = 0.002 / (base * base);
    let modes = bonded_modes(&chain).unwrap();
    for (got, factor) in modes.omega.iter().zip([0.0f64, 1.0, 3.0]) {
        assert!((got - (factor * 3e8 / m).sqrt()).abs() < 1e-12 * (3e8 / m).sqrt(), "{got}");
    }
    for force in equilibrium(&chain).unwrap().forces {
        assert_relative_eq!(force, 50.0 / base, max_relative = 1e-12);
    }
}

/// Mean forces of the examples that have an independent number.
#[test]
fn torque_balance_of_the_examples() {
    for (name, wanted) in [("spur-20kw", 1505.5), ("three-gear-chain", 1505.5), ("helical-pair", 1505.5)] {
        for force in equilibrium(&spec(&example(name)["train"])).unwrap().forces {
            // T/(m Z cos α/2) of the normal section, whatever the helix angle.
            assert_relative_eq!(force, 63.66 / (0.045 * 20f64.to_radians().cos()), max_relative = 1e-9);
            assert_relative_eq!(force, wanted, max_relative = 1e-4);
        }
    }
    let hertz = bonded_modes(&spec(&example("spur-20kw")["train"])).unwrap().hertz();
    assert_relative_eq!(hertz[1], 3338.6, max_relative = 1e-4);
}

/// A right-handed gear that drives counter-clockwise is pushed towards +z with `F sin β_b`, its partner the other way.
#[test]
fn axial_forces() {
    for (hand, rpm, sign) in [("right", 3000, 1.0), ("left", 3000, -1.0), ("right", -3000, -1.0), ("left", -3000, 1.0)]
    {
        let mut train = example("helical-pair")["train"].clone();
        train["shafts"][0]["gears"][0]["hand"] = json!(hand);
        train["shafts"][0]["speed_rpm"] = json!(rpm);
        let spec = spec(&train);
        assert_eq!(spec.freedoms, ["u_motor", "w_motor", "u_output", "w_output"]);
        let at = equilibrium(&spec).unwrap();
        let base_helix = (15f64.to_radians().sin() * 20f64.to_radians().cos()).asin();
        let axial = at.forces[0] * base_helix.sin();
        assert!(at.forces[0] > 0.0);
        assert_relative_eq!(2e8 * at.position[1], sign * axial, max_relative = 1e-9);
        assert_relative_eq!(2e8 * at.position[3], -sign * axial, max_relative = 1e-9);
    }
}

/// Flanks of a gear as involutes: the polar angle of a flank at radius ρ, from the middle of the tooth.
struct ToothFlanks {
    base: f64,
    reference: f64,
    half: f64,
    tip: f64,
}

impl ToothFlanks {
    fn new(teeth: u32, shift: f64) -> Self {
        let rack = BasicRack {
            module: 2e-3,
            pressure_angle: 20f64.to_radians(),
            helix_angle: 0.0,
            addendum: 1.0,
            dedendum: 1.25,
        };
        let gear = Gear { teeth, shift };
        let reference = gear.pitch_radius(&rack);
        Self {
            base: gear.base_radius(&rack),
            reference,
            half: 0.5 * gear.tooth_thickness(&rack) / reference,
            tip: gear.tip_radius(&rack),
        }
    }

    /// Polar angle of the unrolled thread at radius ρ, from where it begins.
    fn unrolled(&self, rho: f64) -> f64 {
        let length = (rho * rho - self.base * self.base).max(0.0).sqrt();
        length / self.base - (length / self.base).atan()
    }

    fn flank(&self, rho: f64) -> f64 {
        self.half + self.unrolled(self.reference) - self.unrolled(rho)
    }
}

/// The contact of a pinion's tooth at angle `tooth`: its radius on the pinion, and the angle of the wheel's tooth (of a ring: space).
fn contact(
    pinion: &ToothFlanks,
    wheel: &ToothFlanks,
    centre: [f64; 2],
    is_ring: bool,
    sense: f64,
    tooth: f64,
) -> (f64, f64) {
    let angle = |rho: f64| {
        let polar = tooth + sense * pinion.flank(rho);
        let (x, y) = (rho * polar.cos() - centre[0], rho * polar.sin() - centre[1]);
        y.atan2(x) - sense * wheel.flank(x.hypot(y))
    };
    let reference = angle(pinion.reference);
    // The wheel has to get out of the way of every point of the flank: of the furthest one.
    let pushed = if is_ring { sense } else { -sense };
    let ahead = |rho: f64| {
        let d = angle(rho) - reference;
        pushed * (d - TAU * (d / TAU).round())
    };
    let (mut low, mut high) = (pinion.base * (1.0 + 1e-9), pinion.tip + 2e-3);
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..200 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if ahead(a) > ahead(b) { high = b } else { low = a }
    }
    (0.5 * (low + high), angle(0.5 * (low + high)))
}

/// Phases of a row of gears from drawn involutes: each wheel stands where the flank of the one before it touches it.
fn drawn_phases(gears: &[(u32, f64, bool)], spec: &Spec, angles: &[f64]) -> Vec<f64> {
    let drawn: Vec<ToothFlanks> = gears.iter().map(|(teeth, shift, _)| ToothFlanks::new(*teeth, *shift)).collect();
    let mut phases = Vec::new();
    let (mut sense, mut tooth) = (1.0, None::<f64>);
    for i in 1..gears.len() {
        let is_ring = gears[i].2;
        let (pinion, wheel) = (&drawn[i - 1], &drawn[i]);
        // The working pressure angle, from the direction of the push in a train that moves sideways, is not needed: distances are.
        let z = [gears[i - 1].0, gears[i].0].map(f64::from);
        let distance = distance(spec, i - 1);
        let working = distance * z[0] / if is_ring { z[1] - z[0] } else { z[0] + z[1] };
        let to = angles[i - 1].to_radians();
        let (centre, pitch) = ([distance * to.cos(), distance * to.sin()], if is_ring { to + PI } else { to });
        // The first flank crosses the direction of x.
        let own = tooth.unwrap_or(-sense * pinion.flank(working));
        // From which angle the contact stands on the line of centres: the radius of contact grows as the pinion turns.
        let start = pitch - sense * pinion.flank(working);
        let turn = TAU / z[0];
        let (mut low, mut high) = (start - sense * 0.2 * turn, start + sense * 0.2 * turn);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if contact(pinion, wheel, centre, is_ring, sense, middle).0 < working {
                low = middle
            } else {
                high = middle
            }
        }
        let gamma = sense * (own - low) / turn;
        phases.push(gamma.rem_euclid(1.0));
        let (_, at_pitch) = contact(pinion, wheel, centre, is_ring, sense, low);
        if !is_ring {
            sense = -sense;
        }
        tooth = Some(at_pitch + sense * TAU * gamma / z[1]);
    }
    phases
}

/// Centre distance of mesh `i`, from the working angle by which the base circles are apart.
fn distance(spec: &Spec, i: usize) -> f64 {
    spec.contacts[i].error_offset
}

#[test]
fn phases_are_those_of_drawn_involutes() {
    for (gears, angles) in [
        (vec![(30, 0.0, false), (40, 0.0, false), (50, 0.0, false)], vec![0.0, 0.0]),
        (vec![(30, 0.0, false), (40, 0.0, false), (50, 0.0, false)], vec![35.0, -60.0]),
        (vec![(24, 0.3, false), (31, 0.2, false), (87, 0.5, true)], vec![20.0, 170.0]),
        (vec![(21, 0.4, false), (34, -0.1, false), (29, 0.25, false), (33, 0.1, false)], vec![10.0, 100.0, -45.0]),
        (vec![(25, 0.1, false), (71, -0.2, true)], vec![77.0]),
    ] {
        let train = row(&gears, &angles);
        let mut spec = spec(&train);
        // Distances without play, by the involute function.
        let inv = |a: f64| a.tan() - a;
        let alpha = 20f64.to_radians();
        for (i, contact) in spec.contacts.iter_mut().enumerate() {
            let ((z1, x1, _), (z2, x2, ring)) = (gears[i], gears[i + 1]);
            let (z1, z2) = (f64::from(z1), f64::from(z2));
            let (teeth, shifts) = if ring { (z2 - z1, x2 - x1) } else { (z1 + z2, x1 + x2) };
            let wanted = inv(alpha) + 2.0 * alpha.tan() * shifts / teeth;
            let (mut low, mut high) = (0.01, 0.9);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                if inv(middle) < wanted { low = middle } else { high = middle }
            }
            contact.error_offset = 1e-3 * teeth * alpha.cos() / low.cos();
        }
        for (i, (got, want)) in phases(&spec).into_iter().zip(drawn_phases(&gears, &spec, &angles)).enumerate() {
            // The extreme of a smooth function is found to the root of the rounding.
            assert!(apart(got, want) < 1e-6, "{gears:?} {angles:?}, mesh {i}: {got} {want}");
        }
    }
}

/// Speeds: 27/51 and 23/34, so mesh frequencies are 51 : 23, and all forcing has a cycle of 15,606 mesh periods.
#[test]
fn speeds_and_the_common_cycle() {
    let train = example("three-shaft-box")["train"].clone();
    let spec = spec(&train);
    let omega = spec.omega.unwrap();
    assert_relative_eq!(omega, TAU * 25.0 * 27.0, max_relative = 1e-15);
    let Stiffness::Periodic { period, .. } = spec.contacts[1].stiffness else { panic!() };
    assert_relative_eq!(TAU / period / omega, 23.0 / 51.0, max_relative = 1e-15);
    // Runout of the output gear: one turn of it.
    assert_relative_eq!(spec.contacts[1].error[1].omega / omega, 23.0 / 51.0 / 34.0, max_relative = 1e-15);
    assert_relative_eq!(spec.load_harmonics[0].omega / omega, 2.0 / 27.0, max_relative = 1e-15);
    let text = scene(&train, &json!("static")).to_string();
    let simulation = Simulation::from_scene(Scene::from_json(&text, "box").unwrap()).unwrap();
    assert_eq!(simulation.structure.common_cycle(), Ok(15_606));
    // Power: 40 N m less 0.5 + 0.002 ω of the lay shaft, over the ratios.
    let lay = TAU * 25.0 * 27.0 / 51.0;
    let output = (40.0 - (0.5 + 0.002 * lay) * 27.0 / 51.0) * 51.0 / 27.0 * 34.0 / 23.0;
    let base = 34.0 * 0.0025 / 2.0 / 20f64.to_radians().cos()
        * (20f64.to_radians().tan() / 20f64.to_radians().cos()).atan().cos();
    assert_relative_eq!(spec.load[2], -output / base, max_relative = 1e-12);
    assert!(equilibrium(&spec).unwrap().forces.iter().all(|force| *force > 0.0));
}

/// A loose gear under a rigid law leaves its flank exactly where its inertia needs more than the drag; compliant laws tend to that.
#[test]
fn the_rattle_threshold_of_a_loose_gear() {
    let leaves = |law: &Value, stiffness: Value, acceleration: f64| {
        let mut scene = example("loose-gear");
        scene["train"]["meshes"][0]["law"] = law.clone();
        scene["train"]["meshes"][0]["stiffness"] = stiffness;
        scene["train"]["shafts"][0]["motion"][0]["acceleration_rad_per_s2"] = json!(acceleration);
        scene["run"] = json!({ "cycles": 120 });
        if law["kind"] == "rigid" {
            // At its outermost point, at the flank; there the acceleration is largest, and towards the flank.
            scene["train"]["shafts"][0]["motion"][0]["phase_rad"] = json!(PI);
            let omega = 2.0 * TAU * 800.0 / 60.0;
            let radius = 35.0 * 0.00125 * 20f64.to_radians().cos();
            let start = radius * acceleration / (omega * omega);
            scene["initial"] = json!({ "q": { "u_z38": 5e-5 - start }, "v": {} });
        }
        let scene = Scene::from_json(&scene.to_string(), "loose").unwrap();
        let outcome = Simulation::from_scene(scene).unwrap().run().unwrap();
        // A start on the flank to rounding strikes it once.
        outcome.events.iter().any(|event| event.n > 20)
    };
    // The loose gear turns by the ratio of teeth: I α 35/38 = T.
    let rigid = 0.3 / 0.0008 * 38.0 / 35.0;
    let threshold = |law: &Value, stiffness: &Value| {
        let (mut low, mut high) = (0.5 * rigid, 1.5 * rigid);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if leaves(law, stiffness.clone(), middle) { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    };
    let exact = threshold(&json!({ "kind": "rigid", "restitution": 0.5 }), &Value::Null);
    assert!((exact / rigid - 1.0).abs() < 2e-6, "{exact} {rigid}");
    let errors = [2e7, 2e8, 2e9].map(|k| {
        let law = json!({ "kind": "kelvin-voigt", "damping_ratio": 0.3, "release": "force" });
        (threshold(&law, &json!(k)) / rigid - 1.0).abs()
    });
    // Resonance of the mesh raises the force by (ω/ω_n)², in proportion to 1/k.
    assert!(errors[0] > 5.0 * errors[1] && errors[1] > 5.0 * errors[2] && errors[2] < 1e-4, "{errors:?}");
}

/// A cycle of 15,606 mesh periods is not waited for: neighbours come together, so the motion is a torus, and the reason says so.
#[test]
fn a_long_common_cycle_is_a_torus() {
    let mut scene = example("three-shaft-box");
    scene["train"]["shafts"][0]["speed_rpm"] = json!(1000);
    let scene = Scene::from_json(&scene.to_string(), "box").unwrap();
    let rule = Rule { irregular_cycles: 10, ..Rule::default() };
    let found = steady(scene, None, &rule, Task::default()).unwrap();
    assert_eq!((found.motion.kind, found.motion.period, found.measured_cycles), (MotionKind::QuasiPeriodic, None, 10));
    assert!(found.motion.reason.unwrap().contains("15606 cycles"));
    // The slowest decay is that of the speed, by the viscous drag of the lay shaft over all inertias: c/ΣI i².
    let [exponent, band] = found.motion.exponent.unwrap();
    let (i, j) = (27.0 / 51.0, 27.0 / 51.0 * 23.0 / 34.0);
    let inertia = 0.0045 + 0.0063 * i * i + 0.0214 * j * j;
    let rate = 0.5 * 0.002 * i * i / inertia;
    assert!((exponent + 2.0 * rate).abs() < 1e-3 * rate + 3.0 * band, "{exponent} {band} {rate}");
}

/// Trains that cannot be are refused with the names of what is at fault, and everything at once.
#[test]
fn bad_gearboxes() {
    let good = row(&[(30, 0.0, false), (40, 0.0, false)], &[0.0]);
    let third = json!({ "name": "s2", "inertia_kg_m2": 0.001, "gears": [{ "name": "g2", "teeth": 40 }] });
    let push = |list: &mut Value, item: Value| list.as_array_mut().unwrap().push(item);
    type Change<'a> = (&'a str, &'a str, Box<dyn Fn(&mut Value) + 'a>);
    let cases: Vec<Change> = vec![
        (
            "/train/shafts/1/gears/0/name",
            "a second gear called \"g0\"",
            Box::new(|t| {
                t["shafts"][1]["gears"][0]["name"] = json!("g0");
            }),
        ),
        ("/train/shafts/1/name", "a second shaft called \"s0\"", Box::new(|t| t["shafts"][1]["name"] = json!("s0"))),
        ("/train/meshes/0/gears", "the gear \"g0\" twice", Box::new(|t| t["meshes"][0]["gears"] = json!(["g0", "g0"]))),
        (
            "/train/meshes/2",
            "a train that cannot turn: these contradict each other: the speed of s0, gear g0, mesh g0-g1, \
          mesh g1-g2, mesh g2-g0",
            Box::new(|t| {
                push(&mut t["shafts"], third.clone());
                push(&mut t["meshes"], json!({ "gears": ["g1", "g2"], "angle_deg": 120 }));
                push(&mut t["meshes"], json!({ "gears": ["g2", "g0"] }));
            }),
        ),
        (
            "/train/shafts/2",
            "nothing that determines the speed of s2",
            Box::new(|t| push(&mut t["shafts"], third.clone())),
        ),
        (
            "/train/shafts/1/speed_rpm",
            "the speed of 2 shafts: s0, s1",
            Box::new(|t| t["shafts"][1]["speed_rpm"] = json!(5)),
        ),
        ("/train/speed_rpm", "no shaft with a speed", Box::new(|t| t["shafts"][0]["speed_rpm"] = Value::Null)),
        (
            "/train/shafts/0/translation",
            "s0: a shaft that nothing holds",
            Box::new(|t| {
                t["shafts"][0]["mass_kg"] = json!(1);
                t["shafts"][0]["translation"] = json!({});
            }),
        ),
        (
            "/train/shafts/0/mass_kg",
            "s0: no mass",
            Box::new(|t| {
                t["shafts"][0]["axial"] = json!({ "stiffness_n_per_m": 1e8 });
            }),
        ),
        (
            "/train/shafts",
            "torques that do not balance: 50.000000 N m, counted on the shaft of the given speed, are left over",
            Box::new(|t| t["shafts"][1]["torque_nm"] = json!(0)),
        ),
        (
            "/train/shafts/1/torque_nm",
            "\"balance\" on 2 shafts",
            Box::new(|t| t["shafts"][0]["torque_nm"] = json!("balance")),
        ),
        (
            "/train/meshes/0/gears",
            "g0-g1: shafts 0.100000 m apart",
            Box::new(|t| {
                t["meshes"][0]["angle_deg"] = Value::Null;
                t["shafts"][0]["position_m"] = json!([0, 0]);
                t["shafts"][1]["position_m"] = json!([0.1, 0]);
            }),
        ),
        (
            "/train/meshes/0/angle_deg",
            "g0-g1: an angle of 0.000000 deg",
            Box::new(|t| {
                t["shafts"][0]["position_m"] = json!([0, 0]);
                t["shafts"][1]["position_m"] = json!([0, 0.07]);
            }),
        ),
        (
            "/train/meshes/0/gears",
            "hands of g0 and g1 that do not match",
            Box::new(|t| {
                t["rack"]["helix_angle_deg"] = json!(15);
                t["mesh"]["stiffness"] = json!(3e8);
                for i in 0..2 {
                    t["shafts"][i]["gears"][0]["hand"] = json!("left");
                }
            }),
        ),
        (
            "/train/mesh/stiffness/kind",
            "lines of contact of helical teeth without a face width",
            Box::new(|t| {
                t["rack"]["helix_angle_deg"] = json!(15);
            }),
        ),
        (
            "/train/meshes/1/rack",
            "g1-g2: another rack than g0-g1 gives to g1",
            Box::new(|t| {
                push(&mut t["shafts"], third.clone());
                push(&mut t["meshes"], json!({ "gears": ["g1", "g2"], "rack": { "module_m": 0.003 } }));
            }),
        ),
        (
            "/train/shafts/0/gears/0/inertia_kg_m2",
            "g0: a loose gear without inertia",
            Box::new(|t| {
                t["shafts"][0]["inertia_kg_m2"] = json!(1);
                t["shafts"][1]["speed_rpm"] = json!(100);
                t["shafts"][0]["speed_rpm"] = Value::Null;
                t["shafts"][0]["fixed"] = json!(true);
                t["shafts"][0]["gears"][0]["inertia_kg_m2"] = json!(0);
                t["shafts"][0]["gears"][0]["loose"] = json!(true);
            }),
        ),
        (
            "/train/shafts/1/inertia_kg_m2",
            "s1: no inertia",
            Box::new(|t| t["shafts"][1]["gears"][0]["inertia_kg_m2"] = json!(0)),
        ),
        (
            "/train/shafts/0/motion",
            "s0: a given motion beside torques or \"fixed\"",
            Box::new(|t| {
                t["shafts"][0]["motion"] = json!([{ "order": 2, "angle_rad": 1e-3 }]);
            }),
        ),
        (
            "/train/shafts/0/orders/phase_rad",
            "a list of 2",
            Box::new(|t| {
                t["shafts"][0]["orders"] = json!({ "order": [1], "torque_nm": [3], "phase_rad": [1, 2] });
            }),
        ),
    ];
    for (pointer, found, change) in cases {
        let mut train = good.clone();
        change(&mut train);
        let got = faults(&train);
        assert!(got.contains(&(pointer.to_owned(), found.to_owned())), "{pointer} {found}:\n{got:#?}");
    }
    // Two independent faults at once.
    let mut train = good;
    train["shafts"][1]["gears"][0]["inertia_kg_m2"] = json!(0);
    train["shafts"][0]["axial"] = json!({ "stiffness_n_per_m": 1e8 });
    assert_eq!(faults(&train).len(), 2);
}

/// Planets at positions where no teeth fit, and rings of other sizes than their stage.
#[test]
fn stages_that_do_not_close() {
    let stage = |sun: u32, ring: u32| {
        let mut train = example("four-planets")["train"].clone();
        train["stages"][0]["sun"]["teeth"] = json!(sun);
        train["stages"][0]["ring"]["teeth"] = json!(ring);
        faults(&train)
    };
    assert_eq!(stage(28, 68), []);
    let odd = stage(29, 69);
    assert_eq!(odd.len(), 1, "{odd:?}");
    assert!(odd[0].1.starts_with("teeth of stage planet 2 and stage ring that are 0.5000 of a pitch apart"), "{odd:?}");
    let large = stage(28, 80);
    assert!(large.iter().all(|fault| fault.1.contains("m apart")) && large.len() == 1, "{large:?}");
}

/// A table of orders is the list of its rows; amplitudes of angle, speed and acceleration of one motion are one motion.
#[test]
fn orders() {
    let of = |key: &str, orders: Value| {
        let mut train = example("loose-gear")["train"].clone();
        train["shafts"][0][key] = orders;
        spec(&train)
    };
    let (omega, alpha) = (2.0 * TAU * 800.0 / 60.0, 486.5);
    let list = |amplitude: &str, value: f64, phase: f64| json!([{ "order": 2, amplitude: value, "phase_rad": phase }]);
    let wanted = of("motion", list("acceleration_rad_per_s2", alpha, 0.0));
    for (amplitude, value, phase) in
        [("angle_rad", alpha / (omega * omega), PI), ("speed_rpm", alpha / omega * 60.0 / TAU, -FRAC_PI_2)]
    {
        let got = of("motion", list(amplitude, value, phase));
        for t in [0.0, 1e-3, 0.0123] {
            let [a, b] = [&got, &wanted].map(|spec| spec.contacts[0].error_at(t));
            assert!((a[0] - b[0]).abs() < 1e-15 && (a[1] - b[1]).abs() < 1e-12, "{amplitude} {t}: {a:?} {b:?}");
        }
    }
    let table = json!({ "order": [2], "acceleration_rad_per_s2": [alpha] });
    assert_eq!(of("motion", table), wanted);
    let mut train = example("three-shaft-box")["train"].clone();
    let listed = spec(&train);
    train["shafts"][0]["orders"] = json!({ "order": ["2/1"], "torque_nm": [60], "phase_rad": [0] });
    assert_eq!(spec(&train), listed);
}

/// A preset with other teeth takes what follows from them, or asks for it; it never keeps the old numbers.
#[test]
fn presets_with_other_teeth() {
    let trap = json!({ "kind": "planetary", "preset": "reference-light", "freedoms": "full", "speed_rpm": 1500,
        "teeth": { "sun": 28, "planet": 20, "ring": 68 }, "planets": 4,
        "rack": { "module_m": 0.003, "pressure_angle_deg": 20, "profile_shift": { "sun": 0, "planet": 0, "ring": 0 } } });
    let places: Vec<String> = faults(&trap).into_iter().map(|(place, _)| place).collect();
    for wanted in ["/train/sun", "/train/planet", "/train/ring", "/train/carrier"] {
        assert!(places.iter().any(|place| place.starts_with(wanted)), "{wanted} {places:?}");
    }
    let mut whole = trap;
    for (body, inertia) in [("sun", 0.0012), ("planet", 0.0003), ("ring", 0.05), ("carrier", 0.03)] {
        whole[body] = json!({ "inertia_kg_m2": inertia });
    }
    for mesh in ["sun_mesh", "ring_mesh"] {
        whole[mesh] = json!({ "stiffness": { "kind": "hertz" } });
    }
    let spec = spec(&whole);
    let base = 0.042 * 20f64.to_radians().cos();
    assert_relative_eq!(spec.mass[(2, 2)], 0.0012 / (base * base), max_relative = 1e-14);
}

/// `"quasi-static"` starts on the flank with the errors of the start and moves with them; `"static"` warns where they pass the gap.
#[test]
fn starts_that_include_the_errors() {
    let example = example("loose-gear");
    let scene = |initial: &str| {
        let scene = starting(&example, initial);
        Scene::from_json(&scene.to_string(), "loose").unwrap().build().unwrap()
    };
    let (still, moved) = (scene("static"), scene("quasi-static"));
    assert!(
        still.warnings.iter().any(|warning| warning.message.contains("inside its back flank")),
        "{:?}",
        still.warnings
    );
    assert_eq!(moved.warnings, []);
    let contact = &moved.spec.contacts[0];
    let [error, rate] = contact.error_at(0.0);
    let force = 0.3 / (38.0 * 0.00125 * 20f64.to_radians().cos());
    let g = contact.direction[0];
    assert_relative_eq!(g * moved.q0[0] - error - 5e-5, force / 2e8, max_relative = 1e-9);
    assert!((g * moved.v0[0] - rate).abs() < 1e-15);
}

fn starting(scene: &Value, initial: &str) -> Value {
    let mut scene = scene.clone();
    scene["initial"] = json!(initial);
    scene
}

/// The stage as a whole turns as its planets do: the constant drag of a pin brakes, and the sun brings what it takes.
#[test]
fn drag_of_planets_enters_the_balance() {
    let mut train = example("four-planets")["train"].clone();
    let still = equilibrium(&spec(&train)).unwrap().forces;
    train["stages"][0]["planet"]["drag"] = json!({ "torque_nm": 0.1 });
    let braked = equilibrium(&spec(&train)).unwrap().forces;
    // A planet turns against its pin: its sun mesh gets more force than its ring mesh, by T/r_b.
    let base = 0.03 * 20f64.to_radians().cos();
    for i in 0..4 {
        assert_relative_eq!(still[i], still[4 + i], max_relative = 1e-9);
        assert_relative_eq!(braked[i] - braked[4 + i], 0.1 / base, max_relative = 1e-6);
    }
}

/// An eccentric gear is one whose centre goes round: its error is what that motion would do to the deflection. So are pin errors.
#[test]
fn runout_and_pin_errors_are_motions_of_centres() {
    let bearing = json!({ "stiffness_n_per_m": 1e8 });
    for (rpm, helix, internal) in [(600.0, 0.0, false), (-600.0, 18.0, false), (600.0, 18.0, true)] {
        let mut train = row(&[(24, 0.1, false), (70, 0.0, internal)], &[50.0]);
        train["rack"]["helix_angle_deg"] = json!(helix);
        train["mesh"]["stiffness"] = json!(3e8);
        train["mesh"]["error"] = json!([]);
        train["shafts"][0]["speed_rpm"] = json!(rpm);
        for (i, (runout, angle)) in [(2e-5, 30.0), (5e-5, 200.0)].into_iter().enumerate() {
            train["shafts"][i]["mass_kg"] = json!(1);
            train["shafts"][i]["translation"] = bearing.clone();
            train["shafts"][i]["gears"][0]["runout_m"] = json!(runout);
            train["shafts"][i]["gears"][0]["runout_deg"] = json!(angle);
        }
        let spec = spec(&train);
        assert_eq!(spec.freedoms, ["x_s0", "y_s0", "u_s0", "x_s1", "y_s1", "u_s1"]);
        let speed = rpm * TAU / 60.0;
        let driven = if internal { speed } else { -speed } * 24.0 / 70.0;
        for t in [0.0, 0.0123, 0.077] {
            let centres = [(0, speed, 1e-5, 30f64), (3, driven, 2.5e-5, 200f64)];
            let moved = centres.map(|(k, omega, size, angle)| {
                let g = &spec.contacts[0].direction;
                let at = omega * t + angle.to_radians();
                size * (g[k] * at.cos() + g[k + 1] * at.sin())
            });
            assert!((spec.contacts[0].error_at(t)[0] + moved[0] + moved[1]).abs() < 1e-18, "{rpm} {helix} {internal}");
        }
    }
    let mut train = example("four-planets")["train"].clone();
    train["stages"][0]["pin_errors_m"] = json!([0, 3e-6, 0, 0]);
    let spec = spec(&train);
    let eta = spec.freedoms.iter().position(|name| name == "eta_stage planet 2").unwrap();
    for contact in &spec.contacts {
        assert!((contact.error_offset + 3e-6 * contact.direction[eta]).abs() < 1e-20, "{}", contact.name);
    }
}

/// A damping ratio between a shaft of given motion and another one refers to the other one alone; a damper carries the given speed.
#[test]
fn couplings_to_given_motions() {
    let train = |motion: Value| {
        json!({ "kind": "gearbox", "rack": { "module_m": 0.002, "pressure_angle_deg": 20 }, "shafts": [
            { "name": "engine", "speed_rpm": 600, "motion": motion, "radius_m": 0.05 },
            { "name": "input", "inertia_kg_m2": 0.01, "torque_nm": -5, "radius_m": 0.05 }],
            "couplings": [{ "shafts": ["engine", "input"], "rotation": { "stiffness_nm_per_rad": 400, "damping_ratio": 0.1 } }] })
    };
    let text =
        json!({ "flank": 1, "train": train(json!([{ "order": 1, "angle_rad": 0.02 }])), "run": { "t_end_s": 1 } });
    let spec = Scene::from_json(&text.to_string(), "clutch").unwrap().build().unwrap().spec;
    let (k, c) = (400.0 / 0.0025, 2.0 * 0.1 * (400.0f64 * 0.01).sqrt() / 0.0025);
    assert_relative_eq!(spec.stiffness[(0, 0)], k, max_relative = 1e-14);
    assert_relative_eq!(spec.damping[(0, 0)], c, max_relative = 1e-14);
    // k u + c u' of the given motion u = 0.05 · 0.02 cos ω t.
    let omega = TAU * 10.0;
    for t in [0.0f64, 0.013, 0.04] {
        let got: f64 = spec.load_harmonics.iter().map(|l| l.vector[0] * (l.omega * t + l.phase).cos()).sum();
        let want = 1e-3 * (k * (omega * t).cos() - c * omega * (omega * t).sin());
        assert!((got - want).abs() < 1e-12 * k * 1e-3, "{t}: {got} {want}");
    }
}

/// A fluctuation that could reverse the slip of a loose gear is warned of, by motion and by torque.
#[test]
fn slip_that_could_reverse() {
    let warnings = |key: &str, order: Value| {
        let mut train = example("loose-gear")["train"].clone();
        train["shafts"][0]["motion"] = json!([]);
        train["shafts"][0]["torque_nm"] = json!("balance");
        train["shafts"][0]["inertia_kg_m2"] = json!(0.01);
        if key == "motion" {
            train["shafts"][0]["torque_nm"] = json!(0);
        }
        train["shafts"][0][key] = json!([order]);
        let warnings = built(&train).warnings;
        warnings.iter().any(|warning| warning.message.contains("could change its sign"))
    };
    for (share, wanted) in [(0.9, false), (1.1, true)] {
        assert_eq!(warnings("motion", json!({ "order": 2, "speed_rpm": 800.0 * share })), wanted);
        let (omega, i) = (800.0 * TAU / 60.0, 35.0 / 38.0);
        let torque = share * (0.01 + 0.0008 * i * i) * 2.0 * omega * omega;
        assert_eq!(warnings("orders", json!({ "order": 2, "torque_nm": torque })), wanted);
    }
}

/// A stage of three planets between a sun, a carrier and a ring, one of which is `fixed` and one of which `drives`.
fn three_planets(drives: &str, fixed: &str) -> Value {
    let shaft = |name: &str| {
        let mut shaft = json!({ "name": name, "inertia_kg_m2": 0.002 });
        if name == fixed {
            shaft["fixed"] = json!(true);
        } else if name == drives {
            shaft["speed_rpm"] = json!(900);
            shaft["torque_nm"] = json!(30);
        } else {
            shaft["torque_nm"] = json!("balance");
        }
        shaft
    };
    json!({ "kind": "gearbox", "rack": { "module_m": 0.002, "pressure_angle_deg": 20 }, "mesh": mesh(),
            "shafts": [shaft("sun"), shaft("carrier"), shaft("ring")],
            "stages": [{ "name": "stage", "carrier": "carrier", "planets": 3, "sun": { "shaft": "sun", "teeth": 24 },
                         "planet": { "teeth": 24, "mass_kg": 0.2, "inertia_kg_m2": 1e-4 }, "ring": { "shaft": "ring", "teeth": 72 } }] })
}

/// Planets at multiples of the tooth pitch are equal to the last bit: they strike at one instant, and `--verify` agrees.
#[test]
fn planets_in_phase_are_equal() {
    let train = three_planets("ring", "sun");
    let contacts = spec(&train).contacts;
    for first in [0, 3] {
        for other in 1..3 {
            let (one, two) = (&contacts[first], &contacts[first + other]);
            assert_eq!(one.error, two.error);
            // Ring and carrier, which come first, feel all planets alike.
            assert_eq!(one.direction[..2], two.direction[..2], "{} and {}", one.name, two.name);
        }
    }
    let mut scene = scene(&train, &json!("rest"));
    scene["run"]["verify"] = json!(true);
    let simulation = Simulation::from_scene(Scene::from_json(&scene.to_string(), "planets").unwrap()).unwrap();
    let strikes = simulation.run().unwrap().events.iter().filter(|event| event.contacts.len() == 3).count();
    assert!(strikes > 10, "{strikes}");
}

/// Planets that differ by less than rounding tells apart strike at one instant or at two: `--verify` alarms of neither.
#[test]
fn planets_that_differ_by_rounding_are_no_alarm() {
    for error in [1e-17, 3e-18, 1e-16] {
        let mut train = three_planets("ring", "sun");
        train["stages"][0]["pin_errors_m"] = json!([error, 0, 0]);
        let mut scene = scene(&train, &json!("rest"));
        scene["run"]["verify"] = json!(true);
        let simulation = Simulation::from_scene(Scene::from_json(&scene.to_string(), "planets").unwrap()).unwrap();
        let verified = simulation.run().unwrap().summary.verification.unwrap();
        assert!(verified.series.compared > 10 * verified.series.not_judged, "{verified:?}");
    }
}

/// A stage that its ring drives rests on its back flanks: `"static"` and `"quasi-static"` start there, without a warning.
#[test]
fn starts_on_the_flank_that_the_load_presses() {
    for (drives, fixed, sign) in
        [("sun", "ring", 1.0), ("ring", "sun", -1.0), ("ring", "carrier", -1.0), ("carrier", "ring", -1.0)]
    {
        let train = three_planets(drives, fixed);
        for initial in ["static", "quasi-static"] {
            let built =
                Scene::from_json(&scene(&train, &json!(initial)).to_string(), "planets").unwrap().build().unwrap();
            assert_eq!(built.warnings, [], "{drives} drives, {fixed} is fixed");
            for contact in &built.spec.contacts {
                let error = if initial == "static" { 0.0 } else { contact.error_at(0.0)[0] };
                let deflection = contact.direction.iter().zip(&built.q0).map(|(g, q)| g * q).sum::<f64>() - error;
                assert!(sign * deflection > contact.half_backlash, "{} at {deflection}", contact.name);
            }
        }
    }
}
