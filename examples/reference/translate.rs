//! A case as a scene.

use serde_json::{Map, Value, json};

use super::Outcome;

/// Time at which a case starts.
pub fn start_time(case: &Value) -> f64 {
    case["initial_state"]["t"].as_f64().unwrap_or(0.0)
}

/// The scene of a case with events.
pub fn scene(case: &Value) -> Outcome<Value> {
    let p = &case["parameters"];
    let train = if case["type"] == "hertz_deadzone" { dead_zone(p)? } else { matrices(p)? };
    Ok(json!({
        "flank": 1,
        "name": case["name"],
        "train": train,
        "initial": { "q": case["initial_state"]["q"], "v": case["initial_state"]["v"] },
        "run": { "t_end_s": end_time(case)? },
    }))
}

fn end_time(case: &Value) -> Outcome<f64> {
    match &case["t_end"] {
        Value::String(text) => Ok(text.parse()?),
        other => number(other, "t_end"),
    }
}

fn number(value: &Value, what: &str) -> Outcome<f64> {
    value.as_f64().ok_or_else(|| format!("{what}: expected a number, found {value}").into())
}

fn items(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// `M q'' + C q' + K q + … = F0 + …` with meshes, or with rigid unilateral contacts.
fn matrices(p: &Value) -> Outcome<Value> {
    let mut train = json!({ "kind": "matrices", "mass_kg": p["M"] });
    for (key, matrix) in [("damping_n_s_per_m", "C"), ("stiffness_n_per_m", "K"), ("load_n", "F0")] {
        if !p[matrix].is_null() {
            train[key] = p[matrix].clone();
        }
    }
    let load = |h: &Value| json!({ "vector_n": h[0], "frequency_rad_per_s": h[1], "phase_rad": h[2] });
    train["load_harmonics"] = items(&p["harm"]).iter().map(load).collect();
    let contacts: Outcome<Vec<Value>> = if p["meshes"].is_array() {
        items(&p["meshes"]).iter().map(mesh).collect()
    } else {
        items(&p["contacts"]).iter().map(wall).collect()
    };
    train["contacts"] = contacts?.into();
    Ok(train)
}

/// Harmonics, their amplitudes times `sign`.
fn harmonics(list: &Value, amplitude: &str, sign: f64) -> Outcome<Value> {
    let one = |h: &Value| {
        let mut row = Map::new();
        row.insert(amplitude.to_owned(), (sign * number(&h[0], "amplitude")?).into());
        row.insert("frequency_rad_per_s".to_owned(), h[1].clone());
        row.insert("phase_rad".to_owned(), h[2].clone());
        Ok(Value::Object(row))
    };
    items(list).iter().map(one).collect()
}

/// A linear mesh with a dead zone; in the case the error adds to the deflection.
fn mesh(m: &Value) -> Outcome<Value> {
    let release = if m["law"] == "force" { "force" } else { "deflection" };
    Ok(json!({
        "direction": m["G"],
        "half_backlash_m": m["b"],
        "error": harmonics(&m["err"], "amplitude_m", -1.0)?,
        "stiffness": stiffness(m)?,
        "law": { "kind": "kelvin-voigt", "damping_n_s_per_m": m["c"].as_f64().unwrap_or(0.0), "release": release },
    }))
}

fn stiffness(m: &Value) -> Outcome<Value> {
    let k = number(&m["k0"], "k0")?;
    let rectangle = &m["rect"];
    if rectangle.is_null() {
        return Ok(if items(&m["harm"]).is_empty() {
            k.into()
        } else {
            json!({ "kind": "harmonic", "mean": k, "harmonics": harmonics(&m["harm"], "amplitude", 1.0)? })
        });
    }
    let step = number(&rectangle["eps"], "eps")?;
    let level = |sign: f64| k * (1.0 + sign * step);
    if rectangle["times"].is_array() {
        let sign = rectangle["sign0"].as_f64().unwrap_or(1.0);
        return Ok(json!({ "kind": "switched", "levels": [level(sign), level(-sign)], "times_s": rectangle["times"] }));
    }
    Ok(json!({
        "kind": "rectangular", "high": level(1.0), "low": level(-1.0),
        "duty": rectangle["duty"], "period_s": rectangle["T"], "origin_s": rectangle["t0"],
    }))
}

/// A rigid contact with `gap = off + G q + err ≥ 0`, that is `−G q − err ≤ off`.
fn wall(c: &Value) -> Outcome<Value> {
    let direction: Outcome<Vec<f64>> = items(&c["G"]).iter().map(|g| Ok(-number(g, "G")?)).collect();
    Ok(json!({
        "direction": direction?,
        "flanks": "drive",
        "half_backlash_m": c["off"],
        "error": harmonics(&c["err"], "amplitude_m", 1.0)?,
        "law": { "kind": "rigid", "restitution": c["e"] },
    }))
}

/// One mass between two Hertzian flanks with hysteresis.
fn dead_zone(p: &Value) -> Outcome<Value> {
    let load = |h: &Value| json!({ "vector_n": [h[0]], "frequency_rad_per_s": h[1], "phase_rad": h[2] });
    Ok(json!({
        "kind": "matrices",
        "mass_kg": [p["m"]],
        "damping_n_s_per_m": [p["c"]],
        "load_n": [p["F0"]],
        "load_harmonics": items(&p["harm"]).iter().map(load).collect::<Value>(),
        "contacts": [{
            "direction": [1.0],
            "half_backlash_m": p["b"],
            "stiffness": p["K"],
            "law": hertz(p["n"].as_f64().unwrap_or(1.5).into(), &p["mu"]),
        }],
    }))
}

/// A power law whose latched speed has no floor that matters.
pub fn hertz(exponent: Value, hysteresis: &Value) -> Value {
    json!({
        "kind": "power", "exponent": exponent, "hysteresis_coefficient": hysteresis,
        "speed_floor_m_per_s": 1e-30, "initial_speed_m_per_s": 1e-2,
    })
}
