//! Published stages as scenes: data in the keys of a planetary train, one file each, with the source of its numbers.

use serde_json::{Map, Value};

use crate::{
    gear::{BasicRack, Gear},
    train::StageGeometry,
};

use super::Warning;

macro_rules! presets {
    ($($name:literal),*) => { [$(($name, include_str!(concat!("presets/", $name, ".json")))),*] };
}

/// Names of the presets, and their files.
pub(super) const PRESETS: [(&str, &str); 6] =
    presets!["reference-light", "reference", "reference-heavy", "reference-float", "exact-frequencies", "lin-parker"];

/// Keys with one meaning: a written one replaces the other of the preset.
const ALTERNATIVES: [&[&str]; 10] = [
    &["damping_nm_s_per_rad", "damping_ratio"],
    &["pressure_angle_rad", "pressure_angle_deg"],
    &["damping_n_s_per_m", "damping_ratio"],
    &["inertia_kg_m2", "rotary_mass_kg"],
    &["half_backlash_m", "total_backlash_m"],
    &["hysteresis", "hysteresis_coefficient"],
    &["restitution", "hysteresis_coefficient"],
    &["planets", "positions_rad", "positions_deg"],
    &["sun_pressure_angle_rad", "sun_pressure_angle_deg"],
    &["ring_pressure_angle_rad", "ring_pressure_angle_deg"],
];

/// Relative difference of rounded numbers in a preset.
const SAME: f64 = 1e-9;

/// Returns a scene with its preset, if any, expanded.
pub(super) fn expand(scene: &Value) -> Value {
    let mut scene = scene.clone();
    let Some(train) = scene.get_mut("train").and_then(Value::as_object_mut) else { return scene };
    match train.get("kind").and_then(Value::as_str) {
        Some("planetary") => {}
        Some("gearbox") => {
            share(train);
            return scene;
        }
        _ => return scene,
    }
    let Some(name) = train.get("preset").filter(|name| !name.is_null()).cloned() else { return scene };
    let known = PRESETS.iter().find(|(known, _)| name.as_str() == Some(known));
    if known.is_some() {
        train.remove("preset");
    }
    // A preset that does not exist is one fault, not one for each of its keys.
    let (_, text) = known.unwrap_or(&PRESETS[0]);
    if let Ok(Value::Object(mut base)) = serde_json::from_str(text).map(|mut file: Value| file["train"].take()) {
        if has_other_teeth(&base, train) {
            drop_what_teeth_give(&mut base);
        }
        overlay(&mut base, train);
        *train = base;
    }
    scene
}

/// Returns whether the teeth written over a preset differ from its own: other numbers, or a rack that gives other radii, angles or phases.
fn has_other_teeth(base: &Map<String, Value>, train: &Map<String, Value>) -> bool {
    if train.get("teeth").is_some_and(|teeth| base.get("teeth") != Some(teeth)) {
        return true;
    }
    let Some(rack) = train.get("rack").filter(|rack| !rack.is_null()) else { return false };
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let degrees = rack.get("pressure_angle_deg").map(|angle| number(angle).to_radians());
    let gear = |name: &str| Gear {
        teeth: base["teeth"][name].as_u64().and_then(|teeth| u32::try_from(teeth).ok()).unwrap_or(0),
        shift: number(&rack["profile_shift"][name]),
    };
    let stage = StageGeometry {
        rack: BasicRack {
            module: number(&rack["module_m"]),
            pressure_angle: degrees.unwrap_or_else(|| number(&rack["pressure_angle_rad"])),
            helix_angle: rack.get("helix_angle_deg").map_or(0.0, number).to_radians(),
            addendum: 1.0,
            dedendum: 1.25,
        },
        sun: gear("sun"),
        planet: gear("planet"),
        ring: gear("ring"),
        face_width: 1.0,
    };
    let (Ok(sun), Ok(ring)) = (stage.sun_mesh(), stage.ring_mesh()) else { return true };
    let same = |value: &Value, own: f64| (number(value) - own).abs() <= SAME * own.abs();
    let are_same = same(&base["sun"]["radius_m"], sun.base_radii[0])
        && same(&base["sun_pressure_angle_rad"], sun.pressure_angle)
        && same(&base["ring_pressure_angle_rad"], ring.pressure_angle)
        && same(&base["ring_phase"], stage.ring_phase());
    !are_same
}

/// Removes the numbers of a preset that follow from its teeth: other teeth have other ones.
fn drop_what_teeth_give(base: &mut Map<String, Value>) {
    base.retain(|key, _| !(key.contains("pressure_angle") || key == "ring_phase"));
    let parts: [(&[&str], &[&str]); 2] = [
        (&["sun", "planet", "ring", "carrier"], &["radius_m", "outer_radius_m", "rotary_mass_kg"]),
        (&["sun_mesh", "ring_mesh"], &["stiffness"]),
    ];
    for (parts, keys) in parts {
        for part in parts {
            let Some(Value::Object(part)) = base.get_mut(*part) else { continue };
            keys.iter().for_each(|key| drop(part.remove(*key)));
        }
    }
}

/// Copies the common values of all meshes of a gearbox into each of them.
fn share(train: &mut Map<String, Value>) {
    let mut take = |key: &str| match train.get(key) {
        Some(Value::Object(_)) => train.remove(key),
        _ => None,
    };
    let (rack, mesh) = (take("rack"), take("mesh"));
    let under = |item: &mut Value, base: &Option<Value>| {
        if let (Value::Object(own), Some(Value::Object(base))) = (&mut *item, base) {
            let mut whole = base.clone();
            overlay(&mut whole, own);
            *item = Value::Object(whole);
        }
    };
    let inside = |item: &mut Value, key: &str, base: &Option<Value>| {
        if let Value::Object(own) = item {
            let own = own.entry(key).or_insert(Value::Null);
            if own.is_null() && base.is_some() {
                *own = Value::Object(Map::new());
            }
            under(own, base);
        }
    };
    let mut each = |list: &str, fill: &dyn Fn(&mut Value)| {
        train.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten().for_each(fill);
    };
    each("meshes", &|item| {
        under(item, &mesh);
        inside(item, "rack", &rack);
    });
    each("stages", &|item| {
        for (key, base) in [("rack", &rack), ("sun_mesh", &mesh), ("ring_mesh", &mesh)] {
            inside(item, key, base);
        }
    });
}

/// Returns a warning for each common number, word or list of a gearbox that every mesh replaces by its own; members of objects apart.
pub(super) fn replaced_everywhere(scene: &Value) -> Vec<Warning> {
    let train = &scene["train"];
    if train["kind"] != "gearbox" {
        return vec![];
    }
    let all = |list: &str| train[list].as_array().into_iter().flatten();
    let of_stages = || all("stages").flat_map(|stage| [&stage["sun_mesh"], &stage["ring_mesh"]]);
    let racks = all("meshes").chain(all("stages")).map(|item| &item["rack"]).collect();
    let mut warnings = Vec::new();
    for (common, owns) in [("mesh", all("meshes").chain(of_stages()).collect::<Vec<_>>()), ("rack", racks)] {
        for (key, shared) in train[common].as_object().into_iter().flatten() {
            let is_replaced = |own: &&Value| {
                let has =
                    |other: &&str| own.get(*other).is_some_and(|value| !(value.is_object() && shared.is_object()));
                has(&key.as_str())
                    || ALTERNATIVES.iter().any(|group| group.contains(&key.as_str()) && group.iter().any(has))
            };
            if !owns.is_empty() && owns.iter().all(is_replaced) {
                let message =
                    "every mesh has its own value, so that this one has no effect; remove one or the other".to_owned();
                warnings.push(Warning { pointer: format!("/train/{common}/{key}"), message });
            }
        }
    }
    warnings
}

/// Writes `top` over `base`. Keys of `top` that exclude each other are kept, for the check to refuse.
fn overlay(base: &mut Map<String, Value>, top: &Map<String, Value>) {
    for (key, value) in top {
        for group in ALTERNATIVES.iter().filter(|group| group.contains(&key.as_str())) {
            group.iter().filter(|other| !top.contains_key(**other)).for_each(|other| {
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
