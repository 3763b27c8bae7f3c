//! Published stages as scenes: each preset written out in the keys of a planetary train.

use serde_json::{Map, Value, json};

use crate::{
    gear::contact::{Hysteresis, Law, coefficient},
    train::{
        Body, Damping, Flanks, Mesh, Support, TrainError, mesh_damping,
        planetary::presets::{self, ReferenceDamping, ReferenceStiffness},
    },
};

/// Names of the presets.
pub(super) const NAMES: [&str; 5] =
    ["reference-light", "reference-heavy", "reference-float", "exact-frequencies", "lin-parker"];

/// Restitution from which the light-load presets compute their hysteresis.
const LIGHT_RESTITUTION: f64 = 0.743;

/// Keys that say the same thing in two ways: one that is written replaces the preset's other one.
const ALTERNATIVES: [&[&str]; 8] = [
    &["damping_n_s_per_m", "damping_ratio"],
    &["inertia_kg_m2", "rotary_mass_kg"],
    &["half_backlash_m", "total_backlash_m"],
    &["hysteresis", "hysteresis_coefficient"],
    &["restitution", "hysteresis_coefficient"],
    &["planets", "positions_rad", "positions_deg"],
    &["sun_pressure_angle_rad", "sun_pressure_angle_deg"],
    &["ring_pressure_angle_rad", "ring_pressure_angle_deg"],
];

/// A scene with its preset, if it names one, replaced by what the preset stands for.
pub(super) fn expand(scene: &Value) -> Value {
    let mut scene = scene.clone();
    let Some(train) = scene.get_mut("train").and_then(Value::as_object_mut) else { return scene };
    if train.get("kind").and_then(Value::as_str) != Some("planetary") {
        return scene;
    }
    let Some(name) = train.get("preset").filter(|name| !name.is_null()).cloned() else { return scene };
    let known = name.as_str().filter(|name| NAMES.contains(name));
    if known.is_some() {
        train.remove("preset");
    }
    // A preset that does not exist is one fault, not one for each key it would have brought.
    if let Ok(Value::Object(mut base)) = written_out(known.unwrap_or(NAMES[0])) {
        overlay(&mut base, train);
        *train = base;
    }
    scene
}

/// Writes `top` over `base`.
fn overlay(base: &mut Map<String, Value>, top: &Map<String, Value>) {
    for (key, value) in top {
        for group in ALTERNATIVES.iter().filter(|group| group.contains(&key.as_str())) {
            group.iter().filter(|other| *other != key).for_each(|other| {
                base.remove(*other);
            });
        }
        match (base.get_mut(key), value) {
            (Some(Value::Object(below)), Value::Object(above))
                if above.get("kind").is_none_or(|kind| below.get("kind") == Some(kind)) =>
            {
                overlay(below, above);
            }
            _ => {
                base.insert(key.clone(), value.clone());
            }
        }
    }
}

fn written_out(name: &str) -> Result<Value, TrainError> {
    let (stage, freedoms, phases) = match name {
        "reference-heavy" => (presets::reference_heavy(500.0, 500.0)?, "full", "in-phase"),
        "reference-float" => (presets::reference_float(500.0, 0.0)?, "full", "teeth"),
        "exact-frequencies" => {
            let (stiffness, damping) = (ReferenceStiffness::EXACT_FREQUENCIES, ReferenceDamping::DEFAULT);
            (presets::reference(&stiffness, &damping)?, "full", "in-phase")
        }
        "lin-parker" => (presets::lin_parker(3), "full-carrier", "in-phase"),
        _ => (presets::reference_light(500.0, 0.0)?, "full", "in-phase"),
    };
    let planet = &stage.planets[0];
    Ok(json!({
        "kind": "planetary",
        "freedoms": freedoms,
        "speed_rpm": stage.rpm,
        "load": {
            "output_torque_nm": stage.load.output_torque,
            "drag_torque_nm": stage.load.drag,
            "drag_torque_nm_per_rpm": stage.load.drag_per_rpm,
            "planet_drag_n": stage.load.planet_drag,
        },
        "teeth": { "sun": stage.teeth.sun, "planet": stage.teeth.planet, "ring": stage.teeth.ring },
        "sun_pressure_angle_rad": stage.sun_pressure_angle,
        "ring_pressure_angle_rad": stage.ring_pressure_angle,
        "ring_phase": stage.ring_phase,
        "planets": stage.planets.len(),
        "phases": phases,
        "sun": body(&stage.sun),
        "planet": body(&planet.body),
        "ring": body(&stage.ring),
        "carrier": body(&stage.carrier),
        "sun_mesh": mesh(&planet.sun_mesh, [&stage.sun, &planet.body]),
        "ring_mesh": mesh(&planet.ring_mesh, [&planet.body, &stage.ring]),
        "gyroscopic": stage.gyroscopic,
        "strict": stage.strict,
    }))
}

fn body(body: &Body) -> Value {
    json!({
        "mass_kg": body.mass,
        "rotary_mass_kg": body.rotary_mass,
        "radius_m": body.radius,
        "outer_radius_m": body.outer_radius,
        "translation": support(&body.translation),
        "rotation": support(&body.rotation),
    })
}

fn support(support: &Support) -> Value {
    match support.damping {
        Damping::Ratio(ratio) => json!({ "stiffness_n_per_m": support.stiffness, "damping_ratio": ratio }),
        Damping::Viscous(c) => json!({ "stiffness_n_per_m": support.stiffness, "damping_n_s_per_m": c }),
    }
}

fn mesh(mesh: &Mesh, gears: [&Body; 2]) -> Value {
    let (stiffness, ratio) = (mesh.stiffness.mean(), ReferenceDamping::DEFAULT.mesh);
    let damping = mesh_damping(stiffness, ratio, gears.map(|gear| gear.rotary_mass));
    let error: Vec<Value> = mesh
        .error
        .iter()
        .map(|h| json!({ "order": h.order, "amplitude_m": h.amplitude, "phase_rad": h.phase }))
        .collect();
    let mut written = json!({
        "law": law(&mesh.law, (ratio, damping)),
        "flanks": if mesh.flanks == Flanks::Drive { "drive" } else { "both" },
        // Presets have constant meshes: their excitation is the error.
        "stiffness": stiffness,
        "error": error,
        "error_offset_m": mesh.error_offset,
    });
    if !matches!(mesh.law, Law::Bilateral(_)) {
        written["half_backlash_m"] = json!(mesh.half_backlash);
    }
    written
}

/// A law in the terms a user would change: a ratio or a restitution where the preset has computed from one.
fn law(law: &Law, (ratio, damping): (f64, f64)) -> Value {
    match law {
        Law::Bilateral(linear) if linear.damping == damping => json!({ "kind": "bilateral", "damping_ratio": ratio }),
        Law::Bilateral(linear) => json!({ "kind": "bilateral", "damping_n_s_per_m": linear.damping }),
        Law::KelvinVoigt(linear, _) => json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": linear.damping }),
        Law::Power(power) => {
            let mut written = json!({
                "kind": "power",
                "exponent": power.exponent.value(),
                "speed_floor_m_per_s": power.speed_floor,
                "initial_speed_m_per_s": power.initial_speed,
            });
            if power.hysteresis == coefficient(Hysteresis::LankaraniNikravesh, LIGHT_RESTITUTION) {
                written["hysteresis"] = json!("lankarani-nikravesh");
                written["restitution"] = json!(LIGHT_RESTITUTION);
            } else {
                written["hysteresis_coefficient"] = json!(power.hysteresis);
            }
            written
        }
        Law::Rigid(rigid) => json!({ "kind": "rigid", "restitution": rigid.restitution }),
    }
}
