//! Harmonics in time: loads, errors, wall motions, stiffness variations.

use std::f64::consts::FRAC_PI_2;

use super::{curve, node::Node};
use crate::gear::Harmonic;

/// Reads mean and harmonics, from a list of harmonics or a measured curve with values in `units`.
pub(super) fn or_curve(node: &Node, amplitude: &str, units: &[(&str, f64)]) -> (f64, Vec<Harmonic>) {
    if curve::is_curve(node) {
        return curve::in_time(node, units).unwrap_or_default();
    }
    (0.0, read(node, amplitude))
}

pub(super) fn read_timing(node: &Node) -> (f64, f64) {
    (node.at_unit("frequency", "rad_per_s").number(), read_phase(node, "cosine"))
}

/// Reads a phase, rad, relative to the `usual` function, in degrees or radians and of a sine or a cosine.
pub(super) fn read_phase(node: &Node, usual: &str) -> f64 {
    let (phase, degrees) = (node.at_unit("phase", "rad").number(), node.at("phase_deg").written());
    let phase = degrees.map_or(phase, |degrees| {
        if phase != 0.0 {
            degrees.refuse("one phase, in degrees or in radians", "remove one of them");
        }
        degrees.number().to_radians()
    });
    match (node.at("function").text(), usual) {
        ("sine", "cosine") => phase - FRAC_PI_2,
        ("cosine", "sine") => phase + FRAC_PI_2,
        _ => phase,
    }
}

pub(super) fn read(node: &Node, amplitude: &str) -> Vec<Harmonic> {
    node.items()
        .iter()
        .map(|item| {
            let (omega, phase) = read_timing(item);
            Harmonic { omega, amplitude: item.at(amplitude).number(), phase }
        })
        .collect()
}
