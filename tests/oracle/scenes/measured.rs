//! Classes R, T and Z: loads in steps and ramps, curves of measured points, and flanks that differ, in scenes of the other classes.

use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::{
    gearboxes, masses, pairs,
    random::{Random, round},
    stages,
};

/// Points of a load about `level` until `end`: steps or lines, once or with a period.
fn schedule(r: &mut Random, level: f64, end: f64) -> Value {
    let repeats = r.chance(0.5);
    let period = round(end * r.of(0.07, 0.4));
    let span = if repeats { period } else { end };
    let swing = r.of(0.2, 1.6);
    let value = |r: &mut Random| round(level * (1.0 + swing * r.of(-1.0, 1.0)));
    let is_sudden = r.chance(0.5);
    let mut points = vec![json!([0.0, value(r)])];
    let mut place = 0.0;
    for _ in 0..2 + r.below(5) {
        place += span * r.of(0.03, 0.25);
        if place > 0.93 * span {
            break;
        }
        let time = round(place);
        points.push(json!([time, value(r)]));
        if !is_sudden && r.chance(0.4) {
            points.push(json!([time, value(r)]));
        }
    }
    let mut schedule = json!({ "through": if is_sudden { "steps" } else { "lines" } });
    if repeats {
        if !is_sudden {
            points.push(json!([period, points[0][1]]));
        }
        schedule["period_s"] = json!(period);
        schedule["origin_s"] = json!(round(period * r.of(-0.9, 0.9)));
    }
    schedule["points"] = json!(points);
    schedule
}

/// A load in steps and ramps on masses, pairs, stages and gearboxes.
pub fn loads(r: &mut Random) -> Value {
    let mut scene = match r.below(8) {
        0 | 1 => masses::rest_and_release(r),
        2 => masses::mixed(r),
        3 => pairs::powers(r),
        4 => pairs::soft_pairs(r),
        5 => stages::soft_stages(r),
        6 => stages::rigid_stages(r),
        _ => gearboxes::gearboxes(r),
    };
    let end = scene["run"]["t_end_s"].as_f64().unwrap_or(1.0);
    let train = &mut scene["train"];
    let about = |load: &Value, usual: f64| load.as_f64().filter(|load| *load != 0.0).unwrap_or(usual);
    match train["kind"].as_str() {
        Some("matrices") => {
            let n = train["mass_kg"].as_array().map_or(0, Vec::len);
            let list: Vec<Value> = (0..1 + r.below(2))
                .map(|_| {
                    let mut load = schedule(r, 1.0, end);
                    load["vector_n"] = (0..n).map(|_| r.of(-0.3, 1.5)).collect();
                    load
                })
                .collect();
            train["load_schedules"] = json!(list);
        }
        Some("wall") => train["load_n"] = schedule(r, about(&train["load_n"], 1.0), end),
        Some("gear-pair") => train["torque_nm"] = schedule(r, about(&train["torque_nm"], 5.0), end),
        Some("planetary") => {
            train["load"]["output_torque_nm"] = schedule(r, about(&train["load"]["output_torque_nm"], 5.0), end);
        }
        _ => {
            // A given motion takes any torque; what stands still on average takes none.
            let shafts = train["shafts"].as_array_mut().expect("shafts");
            let loaded = |shaft: &Value| shaft["torque_nm"].is_number();
            if let Some(shaft) = shafts.iter_mut().find(|shaft| loaded(shaft)) {
                shaft["torque_nm"] = schedule(r, about(&shaft["torque_nm"], 5.0), end);
            }
        }
    }
    scene
}

/// Points of a curve about `mean`, some evenly apart.
fn points(r: &mut Random, mean: f64, swing: f64) -> Value {
    let count = 3 + r.below(9);
    let is_even = r.chance(0.4);
    let phase = r.phase();
    let places = (0..count).map(|i| (i as f64 + if is_even || i == 0 { 0.0 } else { r.of(-0.4, 0.4) }) / count as f64);
    let places: Vec<f64> = places.collect();
    let value = |x: f64, r: &mut Random| round(mean + swing * ((TAU * x + phase).sin() + r.of(-0.3, 0.3)));
    places.iter().map(|x| json!([round(*x), value(*x, r)])).collect()
}

/// Stiffnesses and errors of meshes by measured points.
pub fn curves(r: &mut Random) -> Value {
    let mut scene = match r.below(3) {
        0 => stages::soft_stages(r),
        _ => pairs::soft_pairs(r),
    };
    let train = &mut scene["train"];
    for key in ["mesh", "sun_mesh", "ring_mesh"] {
        let Some(mesh) = train.get_mut(key) else { continue };
        let gap = mesh["half_backlash_m"].as_f64().unwrap_or(5e-5);
        let mean = mesh["stiffness"].as_f64().unwrap_or(3e8);
        let swing = mean * r.of(0.05, 0.6);
        let mut stiffness = json!({ "kind": "curve", "points": points(r, mean, swing) });
        if r.chance(0.4) {
            stiffness["as"] = json!("harmonics");
            stiffness["harmonics"] = json!(1 + r.below(4));
        } else {
            stiffness["over"] = json!(1 + r.below(3));
        }
        mesh["stiffness"] = stiffness;
        let size = gap * r.of(0.1, 0.9);
        mesh["error"] = json!({ "points": points(r, 0.0, size), "harmonics": 1 + r.below(5), "over": 1 + r.below(2) });
    }
    scene
}

/// Flanks that differ in stiffness, phase, error and thickness, and dampers in the gap.
pub fn flanks(r: &mut Random) -> Value {
    let mut scene = match r.below(7) {
        0 => pairs::from_rest(r),
        1 | 2 => pairs::powers(r),
        3 => pairs::soft_pairs(r),
        4 => stages::soft_stages(r),
        5 => stages::rigid_stages(r),
        _ => masses::mixed(r),
    };
    let train = &mut scene["train"];
    for key in ["mesh", "sun_mesh", "ring_mesh"] {
        train.get_mut(key).into_iter().for_each(|mesh| differ(r, mesh, true));
    }
    if let Some(contacts) = train.get_mut("contacts").and_then(Value::as_array_mut) {
        contacts.iter_mut().filter(|contact| contact["flanks"] == "both").for_each(|contact| differ(r, contact, false));
    }
    scene
}

/// Lets the back flank of a mesh or contact differ. The start stays as it is: rounding may not decide whether a body is on its flank.
fn differ(r: &mut Random, mesh: &mut Value, is_mesh: bool) {
    let gap = mesh["half_backlash_m"].as_f64().unwrap_or(1e-5);
    let is_rigid = mesh["law"]["kind"] == "rigid";
    let is_power = mesh["law"]["kind"] == "power";
    let mut back = json!({});
    if !is_rigid && r.chance(0.6) {
        let own = mesh["stiffness"].as_f64().unwrap_or(3e8) * r.of(0.5, 1.5);
        back["stiffness"] = match r.below(2) {
            0 if is_mesh && !is_power => {
                json!({ "kind": "rectangular", "high": round(1.2 * own), "low": round(0.8 * own), "duty": 0.4 })
            }
            _ => json!(round(own)),
        };
    }
    if is_mesh {
        // The gap is twice as wide as the amplitudes of both errors together may be.
        let list = mesh["error"].as_array().map_or(&[][..], Vec::as_slice);
        let most: f64 = list.iter().filter_map(|h| h["amplitude_m"].as_f64()).sum();
        if most < 0.7 * gap && r.chance(0.5) {
            back["phase"] = json!(r.of(0.0, 1.0));
        }
        if r.chance(0.5) {
            let amplitude = round(gap * r.of(0.05, 0.4));
            back["error"] = json!([{ "order": 1 + r.below(2), "amplitude_m": amplitude, "phase_rad": r.phase() }]);
        }
        if most < 0.7 * gap && r.chance(0.4) {
            let amplitude = round(0.2 * gap * r.of(0.2, 1.0));
            mesh["thickness_error"] = json!([{ "order": 1, "amplitude_m": amplitude, "phase_rad": r.phase() }]);
        }
    } else {
        back["error_offset_m"] = json!(round(gap * r.of(-0.3, 0.3)));
    }
    if back != json!({}) {
        mesh["back_flank"] = back;
    }
    if r.chance(0.4) {
        let usual = if is_mesh { 200.0 } else { 0.2 };
        mesh["gap_damping_n_s_per_m"] = json!(r.log(0.1 * usual, usual));
    }
}
