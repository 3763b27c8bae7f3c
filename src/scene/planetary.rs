//! A planetary stage.

use serde_json::json;

use super::{
    body, build,
    mesh::{self, Engaged},
    node::Node,
    pair, preset,
    shape::{Object, Shape, at_least, choice, list_of, number, within},
};
use crate::{
    gear::{Gear, MeshKind, phase::equally_spaced},
    train::{Freedoms, Load, Phasing, Planet, Planetary, Spec, StageGeometry, Teeth},
};

const MAX_PLANETS: usize = 10;

/// Gears, bodies, meshes and load of a stage, or a preset with some of them changed.
pub(super) fn shape() -> Object {
    let freedoms = Shape::Either(vec![
        choice(&["torsional", "in-phase", "full", "full-carrier"]),
        list_of(1, 9 + 3 * MAX_PLANETS, Shape::Text),
    ]);
    let per_planet = || list_of(1, MAX_PLANETS, number());
    let explicit = Object::new("Mesh phases written out, periods.")
        .needed("sun", per_planet(), "Sun meshes, one per planet.")
        .needed("ring", per_planet(), "Ring meshes, one per planet.");
    let phases = Shape::Either(vec![choice(&["teeth", "assemblable", "in-phase"]), Shape::Object(explicit)]);
    let of_gears = |about: &'static str, item: fn() -> Shape| {
        Object::new(about).needed("sun", item(), "Sun.").needed("planet", item(), "Planets.").needed(
            "ring",
            item(),
            "Ring.",
        )
    };
    let shifts = of_gears("Profile shifts, modules.", || within(-2.0, 2.0));
    let rack = mesh::rack_shape().needed("profile_shift", Shape::Object(shifts), "Profile shifts.");
    let load = Object::new("Torques at the carrier and drag of the planets.")
        .with_default("output_torque_nm", 0.0, number(), "Torque taken off at the carrier.")
        .with_default("drag_torque_nm", 0.0, number(), "Constant drag torque at the carrier.")
        .with_default("drag_torque_nm_per_rpm", 0.0, number(), "Drag torque at the carrier per sun speed.")
        .with_default("planet_drag_n", 0.0, number(), "Drag force on each planet's base circle.");
    let part = |about| Shape::Object(body::keys(Object::new(about)));
    let stage = Object::new("A planetary stage: the sun drives, the ring is held, the carrier delivers.")
        .partial()
        .free("preset", choice(&preset::NAMES), "A published stage; keys written beside it replace its own.")
        .with_default("freedoms", "full", freedoms, "Freedoms kept: a set by name, or a list of names.")
        .needed("speed_rpm", at_least(0.0), "Speed of the sun.")
        .with_default("load", json!({}), Shape::Object(load), "Load.")
        .needed("teeth", Shape::Object(of_gears("Tooth numbers.", pair::teeth)), "Tooth numbers.")
        .free("rack", Shape::Object(rack), "Rack and shifts: radii, pressure angles and phases follow from them.")
        .free("planets", Shape::Whole { min: 1, max: MAX_PLANETS as u64 }, "Number of planets, equally spaced.")
        .free("positions_rad", per_planet(), "Positions of the planets.")
        .free("positions_deg", per_planet(), "Positions of the planets.")
        .exactly_one(["planets", "positions_rad", "positions_deg"])
        .with_default("phases", "teeth", phases, "Mesh phases: from the teeth, in phase, or written out.")
        .free("ring_phase", number(), "Phase between a planet's two meshes, periods; the rack's or 0 if left out.")
        .needed("sun", part("The sun."), "Sun.")
        .needed("planet", part("A planet; its translation is its bearing."), "Planets.")
        .needed("ring", part("The ring."), "Ring.")
        .needed("carrier", part("The carrier."), "Carrier.")
        .needed("sun_mesh", mesh::shape(), "Sun meshes.")
        .needed("ring_mesh", mesh::shape(), "Ring meshes.")
        .with_default("gyroscopic", false, Shape::Flag, "Whether Coriolis and centripetal terms act.")
        .with_default("strict", false, Shape::Flag, "Whether implausible data are refused.")
        .mistake("load_nm", "write load: { \"output_torque_nm\": ... }")
        .mistake("torque_nm", "write load: { \"output_torque_nm\": ... }");
    mesh::angle(mesh::angle(stage, "sun_pressure_angle", false), "ring_pressure_angle", false)
}

/// The train written here, with its freedoms and its frame's speed, rad/s.
pub(super) fn read(node: &Node) -> Option<(Spec, f64)> {
    let stage = read_stage(node)?;
    for warning in stage.warnings().iter().filter(|_| !stage.strict) {
        node.warn(warning.to_string());
    }
    let freedoms = node.at("freedoms");
    let kept = match freedoms.text() {
        "torsional" => Freedoms::Torsional,
        "in-phase" => Freedoms::InPhase,
        "full" => Freedoms::Full,
        "full-carrier" => Freedoms::FullCarrier,
        _ => Freedoms::Named(freedoms.items().iter().map(|name| name.text().to_owned()).collect()),
    };
    let spec = build::assembled(node, stage.assemble(&kept))?;
    Some((spec, stage.carrier_speed()))
}

fn read_stage(node: &Node) -> Option<Planetary> {
    let number = |key: &str| node.at(key).number();
    let teeth = |key: &str| node.at("teeth").at(key).whole() as u32;
    let teeth = Teeth { sun: teeth("sun"), planet: teeth("planet"), ring: teeth("ring") };
    let (sun_engaged, ring_engaged, rack_phase) = match node.at("rack").written() {
        Some(rack) => {
            let gears = read_gears(&rack, teeth);
            (
                Some(Engaged::new(&rack, gears.rack, [gears.sun, gears.planet], MeshKind::External)?),
                Some(Engaged::new(&rack, gears.rack, [gears.planet, gears.ring], MeshKind::Internal)?),
                gears.ring_phase(),
            )
        }
        None => (None, None, 0.0),
    };
    let angle = |stem: &str, engaged: &Option<Engaged>| {
        mesh::read_angle(node, stem).or(engaged.map(|e| e.geometry.pressure_angle)).unwrap_or_else(|| {
            node.at(&format!("{stem}_deg")).refuse("an angle in degrees", "add the working pressure angle, or a rack");
            0.0
        })
    };
    let radius = |engaged: &Option<Engaged>, i: usize| engaged.map(|e| e.geometry.base_radii[i]);
    let sun = body::read(&node.at("sun"), radius(&sun_engaged, 0));
    let planet = body::read(&node.at("planet"), radius(&sun_engaged, 1));
    let ring = body::read(&node.at("ring"), radius(&ring_engaged, 1));
    let carrier = body::read(&node.at("carrier"), sun_engaged.map(|e| e.geometry.centre_distance));
    let masses = |a: &crate::train::Body, b: &crate::train::Body| [a.rotary_mass, b.rotary_mass];
    let sun_mesh = mesh::read(&node.at("sun_mesh"), masses(&sun, &planet), sun_engaged.as_ref());
    let ring_mesh = mesh::read(&node.at("ring_mesh"), masses(&planet, &ring), ring_engaged.as_ref());
    let load = |key: &str| node.at("load").at(key).number();
    let stage = Planetary {
        teeth,
        sun_pressure_angle: angle("sun_pressure_angle", &sun_engaged),
        ring_pressure_angle: angle("ring_pressure_angle", &ring_engaged),
        ring_phase: node.at("ring_phase").written().map_or(rack_phase, |phase| phase.number()),
        sun,
        ring,
        carrier,
        planets: read_positions(node)
            .into_iter()
            .map(|position| Planet { position, body: planet, sun_mesh: sun_mesh.clone(), ring_mesh: ring_mesh.clone() })
            .collect(),
        rpm: number("speed_rpm"),
        load: Load {
            output_torque: load("output_torque_nm"),
            drag: load("drag_torque_nm"),
            drag_per_rpm: load("drag_torque_nm_per_rpm"),
            planet_drag: load("planet_drag_n"),
        },
        gyroscopic: node.at("gyroscopic").flag(),
        strict: node.at("strict").flag(),
    };
    let phases = node.at("phases");
    let phasing = match phases.text() {
        "teeth" => Phasing::Teeth,
        "assemblable" => Phasing::Assemblable,
        "in-phase" => Phasing::InPhase,
        _ => Phasing::Explicit {
            sun: phases.at("sun").vector(stage.planets.len()),
            ring: phases.at("ring").vector(stage.planets.len()),
        },
    };
    build::assembled(node, stage.phased(&phasing))
}

fn read_gears(rack: &Node, teeth: Teeth) -> StageGeometry {
    let gear = |teeth: u32, key: &str| Gear { teeth, shift: rack.at("profile_shift").at(key).number() };
    StageGeometry {
        rack: mesh::read_rack(rack),
        sun: gear(teeth.sun, "sun"),
        planet: gear(teeth.planet, "planet"),
        ring: gear(teeth.ring, "ring"),
        // Only a stiffness by a standard reads it; a mesh that asks for one writes its own.
        face_width: 1.0,
    }
}

fn read_positions(node: &Node) -> Vec<f64> {
    if let Some(count) = node.at("planets").written() {
        return equally_spaced(count.whole() as usize);
    }
    let degrees = node.at("positions_deg").numbers().into_iter().map(f64::to_radians);
    node.at("positions_rad").written().map_or_else(|| degrees.collect(), |positions| positions.numbers())
}
