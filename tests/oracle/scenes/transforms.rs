//! Classes O and X: a scene and its transform must give the same events. Flank is compared with itself, or with a closed form.

use serde_json::{Value, json};

use super::{masses, pairs, random::Random, schedules, special};

/// What was done to a scene, and how its events lead back.
pub struct Transform {
    pub base: Value,
    pub other: Value,
    pub about: &'static str,
    /// Times of the other by this factor are those of the base.
    pub time: f64,
    /// Drive and back are exchanged.
    pub mirrored: bool,
    /// Whole cycles that the other starts later.
    pub cycles: u64,
}

/// A random scene and one transform of it.
pub fn transform(r: &mut Random) -> Transform {
    match r.below(4) {
        0 => mirror(r),
        1 => lengths(r),
        2 => times(r),
        _ => shift(r),
    }
}

fn any(r: &mut Random) -> Value {
    match r.below(4) {
        0 => pairs::soft_pairs(r),
        1 => special::phases(r),
        2 => schedules::kinds(r),
        _ => masses::mixed(r),
    }
}

fn plain(base: Value, other: Value, about: &'static str) -> Transform {
    Transform { base, other, about, time: 1.0, mirrored: false, cycles: 0 }
}

/// Changes every number under keys that `of` gives a factor for.
fn scale(value: &mut Value, of: &dyn Fn(&str) -> f64) {
    fn times(value: &mut Value, factor: f64) {
        match value {
            Value::Number(n) => *value = json!(n.as_f64().unwrap_or(0.0) * factor),
            Value::Array(items) => items.iter_mut().for_each(|v| times(v, factor)),
            _ => {}
        }
    }
    match value {
        Value::Object(map) => {
            for (key, inner) in map.iter_mut() {
                let factor = of(key);
                if factor == 1.0 || inner.is_object() {
                    scale(inner, of);
                } else {
                    times(inner, factor);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|v| scale(v, of)),
        _ => {}
    }
}

/// Masses with two flanks, everything negated.
fn mirror(r: &mut Random) -> Transform {
    let mut base = special::phases(r);
    base["initial"] = json!("rest");
    let mut other = base.clone();
    scale(&mut other, &|key| if matches!(key, "load_n" | "vector_n") { -1.0 } else { 1.0 });
    if let Some(contacts) = other["train"]["contacts"].as_array_mut() {
        for c in contacts {
            scale(&mut c["error"], &|key| if key == "amplitude_m" { -1.0 } else { 1.0 });
        }
    }
    Transform { mirrored: true, ..plain(base, other, "mirrored") }
}

/// Lengths and forces by a power of two; of linear and rigid laws.
fn lengths(r: &mut Random) -> Transform {
    let base = loop {
        let scene = special::phases(r);
        if scene["train"]["contacts"][0]["law"]["kind"] != "power" {
            break scene;
        }
    };
    let mut other = base.clone();
    let factor = f64::powi(2.0, r.pick(&[-20, -7, 5, 30]));
    scale(&mut other, &|key| {
        if matches!(key, "load_n" | "vector_n" | "amplitude_m" | "half_backlash_m") { factor } else { 1.0 }
    });
    plain(base, other, "lengths and forces scaled")
}

/// Masses by a power of four: times by a power of two.
fn times(r: &mut Random) -> Transform {
    let base = loop {
        let scene = special::phases(r);
        if scene["train"]["contacts"][0]["law"]["kind"] != "power" {
            break scene;
        }
    };
    let mut other = base.clone();
    let slow = f64::powi(2.0, r.pick(&[-6, -1, 3, 10]));
    scale(&mut other, &|key| match key {
        "mass_kg" => slow * slow,
        "damping_n_s_per_m" | "t_end_s" => slow,
        "frequency_rad_per_s" | "base_frequency_rad_per_s" => 1.0 / slow,
        _ => 1.0,
    });
    Transform { time: 1.0 / slow, ..plain(base, other, "times scaled") }
}

/// Started some whole periods later.
fn shift(r: &mut Random) -> Transform {
    let mut base = loop {
        let scene = any(r);
        if !scene.to_string().contains("switched") {
            break scene;
        }
    };
    base["run"] = json!({ "cycles": 4 });
    let own = base["train"]["kind"] == "matrices" && base["train"]["base_frequency_rad_per_s"].is_null();
    if own {
        // Loads of multiples of 1/2, and no other period.
        base = special::phases(r);
        base["run"] = json!({ "cycles": 4 });
    }
    let mut other = base.clone();
    let cycles = r.pick(&[1_u64, 17, 1000, 1_000_000]);
    other["run"]["start_cycle"] = json!(cycles);
    Transform { cycles, ..plain(base, other, "shifted by whole periods") }
}

/// A scene of class X.
pub enum Extreme {
    /// Other units, or a late start.
    Transform(Transform),
    /// A bead between two walls that gives nothing away: with the times of its impacts.
    Flight { scene: Value, first: f64, next: f64 },
}

/// Units of mass, length and time from 1e-30 to 1e30, starts up to cycle 1e15, flights of up to 1e15 periods.
pub fn extreme(r: &mut Random) -> Extreme {
    match r.below(4) {
        0 | 1 => Extreme::Transform(units(r)),
        2 => {
            let mut late = shift(r);
            late.cycles = r.pick(&[1_000_000_000, 1_000_000_000_000, 1_000_000_000_000_000]);
            late.other["run"]["start_cycle"] = json!(late.cycles);
            Extreme::Transform(late)
        }
        _ => {
            let (gap, speed, mass) = (r.log(1e-30, 1e30), r.log(1e-30, 1e30), r.log(1e-30, 1e30));
            let (from, count) = (r.of(-0.9, 0.9), r.of(3.0, 12.0));
            let (first, next) = (gap * (1.0 - from) / speed, 2.0 * gap / speed);
            // The period is one that the run counts, and no part of the motion.
            let scene = json!({
                "flank": 1,
                "train": { "kind": "wall", "mass_kg": mass, "wall": { "side": "both", "half_gap_m": gap }, "law": { "kind": "rigid", "restitution": 1 } },
                "initial": { "q": [gap * from], "v": [speed] },
                "run": { "t_end_s": first + next * count, "period_s": next * r.log(1e-15, 1e3) },
            });
            Extreme::Flight { scene, first, next }
        }
    }
}

fn units(r: &mut Random) -> Transform {
    let base = loop {
        let scene = special::phases(r);
        if scene["train"]["contacts"][0]["law"]["kind"] != "power" {
            break scene;
        }
    };
    let mut unit = || f64::powi(2.0, r.below(201) as i32 - 100);
    let (mass, length, time) = (unit(), unit(), unit());
    let mut other = base.clone();
    scale(&mut other, &|key| match key {
        "mass_kg" => mass,
        "damping_n_s_per_m" => mass / time,
        "stiffness" | "mean" => mass / time / time,
        "load_n" | "vector_n" => mass * length / time / time,
        "amplitude_m" | "half_backlash_m" => length,
        "frequency_rad_per_s" | "base_frequency_rad_per_s" => 1.0 / time,
        "t_end_s" => time,
        _ => 1.0,
    });
    Transform { time: 1.0 / time, ..plain(base, other, "extreme units") }
}
