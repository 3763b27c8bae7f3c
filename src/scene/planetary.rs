//! A planetary stage.

use super::{
    body, build,
    mesh::{self, Engaged},
    node::Node,
};
use crate::{
    gear::{Gear, MeshKind, phase::equally_spaced},
    system::Spec,
    train::{Freedoms, Load, Phasing, Planet, Planetary, StageGeometry, Teeth},
};

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
    let (sun_node, planet_node, ring_node) = (node.at("sun"), node.at("planet"), node.at("ring"));
    let (sun_engaged, ring_engaged, rack_phase) = match node.at("rack").written() {
        Some(rack) => {
            let gears = read_gears(&rack, teeth);
            let engaged = |name, of, kind, widths| Engaged::new(&rack, name, gears.rack, of, kind, widths).map(Some);
            (
                engaged("sun mesh", [gears.sun, gears.planet], MeshKind::External, [&sun_node, &planet_node])?,
                engaged("ring mesh", [gears.planet, gears.ring], MeshKind::Internal, [&planet_node, &ring_node])?,
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
    let sun = body::read(&sun_node, radius(&sun_engaged, 0));
    let planet = body::read(&planet_node, radius(&sun_engaged, 1));
    let ring = body::read(&ring_node, radius(&ring_engaged, 1));
    let carrier = body::read(&node.at("carrier"), sun_engaged.map(|e| e.geometry.centre_distance));
    let masses = |a: &crate::train::Body, b: &crate::train::Body| [a.rotary_mass, b.rotary_mass];
    let sun_mesh = mesh::read(&node.at("sun_mesh"), masses(&sun, &planet), sun_engaged.as_ref());
    let ring_mesh = mesh::read(&node.at("ring_mesh"), masses(&planet, &ring), ring_engaged.as_ref());
    let load = |key: &str| node.at("load").at(key).number();
    let stage = Planetary {
        teeth,
        sun_pressure_angle: angle("sun_pressure_angle", &sun_engaged),
        ring_pressure_angle: angle("ring_pressure_angle", &ring_engaged),
        base_helix: sun_engaged.map_or(0.0, |engaged| engaged.rack.base_helix()),
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
