//! Rigid bodies and what holds them.

use serde_json::json;

use super::{
    node::Node,
    shape::{Object, Shape, at_least, positive},
};
use crate::train::{Body, Damping, Support};

/// The keys of a body, added to those of a gear or a carrier.
pub(super) fn keys(object: Object) -> Object {
    object
        .needed("mass_kg", positive(), "Mass.")
        .free("inertia_kg_m2", positive(), "Moment of inertia I about the centre.")
        .free("rotary_mass_kg", positive(), "I/r^2 with the radius on which the rotation is counted.")
        .exactly_one(["inertia_kg_m2", "rotary_mass_kg"])
        .free("radius_m", positive(), "Radius of u = r theta: base radius of a gear, centre distance of a carrier.")
        .free("outer_radius_m", positive(), "Where the body's material ends: its inertia is checked against it.")
        .with_default("translation", json!({}), support(), "What holds its centre.")
        .with_default("rotation", json!({}), support(), "What holds its rotation, as a stiffness on u = r theta.")
        .mistake("inertia", "write inertia_kg_m2")
        .mistake("base_radius_m", "write radius_m")
}

fn support() -> Shape {
    Shape::Object(
        Object::new("Spring and damper; nothing written is free.")
            .with_default("stiffness_n_per_m", 0.0, at_least(0.0), "Stiffness.")
            .free("damping_n_s_per_m", at_least(0.0), "Damping; 0 if neither key is written.")
            .free("damping_ratio", at_least(0.0), "2 ratio sqrt(k m).")
            .at_most_one(["damping_n_s_per_m", "damping_ratio"]),
    )
}

/// The body written here; `radius` is the one its geometry gives, if that is known.
pub(super) fn read(node: &Node, radius: Option<f64>) -> Body {
    let radius_node = node.at("radius_m");
    let radius = radius_node.clone().written().map(|r| r.number()).or(radius).unwrap_or_else(|| {
        radius_node.refuse("a radius > 0", "add radius_m, or the geometry it follows from");
        1.0
    });
    let inertia = node.at("inertia_kg_m2").number();
    let body = Body::new(node.at("mass_kg").number(), inertia, radius);
    Body {
        rotary_mass: node.at("rotary_mass_kg").written().map_or(body.rotary_mass, |mass| mass.number()),
        outer_radius: node.at("outer_radius_m").written().map(|r| r.number()),
        translation: read_support(&node.at("translation")),
        rotation: read_support(&node.at("rotation")),
        ..body
    }
}

fn read_support(node: &Node) -> Support {
    let viscous = node.at("damping_n_s_per_m").written().map_or(0.0, |damping| damping.number());
    let ratio = node.at("damping_ratio").written().map(|ratio| Damping::Ratio(ratio.number()));
    Support { stiffness: node.at("stiffness_n_per_m").number(), damping: ratio.unwrap_or(Damping::Viscous(viscous)) }
}
