//! Classes I, L, N, P and Q: what has a cause of its own.

use serde_json::{Value, json};

use super::{
    laws::{power, restitution, rigid, soft},
    masses,
    random::{Random, round, scene},
};

/// A nearly singular mass matrix beside an open contact, or a stiff power law.
pub fn cost(r: &mut Random) -> Value {
    if r.chance(0.5) {
        return stiff(r);
    }
    let near = 1.0 - r.log(1e-8, 1e-3);
    let near = if near < 1.0 { near } else { 0.999 };
    let train = json!({
        "kind": "matrices", "mass_kg": [[1.0, near], [near, 1.0]], "stiffness_n_per_m": [[1.0, 1.0], [1.0, 1.0]],
        "damping_n_s_per_m": [[0.1, 0.1], [0.1, 0.1]], "load_n": [1.0, 1.0],
        "load_harmonics": [{ "vector_n": [1.5, 1.5], "frequency_rad_per_s": 1.0, "phase_rad": r.phase() }],
        "contacts": [
            { "name": "mesh", "direction": [1, -1], "half_backlash_m": 50.0, "law": soft(r, 0.5), "stiffness": 1e4 },
            { "name": "stop", "direction": [1, 1], "half_backlash_m": r.of(0.1, 0.6), "flanks": "drive",
              "law": soft(r, 0.5), "stiffness": r.log(5.0, 100.0) },
        ],
    });
    scene(train, json!("rest"), 40.0)
}

/// Two power laws with different exponents.
pub fn two_exponents(r: &mut Random) -> Value {
    let exponents = ["3/2", "4/3", "10/9", "2", "5/2", "5/4"];
    let a = r.below(exponents.len());
    let b = (a + 1 + r.below(exponents.len() - 1)) % exponents.len();
    let contact = |r: &mut Random, name: &str, direction: [f64; 2], exponent: &str| {
        json!({
            "name": name, "direction": direction, "half_backlash_m": r.of(0.03, 0.3), "flanks": "drive",
            "stiffness": r.log(30.0, 800.0), "law": power(r, &[exponent]),
        })
    };
    let coupling = r.of(0.2, 0.8);
    let contacts = [contact(r, "a", [1.0, 0.0], exponents[a]), contact(r, "b", [0.0, 1.0], exponents[b])];
    let train = json!({
        "kind": "matrices", "mass_kg": [r.of(0.6, 1.6), r.of(0.6, 1.6)],
        "stiffness_n_per_m": [[1.0, -coupling], [-coupling, 2.0]], "damping_n_s_per_m": [0.05, 0.05],
        "load_n": [r.of(0.2, 1.0), r.of(0.2, 1.0)],
        "load_harmonics": [{ "vector_n": [r.of(0.3, 1.2), r.of(0.3, 1.2)], "frequency_rad_per_s": 1.0, "phase_rad": r.phase() }],
        "contacts": contacts,
    });
    scene(train, json!({ "q": [0.0, 0.0], "v": [r.of(-0.5, 0.5), r.of(-0.5, 0.5)] }), 25.0)
}

/// Inside a flank, pulling or pressed; on a switch; on a flank.
pub fn starts(r: &mut Random) -> Value {
    let omega = r.pick(&[0.5, 1.0]);
    let law = match r.below(3) {
        0 => power(r, &["3/2", "4/3", "5/4"]),
        _ => soft(r, 3.0),
    };
    let is_power = law["kind"] == "power";
    let stiffness = match r.below(3) {
        0 if !is_power => {
            // A switch falls on the start.
            json!({ "kind": "rectangular", "high": r.of(4.0, 8.0), "low": r.of(10.0, 20.0), "duty": 0.5, "period_s": 4.0 })
        }
        _ => json!(r.log(10.0, 200.0)),
    };
    let train = json!({
        "kind": "matrices", "mass_kg": [1.0], "load_n": [r.of(0.1, 1.0)],
        "load_harmonics": [{ "vector_n": [r.of(0.1, 0.6)], "frequency_rad_per_s": omega, "phase_rad": r.phase() }],
        "contacts": [{
            "name": "wall", "direction": [1], "half_backlash_m": 0.0, "flanks": "drive", "stiffness": stiffness, "law": law,
        }],
    });
    let (q, v) = match r.below(3) {
        0 => (0.125, -r.of(0.2, 3.0)),
        1 => (r.of(0.01, 0.3), r.of(-2.0, 2.0)),
        _ => (0.0, r.sign() * r.of(0.1, 1.5)),
    };
    scene(train, json!({ "q": [q], "v": [v] }), 20.0)
}

/// Sines and cosines as phases of loads, errors and stiffness, on one and two masses.
pub fn phases(r: &mut Random) -> Value {
    let quarter = |r: &mut Random| r.pick(&[0.0, 0.5, 1.0, 1.5]) * std::f64::consts::PI;
    let n = 1 + r.below(3);
    let law = match r.below(3) {
        0 => rigid(restitution(r)),
        1 => power(r, &["3/2", "5/4"]),
        _ => soft(r, 1.0),
    };
    let contacts: Vec<Value> = (0..n)
        .map(|i| {
            let direction: Vec<f64> = (0..n)
                .map(|j| {
                    if j == i {
                        1.0
                    } else if j + 1 == i {
                        -1.0
                    } else {
                        0.0
                    }
                })
                .collect();
            let mut c = json!({
                "name": format!("c{i}"), "direction": direction, "half_backlash_m": 0.5, "law": law.clone(),
                "error": [{ "amplitude_m": r.of(0.02, 0.4), "frequency_rad_per_s": 1.0, "phase_rad": quarter(r) }],
            });
            if law["kind"] != "rigid" {
                let k = r.log(20.0, 400.0);
                let varies = law["kind"] != "power" && r.chance(0.5);
                c["stiffness"] = if varies {
                    json!({ "kind": "harmonic", "mean": k, "harmonics": [{
                        "amplitude": 0.2, "frequency_rad_per_s": 2.0, "phase_rad": quarter(r) }] })
                } else {
                    json!(k)
                };
            }
            c
        })
        .collect();
    let load: Vec<f64> = (0..n).map(|i| if i == 0 { r.of(0.1, 1.0) } else { 0.0 }).collect();
    let loads: Vec<Value> = if r.chance(0.6) {
        let vector: Vec<f64> = (0..n).map(|_| r.of(0.0, 1.0)).collect();
        vec![json!({ "vector_n": vector, "frequency_rad_per_s": r.pick(&[1.0, 3.0]), "phase_rad": quarter(r) })]
    } else {
        vec![]
    };
    let zero = r.chance(0.3);
    let train = json!({
        "kind": "matrices", "mass_kg": (0..n).map(|_| r.of(0.5, 2.0)).collect::<Vec<_>>(),
        "load_n": if zero { vec![0.0; n] } else { load }, "load_harmonics": loads, "contacts": contacts,
        "base_frequency_rad_per_s": 1.0,
    });
    scene(train, json!("rest"), 30.0)
}

/// Strong dampers that let go inside the flank's zone, and are caught again.
pub fn detached(r: &mut Random) -> Value {
    if r.chance(0.3) {
        let mut scene = masses::power_wall(r);
        scene["train"]["law"] = json!({ "kind": "power", "exponent": "3/2", "hysteresis_coefficient": r.of(1.2, 6.0), "speed_floor_m_per_s": 0.02 });
        return scene;
    }
    let train = json!({
        "kind": "matrices", "mass_kg": [r.of(0.5, 2.0)], "stiffness_n_per_m": [r.of(0.0, 2.0)],
        "load_n": [r.of(0.0, 1.0)],
        "load_harmonics": [
            { "vector_n": [r.of(0.5, 2.0)], "frequency_rad_per_s": 1.0, "phase_rad": r.phase() },
            { "vector_n": [r.of(0.5, 3.0)], "frequency_rad_per_s": (3 + r.below(5)) as f64, "phase_rad": r.phase() },
        ],
        "contacts": [{
            "name": "damper", "direction": [1], "half_backlash_m": round(r.of(0.02, 0.2)), "stiffness": r.log(2.0, 40.0),
            "flanks": r.pick(&["both", "drive"]),
            "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": r.of(1.0, 12.0), "release": "force" },
        }],
    });
    scene(train, json!({ "q": [0.0], "v": [r.of(-0.5, 0.5)] }), 30.0)
}

/// Written as the note of a scene in which nothing may happen: stiff, and always pressed.
pub const PRESSED: &str = "pressed at all times: no event";

/// A stiff power law pressed by a slow load, from equilibrium.
fn stiff(r: &mut Random) -> Value {
    let load = r.of(100.0, 900.0);
    let law = json!({ "kind": "power", "exponent": "3/2", "hysteresis": r.pick(&["flores", "exact"]), "restitution": r.of(0.3, 0.9) });
    let train = json!({
        "kind": "wall", "mass_kg": r.of(0.2, 1.0), "load_n": load,
        "load_harmonics": [{
            "amplitude_n": round(load * r.of(0.1, 0.5)), "frequency_rad_per_s": 1.0, "phase_rad": std::f64::consts::FRAC_PI_2,
        }],
        "wall": { "side": "above", "position_m": 0 }, "law": law, "contact_stiffness": r.log(1e8, 1e10),
    });
    let mut scene = scene(train, json!("static"), 50.0);
    scene["note"] = json!(PRESSED);
    scene
}

/// Undamped motion without forcing: it repeats.
pub fn periodic(r: &mut Random) -> Value {
    match r.below(3) {
        0 => json!({
            "flank": 1,
            "train": { "kind": "gear-pair-dimensionless", "damping_ratio": 0.0, "damping_in_gap": true, "mean_load": if r.chance(0.5) { 0.0 } else { r.of(0.05, 0.3) } },
            "initial": { "q": [r.of(-0.5, 0.5)], "v": [r.of(0.8, 2.0)] }, "run": { "t_end": 10.0 },
        }),
        1 => {
            let train = json!({
                "kind": "wall", "mass_kg": r.of(0.5, 2.0), "load_n": r.of(0.5, 3.0), "stiffness_n_per_m": r.of(0.0, 1.0),
                "wall": { "side": "above", "position_m": 0.0 }, "law": rigid(1.0),
            });
            scene(train, json!({ "q": [-r.of(0.3, 1.5)], "v": [r.of(-0.5, 0.5)] }), 10.0)
        }
        _ => {
            let train = json!({
                "kind": "wall", "mass_kg": r.of(0.5, 2.0), "wall": { "side": "both", "half_gap_m": 0.5 },
                "law": { "kind": "kelvin-voigt", "release": "deflection" }, "contact_stiffness": r.log(1.0, 100.0),
            });
            scene(train, json!({ "q": [r.of(-0.3, 0.3)], "v": [r.of(0.3, 2.0)] }), 10.0)
        }
    }
}
