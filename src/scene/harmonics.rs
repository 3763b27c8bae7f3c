//! Harmonics in time: loads, errors, wall motions, stiffness variations.

use super::node::Node;
use crate::gear::Harmonic;

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
