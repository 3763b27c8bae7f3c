//! Rigid bodies and their supports.

use super::{node::Node, plausible};
use crate::train::{Body, Damping, Support};

/// Reads a body; `radius` is that of its geometry, if known.
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

pub(super) fn read_support(node: &Node) -> Support {
    plausible::support(node);
    let viscous = node.at("damping_n_s_per_m").written().map_or(0.0, |damping| damping.number());
    let ratio = node.at("damping_ratio").written().map(|ratio| Damping::Ratio(ratio.number()));
    Support { stiffness: node.at("stiffness_n_per_m").number(), damping: ratio.unwrap_or(Damping::Viscous(viscous)) }
}
