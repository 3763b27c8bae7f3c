//! Scenes whose motion has a derivative: every law, every kind of event. No two numbers of a scene are equal by chance, as the oracle
//! moves a number of the train by its value.

use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::laws::rigid;

/// A forcing, where the motion starts, and for how many cycles it goes on.
pub struct Drive {
    pub omega: f64,
    /// Amplitude of the error of all contacts, and its frequency over that of the forcing.
    pub error: f64,
    pub order: f64,
    pub q: [f64; 2],
    pub v: [f64; 2],
    pub cycles: u64,
    /// A load in steps and ramps acts too.
    pub has_schedule: bool,
}

/// Slow and fast forcings, flanks that rest and that move. The fifth one starts inside the flank, the last one has a load in steps and ramps.
pub const DRIVES: [Drive; 6] = [
    Drive { omega: 0.6, error: 0.0, order: 1.0, q: [0.1, 0.2], v: [0.0, 0.0], cycles: 1, has_schedule: false },
    Drive { omega: 0.9, error: 0.0, order: 1.0, q: [-0.2, 0.1], v: [0.07, -0.12], cycles: 2, has_schedule: false },
    Drive { omega: 0.35, error: 0.021, order: 8.0, q: [0.0, 0.0], v: [0.0, 0.0], cycles: 1, has_schedule: false },
    Drive { omega: 1.4, error: 0.053, order: 1.0, q: [0.2, 0.0], v: [0.0, 0.0], cycles: 2, has_schedule: false },
    Drive { omega: 0.4, error: 0.037, order: 8.0, q: [0.64, 0.03], v: [0.06, 0.0], cycles: 1, has_schedule: false },
    Drive { omega: 0.8, error: 0.0, order: 1.0, q: [0.14, -0.09], v: [0.06, 0.03], cycles: 2, has_schedule: true },
];

/// Two masses with a coupling, the first one driven.
pub fn scene(contacts: &[Value], drive: &Drive) -> Value {
    let omega = drive.omega;
    let mut contacts = contacts.to_vec();
    for (i, contact) in contacts.iter_mut().enumerate().filter(|_| drive.error != 0.0) {
        contact["error"] = json!([{
            "amplitude_m": drive.error + 0.004 * i as f64, "frequency_rad_per_s": drive.order * omega,
            "phase_rad": 0.41 + i as f64,
        }]);
    }
    for contact in &mut contacts {
        let schedule = &mut contact["stiffness"];
        if schedule["period_s"].is_number() {
            schedule["period_s"] = json!(TAU / omega);
        }
        if schedule["harmonics"].is_array() {
            schedule["harmonics"][0]["frequency_rad_per_s"] = json!(2.0 * omega);
        }
        if schedule.is_null() {
            contact.as_object_mut().map(|c| c.remove("stiffness"));
        }
    }
    // No start lies inside a rigid flank.
    let q = if contacts[0]["law"]["kind"] == "rigid" { drive.q.map(|q| 0.5 * q) } else { drive.q };
    let period = TAU / omega;
    let ramps = json!([[0.0, 0.0], [0.2213, 1.713], [0.6137, -0.773], [1.0, 0.0]]);
    let steps = json!([[0.0, 0.8713], [0.3719, -1.1317], [0.7211, 0.5623]]);
    let loads = json!([
        { "vector_n": [0.4317, 0.1913], "period_s": period, "points": ramps, "place": "period" },
        { "vector_n": [0.3727, 0.2119], "period_s": period, "points": steps, "place": "period", "through": "steps" },
    ]);
    json!({
        "flank": 1,
        "train": {
            "load_schedules": if drive.has_schedule { loads } else { json!([]) },
            "kind": "matrices", "mass_kg": [[1.03, 0.11], [0.11, 1.47]],
            "damping_n_s_per_m": [[0.083, -0.031], [-0.031, 0.052]],
            "stiffness_n_per_m": [[0.61, -0.42], [-0.42, 0.54]],
            "load_n": [0.26, 0.047],
            "load_harmonics": [{ "vector_n": [0.91, 0.13], "frequency_rad_per_s": omega, "phase_rad": 0.29 }],
            "contacts": contacts,
        },
        "initial": { "q": q, "v": drive.v },
        "run": { "cycles": 10, "period_s": TAU / omega },
    })
}

fn kelvin(damping: f64, release: &str) -> Value {
    json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": damping, "release": release })
}

fn power(exponent: &str, hysteresis: f64) -> Value {
    power_above(1e-6, exponent, hysteresis)
}

/// A power law that latches no speed below `floor`.
fn power_above(floor: f64, exponent: &str, hysteresis: f64) -> Value {
    json!({
        "kind": "power", "exponent": exponent, "hysteresis_coefficient": hysteresis, "speed_floor_m_per_s": floor,
        "initial_speed_m_per_s": 0.17,
    })
}

/// At the first mass.
fn first(law: Value, stiffness: Value, flanks: &str) -> Value {
    json!({ "direction": [1.02, -0.33], "half_backlash_m": 0.51, "stiffness": stiffness, "flanks": flanks, "law": law })
}

/// The same with a back flank of its own, and a damper in the gap.
fn differ(mut contact: Value, stiffness: Value, damping: f64) -> Value {
    contact["back_flank"] = json!({ "error_offset_m": 0.029 });
    if !stiffness.is_null() {
        contact["back_flank"]["stiffness"] = stiffness;
    }
    contact["gap_damping_n_s_per_m"] = json!(damping);
    contact
}

/// At the second mass.
fn second(law: Value, stiffness: Value) -> Value {
    let gap = if law["kind"] == "bilateral" { 0.0 } else { 0.28 };
    json!({ "direction": [0.19, 0.97], "half_backlash_m": gap, "stiffness": stiffness, "flanks": "both", "law": law })
}

/// Contacts of every law, release and kind of stiffness.
pub fn laws() -> Vec<(&'static str, Vec<Value>)> {
    let harmonic = json!({ "kind": "harmonic", "mean": 6.1, "harmonics": [{ "amplitude": 0.31, "phase_rad": 0.23 }] });
    let rectangle =
        json!({ "kind": "rectangular", "high": 8.2, "low": 4.3, "duty": 0.57, "period_s": 1.0, "origin_s": 0.12 });
    let trapezoid = json!({
        "kind": "trapezoidal", "high": 8.2, "low": 4.3, "duty": 0.57, "ramp": 0.14, "period_s": 1.0, "origin_s": 0.12,
    });
    let points = json!([[0.0213, 0.937], [0.823, 0.613], [5.31, 0.347]]);
    let returns = json!({ "kind": "rigid", "restitution": { "kind": "table", "points": points } });
    vec![
        ("soft, by deflection", vec![first(kelvin(0.71, "deflection"), json!(6.2), "both")]),
        ("soft, by force", vec![first(kelvin(0.72, "force"), json!(6.2), "both")]),
        ("overdamped, by force", vec![first(kelvin(9.1, "force"), json!(3.1), "both")]),
        ("stiff, overdamped, by force", vec![first(kelvin(12.3, "force"), json!(31.0), "both")]),
        ("harmonic stiffness", vec![first(kelvin(0.43, "force"), harmonic, "both")]),
        ("rectangular stiffness", vec![first(kelvin(0.44, "deflection"), rectangle, "drive")]),
        ("trapezoidal stiffness", vec![first(kelvin(0.45, "force"), trapezoid, "both")]),
        ("power 3/2", vec![first(power("3/2", 0.0), json!(9.2), "both")]),
        ("power 3/2, hysteresis", vec![first(power("3/2", 0.63), json!(9.2), "both")]),
        ("power 10/9, hysteresis", vec![first(power("10/9", 0.49), json!(9.3), "drive")]),
        ("power 2, hysteresis", vec![first(power("2", 1.23), json!(9.4), "both")]),
        ("power 3/2, latched at the floor", vec![first(power_above(2.1, "3/2", 1.9), json!(9.5), "both")]),
        ("rigid", vec![first(rigid(0.62), Value::Null, "both")]),
        ("soft, flanks that differ", vec![differ(first(kelvin(0.64, "force"), json!(6.3), "both"), json!(4.9), 0.0)]),
        ("power 3/2, flanks that differ", vec![differ(first(power("3/2", 0.57), json!(9.6), "both"), json!(7.7), 0.0)]),
        ("rigid, flanks that differ", vec![differ(first(rigid(0.67), Value::Null, "both"), Value::Null, 0.0437)]),
        ("returns by speed", vec![first(returns, Value::Null, "both")]),
        ("lands and is released", vec![first(rigid(0.0), Value::Null, "drive")]),
        ("bounces to rest", vec![first(rigid(0.27), Value::Null, "drive")]),
        (
            "soft and power",
            vec![first(kelvin(0.53, "deflection"), json!(5.2), "drive"), second(power("3/2", 0.39), json!(7.1))],
        ),
        (
            "rigid and bilateral",
            vec![
                first(rigid(0.58), Value::Null, "both"),
                second(json!({ "kind": "bilateral", "damping_n_s_per_m": 0.21 }), json!(2.3)),
            ],
        ),
        ("rigid and soft", vec![first(rigid(0.69), Value::Null, "drive"), second(kelvin(0.34, "force"), json!(4.1))]),
    ]
}
