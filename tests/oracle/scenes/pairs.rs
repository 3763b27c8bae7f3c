//! Classes B, C and E: gear pairs.

use serde_json::{Value, json};

use super::{
    laws::{EXPONENTS, power, restitution, rigid, soft_mesh},
    masses::power_wall,
    random::{Random, round, scene},
};

/// A pair of equal gears. `law` in words; errors of the given phases; some load or none.
fn pair(r: &mut Random, law: Value, phase: &mut dyn FnMut(&mut Random) -> f64) -> (Value, f64, f64) {
    let teeth = r.pick(&[25, 50]);
    let speed = r.log(200.0, 3000.0);
    let gap = r.pick(&[2e-5, 5e-5]);
    let errors: Vec<Value> = (0..1 + r.below(2))
        .map(|i| {
            let amplitude = round(gap * if i == 0 { r.of(0.15, 1.2) } else { r.of(0.02, 0.3) });
            json!({ "order": i + 1, "amplitude_m": amplitude, "phase_rad": phase(r) })
        })
        .collect();
    let mut mesh = json!({ "law": law, "half_backlash_m": gap, "error": errors });
    if mesh["law"]["kind"] != "rigid" {
        mesh["stiffness"] = json!(r.log(3e7, 6e8));
    }
    let torque = if r.chance(0.4) { 0.0 } else { r.log(0.1, 60.0) };
    let gear = json!({ "teeth": teeth, "mass_kg": 2.8, "inertia_kg_m2": 0.008 });
    let train = json!({
        "kind": "gear-pair", "rack": { "module_m": 0.003, "pressure_angle_deg": 20 }, "driving": gear, "driven": gear,
        "mesh": mesh, "speed_rpm": speed, "torque_nm": torque,
    });
    (train, 60.0 / (speed * f64::from(teeth)), gap)
}

/// A law of pairs: rigid, linear or a power.
fn any(r: &mut Random) -> Value {
    match r.below(3) {
        0 => rigid(restitution(r)),
        1 => soft_mesh(r),
        _ => power(r, &EXPONENTS),
    }
}

/// From rest, with errors of phase 0.
pub fn from_rest(r: &mut Random) -> Value {
    let law = any(r);
    let (train, period, _) = pair(r, law, &mut |_| 0.0);
    scene(train, json!("rest"), 12.0 * period)
}

/// Started on a flank.
pub fn on_flank(r: &mut Random) -> Value {
    let law = any(r);
    let (train, period, gap) = pair(r, law, &mut |_| 0.0);
    let speed = gap / period * r.of(0.1, 4.0);
    let side = r.sign();
    let v = if r.chance(0.7) { -side * speed } else { 0.0 };
    let still = v == 0.0 && train["mesh"]["law"]["kind"] == "power";
    let v = if still { -side * speed } else { v };
    scene(train, json!({ "q": [side * gap, 0.0], "v": [round(v), 0.0] }), 12.0 * period)
}

/// Soft pairs with any phases.
pub fn soft_pairs(r: &mut Random) -> Value {
    let law = soft_mesh(r);
    let (train, period, _) = pair(r, law, &mut |r| r.phase());
    scene(train, json!("rest"), 12.0 * period)
}

/// Power laws.
pub fn powers(r: &mut Random) -> Value {
    if r.chance(0.4) {
        return power_wall(r);
    }
    let law = power(r, &EXPONENTS);
    let (train, period, _) = pair(r, law, &mut |r| r.phase());
    scene(train, json!("rest"), 12.0 * period)
}
