//! Harmonics in time: loads, errors, wall motions, stiffness variations.

use super::{curve, node::Node};
use crate::gear::Harmonic;

/// Mean and harmonics, from a list of harmonics or a measured curve with values in `units`.
pub(super) fn or_curve(node: &Node, amplitude: &str, units: &[(&str, f64)]) -> (f64, Vec<Harmonic>) {
    if curve::is_curve(node) {
        return curve::in_time(node, units).unwrap_or_default();
    }
    (0.0, read(node, amplitude))
}

pub(super) fn read_timing(node: &Node) -> (f64, f64) {
    (node.at_unit("frequency", "rad_per_s").number(), node.at_unit("phase", "rad").number())
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
