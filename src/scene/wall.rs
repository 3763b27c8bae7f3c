//! A mass against a wall, or between two.

use serde_json::json;

use super::{
    build, contact, harmonics, law, matrices,
    node::Node,
    schedule,
    shape::{Object, Shape, Units, at_least, number, positive},
};
use crate::{
    gear::contact::Law,
    train::{Flanks, Spec, Walled, Walls},
};

const UNITS: Units = Units::Si;

/// A mass on an optional spring, loads on it, and walls that stop it.
pub(super) fn shape() -> Object {
    let one = |about| Object::new(about).needed("position_m", number(), "Position of the mass at touch.");
    let walls = Shape::Variant {
        tag: "side",
        cases: vec![
            ("above", one("A wall above: the mass stays at or below the position.")),
            ("below", one("A wall below: the mass stays at or above the position.")),
            (
                "both",
                Object::new("Two walls: the mass stays within half the gap from 0.").needed(
                    "half_gap_m",
                    at_least(0.0),
                    "Half the gap.",
                ),
            ),
        ],
    };
    Object::new("A mass against a wall, or between two.")
        .needed("mass_kg", positive(), "Mass.")
        .with_default("damping_n_s_per_m", 0.0, at_least(0.0), "Damper to ground, in contact or not.")
        .with_default("stiffness_n_per_m", 0.0, at_least(0.0), "Spring to ground, at rest at 0.")
        .with_default("load_n", 0.0, number(), "Constant load.")
        .with_default("load_harmonics", json!([]), harmonics::shape(UNITS, "amplitude_n"), "Harmonic loads.")
        .needed("wall", walls, "Where the wall stands.")
        .with_default("wall_motion", json!([]), harmonics::shape(UNITS, "amplitude_m"), "Motion of the wall, along x.")
        .needed("law", law::shape(UNITS, false), "Contact law; not bilateral.")
        .free("contact_stiffness", schedule::shape(UNITS), "N/m (N/m^n under a power law); none if rigid.")
        .free("base_frequency_rad_per_s", positive(), "Frequency of one cycle; that of the excitation if left out.")
}

/// The train written here.
pub(super) fn read(node: &Node) -> Option<Spec> {
    let number = |key: &str| node.at(key).number();
    let law = law::read(&node.at("law"));
    if let Law::Bilateral(_) = law {
        node.at("law").at("kind").refuse("a law that lets go", "choose \"kelvin-voigt\", \"power\" or \"rigid\"");
    }
    let wall = node.at("wall");
    let position = wall.at("position_m").number();
    let (walls, law) = match wall.at("side").text() {
        "above" => (Walls::Above { position }, law),
        "below" => (Walls::Below { position }, law),
        _ => {
            let half_gap = wall.at("half_gap_m");
            let (law, half_gap) = contact::close(&half_gap, half_gap.number(), Flanks::Both, law);
            (Walls::Between { half_gap }, law)
        }
    };
    let walled = Walled {
        mass: number("mass_kg"),
        damping: number("damping_n_s_per_m"),
        stiffness: number("stiffness_n_per_m"),
        load: number("load_n"),
        load_harmonics: harmonics::read(&node.at("load_harmonics"), "amplitude_n"),
        walls,
        motion: harmonics::read(&node.at("wall_motion"), "amplitude_m"),
        contact_stiffness: contact::read_stiffness(&node.at("contact_stiffness"), &law),
        law,
        omega: None,
    };
    let mut spec = build::assembled(node, walled.assemble())?;
    spec.omega = matrices::base_frequency(node, &spec);
    Some(spec)
}
