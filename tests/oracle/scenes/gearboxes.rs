//! Class Y: gearboxes of two to five shafts, spur and helical, with loose gears, orders, couplings and planetary stages.

use serde_json::{Value, json};

use super::{
    laws::soft_mesh,
    random::{Random, round, scene},
};

/// Teeth of a module, the mass of about a disc of steel, and now and then a runout.
fn gear(r: &mut Random, name: &str, teeth: usize, (module, width): (f64, f64)) -> Value {
    let radius = 0.5 * module * teeth as f64;
    let mass = round(7850.0 * std::f64::consts::PI * radius * radius * width * r.of(0.4, 1.5));
    let inertia = round(mass * (radius * r.of(0.4, 0.9)).powi(2));
    let runout = if r.chance(0.3) { r.log(2e-6, 4e-5) } else { 0.0 };
    json!({ "name": name, "teeth": teeth, "inertia_kg_m2": inertia, "mass_kg": mass, "face_width_m": width,
            "runout_m": runout, "runout_deg": r.of(0.0, 360.0) })
}

fn stiffness(r: &mut Random) -> Value {
    let mean = r.log(1e8, 6e8);
    match r.below(3) {
        0 => json!(mean),
        1 => json!({ "kind": "tooth-pairs", "mean": mean, "modulation": r.of(0.2, 1.0) }),
        _ => json!({ "kind": "harmonic", "mean": mean, "harmonics": [
            { "order": 1, "amplitude": r.of(0.05, 0.3), "phase_rad": r.phase() }] }),
    }
}

fn orders(r: &mut Random, key: &str, low: f64, high: f64) -> Value {
    let count = 1 + r.below(3);
    let of = |r: &mut Random| json!({ "order": r.pick(&[0.5, 1.0, 1.5, 2.0, 4.0]), key: r.log(low, high), "phase_rad": r.phase() });
    (0..count).map(|_| of(r)).collect()
}

/// Sun, planet and ring, and a number of planets that can be put in.
fn stage(r: &mut Random, sun_shaft: &str, module: f64) -> Value {
    let planets = r.pick(&[3, 4]);
    let (sun, planet) = loop {
        let (sun, planet) = (20 + r.below(20), 18 + r.below(12));
        if 2 * (sun + planet) % planets == 0 {
            break (sun, planet);
        }
    };
    let mut own = |teeth: usize, shaft: Option<&str>| {
        let mut gear = gear(r, "", teeth, (module, 0.02));
        let keys = gear.as_object_mut();
        keys.into_iter().for_each(|keys| drop(keys.remove("name")));
        if let Some(shaft) = shaft {
            gear["shaft"] = json!(shaft);
        }
        gear
    };
    let (sun, mut planet, ring) =
        (own(sun, Some(sun_shaft)), own(planet, None), own(sun + 2 * planet, Some("housing")));
    if r.chance(0.5) {
        planet["translation"] = json!({ "stiffness_n_per_m": r.log(1e8, 8e8), "damping_ratio": 0.03 });
    }
    json!({ "name": "stage", "carrier": "carrier", "planets": planets, "sun": sun, "planet": planet, "ring": ring,
            "sun_mesh": { "stiffness": stiffness(r) }, "ring_mesh": { "stiffness": stiffness(r) } })
}

pub fn gearboxes(r: &mut Random) -> Value {
    let (count, helix) = (2 + r.below(4), if r.chance(0.5) { r.of(8.0, 28.0) } else { 0.0 });
    let module = r.pick(&[0.0015, 0.002, 0.003]);
    let is_driven = r.chance(0.3);
    let speed = r.log(300.0, 3000.0) * r.sign();
    let mut shafts: Vec<Value> = (0..count).map(|i| json!({ "name": format!("s{i}"), "gears": [] })).collect();
    let (mut meshes, mut couplings) = (Vec::new(), Vec::new());
    let push = |shaft: &mut Value, gear: Value| {
        shaft["gears"].as_array_mut().into_iter().for_each(|gears| gears.push(gear.clone()))
    };
    for i in 1..count {
        if i > 1 && r.chance(0.2) {
            couplings.push(json!({ "shafts": [format!("s{}", i - 1), format!("s{i}")],
                "rotation": { "stiffness_nm_per_rad": r.log(1e3, 1e5), "damping_ratio": r.of(0.0, 0.1) } }));
            shafts[i]["inertia_kg_m2"] = json!(r.log(1e-3, 2e-2));
            continue;
        }
        let (a, b, width) = (20 + r.below(30), 20 + r.below(40), r.of(0.01, 0.04));
        // Gears between the same shafts have the same sum of teeth.
        let pairs = 1 + r.below(2);
        let angle = r.of(-180.0, 180.0);
        for k in 0..pairs {
            let [one, two] = [format!("a{i}{k}"), format!("b{i}{k}")];
            let (driving, mut driven) =
                (gear(r, &one, a + 3 * k, (module, width)), gear(r, &two, b - 3 * k, (module, width)));
            if k > 0 {
                driven["loose"] = json!(true);
                driven["drag"] = json!({ "torque_nm": r.log(0.02, 0.5), "torque_nm_s_per_rad": r.pick(&[0.0, 1e-4]) });
            }
            push(&mut shafts[i - 1], driving);
            push(&mut shafts[i], driven);
            let errors = json!([{ "order": 1, "amplitude_m": r.log(1e-6, 3e-5), "phase_rad": r.phase() }]);
            meshes.push(json!({ "gears": [one, two], "angle_deg": angle, "error": errors, "stiffness": stiffness(r) }));
        }
    }
    let load = r.log(0.5, 60.0);
    shafts[0]["speed_rpm"] = json!(round(speed));
    if is_driven {
        shafts[0]["motion"] = orders(r, "acceleration_rad_per_s2", 20.0, 2000.0);
    } else {
        shafts[0]["torque_nm"] = json!(load);
        shafts[0]["inertia_kg_m2"] = json!(r.log(1e-3, 3e-2));
        if r.chance(0.6) {
            shafts[0]["orders"] = orders(r, "torque_nm", 0.3 * load, 3.0 * load);
        }
    }
    for shaft in &mut shafts {
        if r.chance(0.2) {
            shaft["drag"] = json!({ "torque_nm": r.log(0.01, 0.3), "torque_nm_s_per_rad": 1e-3 });
        }
        let key = r.pick(&["translation", "axial", "", "", ""]);
        if !key.is_empty() && shaft["gears"] != json!([]) {
            shaft[key] = json!({ "stiffness_n_per_m": r.log(5e7, 5e8), "damping_ratio": 0.03 });
        }
    }
    // A given motion takes any torque. Without a load, a start on a flank would be one to rounding only.
    let rest = if is_driven { json!(-load) } else { json!("balance") };
    let mut stages = Vec::new();
    if r.chance(0.3) {
        let last = format!("s{}", count - 1);
        // What moves sideways meshes in one frame only.
        shafts[count - 1]["translation"] = Value::Null;
        stages.push(stage(r, &last, module));
        shafts.push(json!({ "name": "carrier", "inertia_kg_m2": r.log(1e-2, 1e-1), "torque_nm": rest }));
        shafts.push(json!({ "name": "housing", "fixed": true }));
    } else {
        shafts[count - 1]["torque_nm"] = rest;
    }
    let train = json!({
        "kind": "gearbox", "shafts": shafts, "meshes": meshes, "couplings": couplings, "stages": stages,
        "rack": { "module_m": module, "pressure_angle_deg": 20, "addendum": 0.85, "helix_angle_deg": helix },
        "mesh": { "law": soft_mesh(r), "half_backlash_m": r.pick(&[2e-5, 5e-5, 1e-4]) },
    });
    let initial = json!(r.pick(&["quasi-static", "static", "rest"]));
    scene(train, initial, 60.0 / speed.abs() * r.of(0.5, 2.0))
}
