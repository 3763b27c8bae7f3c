//! Classes F and G: torsional planetary stages.

use serde_json::{Value, json};

use super::{
    laws::{rigid, soft_mesh},
    random::{Random, round, scene},
};

/// Rigid meshes, planets in phase or not.
pub fn rigid_stages(r: &mut Random) -> Value {
    let law = rigid(if r.chance(0.3) { 0.0 } else { r.of(0.1, 0.9) });
    stage(r, law)
}

/// Kelvin-Voigt meshes.
pub fn soft_stages(r: &mut Random) -> Value {
    let law = soft_mesh(r);
    stage(r, law)
}

/// Soft meshes, all planets in phase: events come together.
pub fn symmetric(r: &mut Random) -> Value {
    let law = soft_mesh(r);
    let mut scene = stage(r, law);
    scene["train"]["phases"] = json!("in-phase");
    scene["initial"] = json!("rest");
    scene
}

fn stage(r: &mut Random, law: Value) -> Value {
    let is_rigid = law["kind"] == "rigid";
    let planets = 3 + r.below(2);
    let speed = r.log(200.0, 3000.0);
    let gap = r.pick(&[2e-5, 5e-5]);
    let mesh = |r: &mut Random| {
        let errors: Vec<Value> = (0..1 + r.below(2))
            .map(|i| {
                let amplitude = round(gap * if i == 0 { r.of(0.2, 0.75) } else { r.of(0.05, 0.2) });
                json!({ "order": i + 1, "amplitude_m": amplitude, "phase_rad": r.phase() })
            })
            .collect();
        let mut mesh = json!({ "law": law.clone(), "half_backlash_m": gap, "error": errors });
        if !is_rigid {
            mesh["stiffness"] = match r.below(2) {
                0 => json!(r.log(1e8, 6e8)),
                _ => json!({
                    "kind": "harmonic", "mean": r.log(1e8, 6e8),
                    "harmonics": [{ "order": 1, "amplitude": r.of(0.05, 0.3), "phase_rad": r.phase() }],
                }),
            };
        }
        mesh
    };
    let (sun_mesh, ring_mesh) = (mesh(r), mesh(r));
    let spring = |r: &mut Random, low: f64, high: f64| json!({ "stiffness_n_per_m": r.log(low, high), "damping_ratio": r.pick(&[0.02, 0.05, 0.1]) });
    let phases = match r.below(3) {
        0 => json!("in-phase"),
        1 => {
            let ring = r.of(0.0, 1.0);
            json!({ "sun": vec![0.0; planets], "ring": vec![ring; planets] })
        }
        _ => {
            let any = |r: &mut Random| (0..planets).map(|_| r.of(0.0, 1.0)).collect::<Vec<_>>();
            json!({ "sun": any(r), "ring": any(r) })
        }
    };
    let torque = if r.chance(0.3) { 0.0 } else { r.log(0.2, 50.0) };
    let train = json!({
        "kind": "planetary", "freedoms": "torsional", "speed_rpm": speed, "load": { "output_torque_nm": torque },
        "teeth": { "sun": 30, "planet": 30, "ring": 90 }, "planets": planets,
        "sun_pressure_angle_rad": 0.35, "ring_pressure_angle_rad": 0.35, "phases": phases,
        "sun": { "mass_kg": 1.2, "rotary_mass_kg": 0.8, "radius_m": 0.042, "rotation": spring(r, 1e4, 2e6) },
        "planet": { "mass_kg": 1.2, "rotary_mass_kg": 0.75, "radius_m": 0.042 },
        "ring": { "mass_kg": 4, "rotary_mass_kg": 3.0, "radius_m": 0.127, "rotation": spring(r, 1e4, 1e9) },
        "carrier": { "mass_kg": 5, "rotary_mass_kg": 6.0, "radius_m": 0.09, "rotation": spring(r, 1e4, 1e9) },
        "sun_mesh": sun_mesh, "ring_mesh": ring_mesh,
    });
    // Sun and carrier speeds of the mesh: 30 teeth of 120 with the ring held.
    let period = 60.0 / (speed * 22.5);
    let initial = if r.chance(0.7) {
        json!("rest")
    } else {
        let v = gap / period;
        let planet = round(v * r.of(-1.0, 1.0));
        let mut all = vec![round(v * r.of(-2.0, 2.0))];
        all.extend(vec![planet; planets]);
        all.extend([round(v * r.of(-1.0, 1.0)), round(v * r.of(-1.0, 1.0))]);
        json!({ "q": vec![0.0; planets + 3], "v": all })
    };
    scene(train, initial, 6.0 * period)
}
