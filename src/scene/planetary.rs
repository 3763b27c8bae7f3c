//! A planetary stage.

use super::{
    body, build, curve, load,
    mesh::{self, GearPairing, ToothMesh},
    node::Node,
    plausible::{self, LUMPED},
};
use crate::{
    gear::{BasicRack, Gear, MeshGeometry, MeshKind, phase::equally_spaced},
    system::Spec,
    train::{Freedoms, Load, Phasing, Planet, Planetary, StageGeometry, Teeth, Warning},
};

/// Reads a train, with its freedoms and its frame's speed, rad/s.
pub(super) fn read(node: &Node) -> Option<(Spec, f64)> {
    let (stage, meshes) = read_stage(node)?;
    for warning in stage.warnings() {
        match warning {
            Warning::Teeth { .. } => {
                let remedy =
                    "change tooth numbers: ring = sun + 2 planets, up to two teeth that profile shifts make up";
                node.at("teeth").fault(warning.to_string(), "teeth that mesh with sun and ring", remedy);
            }
            _ => node.warn(warning.to_string()),
        }
    }
    let freedoms = node.at("freedoms");
    let kept = match freedoms.text() {
        "torsional" => Freedoms::Torsional,
        "in-phase" => Freedoms::InPhase,
        "full" => Freedoms::Full,
        "full-carrier" => Freedoms::FullCarrier,
        _ => Freedoms::Named(freedoms.items().iter().map(|name| name.text().to_owned()).collect()),
    };
    let mut spec = build::assembled(node, stage.assemble(&kept))?;
    plausible::train(node, &spec, &meshes);
    let torque = node.at("load").at("output_torque_nm");
    if let (_, Some(factor)) = load::or_schedule(&torque, &curve::TORQUES, None) {
        let with = |load: Load| Some(build::assembled(node, Planetary { load, ..stage.clone() }.assemble(&kept))?.load);
        let unit = Load { output_torque: 1.0, ..Load::default() };
        load::follow(&mut spec, factor, [with(Load { output_torque: 0.0, ..stage.load })?, with(unit)?]);
    }
    stage.drawing(&kept).into_iter().for_each(|drawing| node.drawing(drawing));
    Some((spec, stage.carrier_speed()))
}

/// Reads the stage, with its meshes.
fn read_stage(node: &Node) -> Option<(Planetary, Vec<ToothMesh>)> {
    let number = |key: &str| node.at(key).number();
    let teeth = |key: &str| node.at("teeth").at(key).whole() as u32;
    let teeth = Teeth { sun: teeth("sun"), planet: teeth("planet"), ring: teeth("ring") };
    let (sun_node, planet_node, ring_node) = (node.at("sun"), node.at("planet"), node.at("ring"));
    let (sun_engaged, ring_engaged, rack_phase) = match node.at("rack").written() {
        Some(rack) => {
            let gears = read_gears(&rack, teeth);
            let engaged = |of, kind, widths| GearPairing::new(&rack, gears.rack, of, kind, widths).map(Some);
            (
                engaged([gears.sun, gears.planet], MeshKind::External, [&sun_node, &planet_node])?,
                engaged([gears.planet, gears.ring], MeshKind::Internal, [&planet_node, &ring_node])?,
                gears.ring_phase(),
            )
        }
        None => (None, None, 0.0),
    };
    let angle = |stem: &str, engaged: &Option<GearPairing>| {
        mesh::read_angle(node, stem).or(engaged.map(|e| e.geometry.pressure_angle)).unwrap_or_else(|| {
            node.at(&format!("{stem}_deg")).refuse("an angle in degrees", "add the working pressure angle, or a rack");
            0.0
        })
    };
    let radius = |engaged: &Option<GearPairing>, i: usize| engaged.map(|e| e.geometry.base_radii[i]);
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
            output_torque: load::at_rest(&node.at("load").at("output_torque_nm"), &curve::TORQUES),
            drag: load("drag_torque_nm"),
            drag_per_rpm: load("drag_torque_nm_per_rpm"),
            planet_drag: load("planet_drag_n"),
        },
        gyroscopic: node.at("gyroscopic").flag(),
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
    let stage = build::assembled(node, stage.phased(&phasing))?;
    let phases: [Vec<f64>; 2] = [
        stage.planets.iter().map(|planet| planet.sun_mesh.phase).collect(),
        stage.planets.iter().map(|planet| planet.ring_mesh.phase).collect(),
    ];
    let frequency = stage.mesh_frequency().abs();
    let is_given = sun_engaged.is_some();
    // Radii and angles give a rack too, sufficient for orders of magnitude.
    let engaged = [sun_engaged, ring_engaged]
        .into_iter()
        .zip([true, false])
        .map(|(given, is_sun)| given.or_else(|| guess(&stage, is_sun)));
    let names = ["sun mesh", "ring mesh"].into_iter().zip(phases);
    let meshes = engaged
        .zip(names)
        .map(|(engaged, (name, phases))| Some(ToothMesh { is_given, ..engaged?.mesh(name, frequency, phases) }));
    let Some(meshes) = meshes.collect::<Option<Vec<_>>>() else { return Some((stage, vec![])) };
    let rack = node.at("rack");
    plausible::mesh(&node.at("sun_mesh"), &rack, &sun_mesh, &meshes[0]);
    plausible::mesh(&node.at("ring_mesh"), &rack, &ring_mesh, &meshes[1]);
    let tip = meshes[0].gears[1].tip_radius(&meshes[0].rack);
    plausible::planets(&node.at("planets"), &stage.positions(), meshes[0].geometry.centre_distance, tip);
    for (k, (node, body)) in [(&sun_node, &stage.sun), (&planet_node, &stage.planets[0].body)].into_iter().enumerate() {
        plausible::inertia(node, (body.mass, body.inertia()), &meshes[0], k, LUMPED);
    }
    node.meshes(meshes.clone());
    Some((stage, meshes))
}

/// Returns the sun mesh or the ring mesh of a stage that is given by base radii.
fn guess(stage: &Planetary, is_sun: bool) -> Option<GearPairing> {
    let (z, angle) = if is_sun {
        (stage.teeth.sun, stage.sun_pressure_angle)
    } else {
        (stage.teeth.ring, stage.ring_pressure_angle)
    };
    let radius = if is_sun { stage.sun.radius } else { stage.ring.radius };
    let module = 2.0 * radius / (f64::from(z) * libm::cos(angle));
    let rack = BasicRack { module, pressure_angle: angle, helix_angle: 0.0, addendum: 1.0, dedendum: 1.25 };
    let [one, two] =
        if is_sun { [stage.teeth.sun, stage.teeth.planet] } else { [stage.teeth.planet, stage.teeth.ring] };
    let kind = if is_sun { MeshKind::External } else { MeshKind::Internal };
    let gears = [one, two].map(|teeth| Gear { teeth, shift: 0.0 });
    let geometry = MeshGeometry::new(&rack, gears[0], gears[1], kind).ok()?;
    Some(GearPairing { rack, gears, geometry, face_width: None })
}

fn read_gears(rack: &Node, teeth: Teeth) -> StageGeometry {
    let gear = |teeth: u32, key: &str| Gear { teeth, shift: rack.at("profile_shift").at(key).number() };
    StageGeometry {
        rack: mesh::read_rack(rack),
        sun: gear(teeth.sun, "sun"),
        planet: gear(teeth.planet, "planet"),
        ring: gear(teeth.ring, "ring"),
        // Only a stiffness by a standard uses it; a mesh with such a stiffness has its own.
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
