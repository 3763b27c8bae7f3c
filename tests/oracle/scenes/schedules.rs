//! Class K: harmonic, rectangular, trapezoidal and switched stiffness.

use serde_json::{Value, json};

use super::{
    laws::{soft, soft_mesh},
    random::{Random, round, scene},
};

/// A stiffness in time, about `mean`, of this period or one of its own.
fn schedule(r: &mut Random, mean: f64, period: f64) -> Value {
    let own = if r.chance(0.5) { period } else { round(period * r.of(0.6, 1.7)) };
    let (high, low) = (round(mean * r.of(1.05, 1.6)), round(mean * r.of(0.3, 0.95)));
    match r.below(4) {
        0 => json!({
            "kind": "harmonic", "mean": mean, "harmonics": [{
                "amplitude": r.of(0.05, 0.4), "frequency_rad_per_s": std::f64::consts::TAU / own, "phase_rad": r.phase(),
            }],
        }),
        1 => json!({
            "kind": "rectangular", "high": high, "low": low, "duty": r.of(0.2, 0.8), "period_s": own,
            "origin_s": round(-own * r.of(0.0, 0.99)),
        }),
        2 => json!({
            "kind": "trapezoidal", "high": high, "low": low, "duty": r.of(0.35, 0.65), "ramp": r.of(0.05, 0.3), "period_s": own,
            "origin_s": round(-own * r.of(0.0, 0.99)),
        }),
        _ => {
            let mut t = 0.0;
            let times: Vec<f64> = (0..12)
                .map(|_| {
                    t = round(t + own * r.of(0.2, 1.5));
                    t
                })
                .collect();
            json!({ "kind": "switched", "levels": [high, low], "times_s": times })
        }
    }
}

pub fn kinds(r: &mut Random) -> Value {
    if r.chance(0.4) { pair(r) } else { mass(r) }
}

fn mass(r: &mut Random) -> Value {
    let omega = r.pick(&[1.0, 2.0]);
    let period = std::f64::consts::TAU / omega;
    let mean = r.log(5.0, 300.0);
    let stiffness = schedule(r, mean, period);
    let train = json!({
        "kind": "matrices", "mass_kg": [r.of(0.5, 2.0)], "damping_n_s_per_m": [r.of(0.0, 0.3)],
        "stiffness_n_per_m": [r.of(0.0, 2.0)], "load_n": [r.of(0.0, 1.5)],
        "load_harmonics": [{ "vector_n": [r.of(0.3, 2.0)], "frequency_rad_per_s": omega, "phase_rad": r.phase() }],
        "contacts": [{
            "name": "stop", "direction": [1], "half_backlash_m": r.of(0.02, 0.3), "law": soft(r, 1.5),
            "stiffness": stiffness, "flanks": r.pick(&["both", "drive"]),
        }],
    });
    scene(train, json!({ "q": [0.0], "v": [r.of(-0.8, 0.8)] }), 45.0)
}

/// A gear pair whose stiffness follows the number of tooth pairs.
fn pair(r: &mut Random) -> Value {
    let (speed, mean) = (r.log(300.0, 3000.0), r.log(5e7, 5e8));
    let stiffness = match r.below(4) {
        0 => json!({ "kind": "tooth-pairs", "mean": mean, "modulation": r.of(0.2, 1.0) }),
        1 => {
            json!({ "kind": "tooth-pairs-trapezoidal", "mean": mean, "modulation": r.of(0.2, 1.0), "ramp": r.of(0.02, 0.2) })
        }
        2 => json!({ "kind": "fourier", "mean": mean, "modulation": r.of(0.2, 1.0), "orders": 1 + r.below(4) }),
        _ => {
            json!({ "kind": "rectangular", "high": round(1.3 * mean), "low": round(0.7 * mean), "duty": r.of(0.3, 0.7) })
        }
    };
    let gap = 5e-5;
    let gear = json!({ "teeth": 50, "mass_kg": 2.8, "inertia_kg_m2": 0.008 });
    let train = json!({
        "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 }, "driving": gear, "driven": gear,
        "mesh": {
            "law": soft_mesh(r), "half_backlash_m": gap, "stiffness": stiffness,
            "error": [{ "order": 1, "amplitude_m": round(gap * r.of(0.05, 0.8)), "phase_rad": r.phase() }],
        },
        "mesh_phase": r.pick(&[0.0, 0.25, 0.61]), "speed_rpm": speed, "torque_nm": r.log(0.5, 60.0),
    });
    let initial = r.pick(&["rest", "static"]);
    scene(train, json!(initial), 12.0 * 60.0 / (50.0 * speed))
}
