//! Harmonics in time: loads, errors, wall motions, stiffness variations.

use super::{
    node::Node,
    shape::{Object, Shape, Units, list, number, positive},
};
use crate::gear::Harmonic;

/// A list of harmonics whose amplitude is written under `amplitude`.
pub(super) fn shape(units: Units, amplitude: &str) -> Shape {
    list(Shape::Object(timing(Object::new("A harmonic, amplitude times cos(frequency t + phase)."), units).needed(
        amplitude,
        number(),
        "Amplitude.",
    )))
}

/// The keys that place a harmonic in time.
pub(super) fn timing(object: Object, units: Units) -> Object {
    object
        .needed(units.key("frequency", "rad_per_s"), positive(), "Angular frequency.")
        .with_default(units.key("phase", "rad"), 0.0, number(), "Phase of the cosine.")
        .mistake("frequency_hz", "write frequency_rad_per_s: 2 pi times the frequency in Hz")
        .mistake("phase_deg", "write phase_rad")
}

/// Frequency and phase.
pub(super) fn read_timing(node: &Node) -> (f64, f64) {
    (node.at_unit("frequency", "rad_per_s").number(), node.at_unit("phase", "rad").number())
}

/// The harmonics of a list.
pub(super) fn read(node: &Node, amplitude: &str) -> Vec<Harmonic> {
    node.items()
        .iter()
        .map(|item| {
            let (omega, phase) = read_timing(item);
            Harmonic { omega, amplitude: item.at(amplitude).number(), phase }
        })
        .collect()
}
