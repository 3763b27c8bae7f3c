//! A pair of gears with real teeth.

use super::{
    body, build,
    mesh::{self, Engaged},
    node::Node,
    shape::{Object, Shape, at_least, choice, number, within},
};
use crate::{
    gear::{Gear, MeshKind},
    train::{GearPair, Spec},
};

/// Teeth of a gear.
pub(super) fn teeth() -> Shape {
    Shape::Whole { min: 3, max: 100_000 }
}

/// Two external gears, their teeth, bodies and mesh.
pub(super) fn shape() -> Object {
    let gear = |about| {
        Shape::Object(body::keys(Object::new(about)).needed("teeth", teeth(), "Tooth number.").with_default(
            "profile_shift",
            0.0,
            within(-2.0, 2.0),
            "Profile shift, modules.",
        ))
    };
    Object::new("Two external gears; gear 1 drives.")
        .with_default("freedoms", "torsional", choice(&["torsional", "torsional-translational"]), "Freedoms kept.")
        .needed("rack", Shape::Object(mesh::rack_shape()), "Reference rack.")
        .needed("driving", gear("The driving gear."), "Driving gear.")
        .needed("driven", gear("The driven gear."), "Driven gear.")
        .needed("mesh", mesh::shape(), "The mesh.")
        .with_default("mesh_phase", 0.0, number(), "Phase of the mesh, periods.")
        .needed("speed_rpm", at_least(0.0), "Speed of the driving gear.")
        .needed("torque_nm", number(), "Torque on the driving gear; the driven gear's load balances it.")
        .mistake("load_nm", "write torque_nm, the torque on the driving gear")
}

/// The train written here.
pub(super) fn read(node: &Node) -> Option<Spec> {
    let (driving, driven) = (node.at("driving"), node.at("driven"));
    let gear = |node: &Node| Gear { teeth: node.at("teeth").whole() as u32, shift: node.at("profile_shift").number() };
    let rack = node.at("rack");
    let gears = [gear(&driving), gear(&driven)];
    let engaged = Engaged::new(&rack, mesh::read_rack(&rack), gears, MeshKind::External)?;
    let [first, second] = engaged.geometry.base_radii.map(Some);
    let (one, two) = (body::read(&driving, first), body::read(&driven, second));
    let mut mesh = mesh::read(&node.at("mesh"), [one.rotary_mass, two.rotary_mass], Some(&engaged));
    mesh.phase = node.at("mesh_phase").number();
    let pair = GearPair {
        driving_teeth: gears[0].teeth,
        driving: one,
        driven: two,
        pressure_angle: engaged.geometry.pressure_angle,
        mesh,
        rpm: node.at("speed_rpm").number(),
        torque: node.at("torque_nm").number(),
    };
    let translational = node.at("freedoms").text() == "torsional-translational";
    build::assembled(node, if translational { pair.translational() } else { pair.torsional() })
}
