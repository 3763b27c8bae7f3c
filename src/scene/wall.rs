//! A mass against a wall, or between two.

use super::{build, contact, curve, harmonics, law, load, matrices, node::Node};
use crate::{
    system::{Flanks, Spec},
    train::{WalledOscillator, Walls},
};

pub(super) fn read(node: &Node) -> Option<Spec> {
    let number = |key: &str| node.at(key).number();
    let law = law::read(&node.at("law"));
    if law.is_bilateral() {
        node.at("law").at("kind").refuse("a law that lets go", "choose \"kelvin-voigt\", \"power\" or \"rigid\"");
    }
    let (mean, motion) = harmonics::or_curve(&node.at("wall_motion"), "amplitude_m", &curve::LENGTHS);
    let (constant, schedule) = load::or_schedule(&node.at("load_n"), &curve::FORCES, None);
    let (load, load_harmonics) = harmonics::or_curve(&node.at("load_harmonics"), "amplitude_n", &curve::FORCES);
    let wall = node.at("wall");
    let position = wall.at("position_m").number() + mean;
    let (walls, law) = match wall.at("side").text() {
        "above" => (Walls::Above { position }, law),
        "below" => (Walls::Below { position }, law),
        _ => {
            let half_gap = wall.at("half_gap_m");
            if mean != 0.0 {
                let found = format!("a motion of mean {mean:e} m");
                node.at("wall_motion").fault(found, "a motion about 0", "subtract the mean from the values");
            }
            let (law, half_gap) = contact::close(&half_gap, half_gap.number(), Flanks::Both, law);
            (Walls::Between { half_gap }, law)
        }
    };
    let walled = WalledOscillator {
        mass: number("mass_kg"),
        damping: number("damping_n_s_per_m"),
        stiffness: number("stiffness_n_per_m"),
        load: load + if schedule.is_some() { 0.0 } else { constant },
        load_harmonics,
        walls,
        motion,
        contact_stiffness: contact::read_stiffness(&node.at("contact_stiffness"), &law),
        law,
        omega: None,
    };
    let mut spec = build::assembled(node, walled.assemble())?;
    if let Some(factor) = schedule {
        load::follow(&mut spec, factor, [vec![load], vec![1.0]]);
    }
    spec.omega = matrices::base_frequency(node, &spec);
    Some(spec)
}
