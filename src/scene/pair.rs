//! A pair of gears with real teeth.

use super::{
    body, build, curve, load,
    mesh::{self, GearPairing},
    node::Node,
    plausible::{self, LUMPED},
};
use crate::{
    gear::{Gear, MeshKind},
    system::Spec,
    train::GearPair,
};

pub(super) fn read(node: &Node) -> Option<Spec> {
    let (driving, driven) = (node.at("driving"), node.at("driven"));
    let gear = |node: &Node| Gear { teeth: node.at("teeth").whole() as u32, shift: node.at("profile_shift").number() };
    let rack = node.at("rack");
    let gears = [gear(&driving), gear(&driven)];
    let engaged = GearPairing::new(&rack, mesh::read_rack(&rack), gears, MeshKind::External, [&driving, &driven])?;
    let [first, second] = engaged.geometry.base_radii.map(Some);
    let (one, two) = (body::read(&driving, first), body::read(&driven, second));
    let mut mesh = mesh::read(&node.at("mesh"), [one.rotary_mass, two.rotary_mass], Some(&engaged));
    mesh.phase = node.at("mesh_phase").number();
    let rpm = node.at("speed_rpm").number();
    let teeth = engaged.mesh("mesh", rpm.abs() / 60.0 * f64::from(gears[0].teeth), vec![mesh.phase]);
    plausible::mesh(&node.at("mesh"), &rack, &mesh, &teeth);
    for (k, (gear, body)) in [(&driving, &one), (&driven, &two)].into_iter().enumerate() {
        plausible::inertia(gear, (body.mass, body.inertia()), &teeth, k, LUMPED);
    }
    let turn = (rpm != 0.0).then(|| 60.0 / rpm.abs());
    let (torque, schedule) = load::or_schedule(&node.at("torque_nm"), &curve::TORQUES, turn);
    let pair = GearPair {
        driving_teeth: gears[0].teeth,
        driving: one,
        driven: two,
        pressure_angle: engaged.geometry.pressure_angle,
        base_helix: engaged.rack.base_helix(),
        mesh,
        rpm,
        torque,
    };
    let translational = node.at("freedoms").text() == "torsional-translational";
    let assemble = |pair: &GearPair| if translational { pair.translational() } else { pair.torsional() };
    let mut spec = build::assembled(node, assemble(&pair))?;
    plausible::train(node, &spec, std::slice::from_ref(&teeth));
    if let Some(factor) = schedule {
        let load = |torque: f64| Some(build::assembled(node, assemble(&GearPair { torque, ..pair.clone() }))?.load);
        load::follow(&mut spec, factor, [load(0.0)?, load(1.0)?]);
    }
    node.meshes(vec![teeth]);
    node.drawing(pair.drawing(translational));
    Some(spec)
}
