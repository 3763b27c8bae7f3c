//! Gear meshes in their own clock, and the rack their teeth are cut with.

use serde_json::json;

use super::{
    contact, law,
    node::Node,
    shape::{Object, Shape, Units, at_least, between, choice, list, number, positive, within},
};
use crate::{
    gear::{BasicRack, MeshHarmonic, MeshStiffness, PathOfContact, Waveform},
    train::{Flanks, Mesh, mesh_damping},
};

const UNITS: Units = Units::Si;

/// A mesh: law, gap, stiffness and error.
pub(super) fn shape() -> Shape {
    let mesh = Object::new("A gear mesh; its clock runs in mesh periods, t times the mesh frequency plus the phase.")
        .needed("law", law::shape(UNITS, true), "Contact law.")
        .with_default("flanks", "both", choice(&["both", "drive"]), "Drive and back flank, or the drive flank only.")
        .needed("stiffness", stiffness_shape(), "Mesh stiffness, N/m (N/m^n under a power law).")
        .with_default("error", json!([]), harmonics_shape("amplitude_m"), "Transmission error, a sum of sines.")
        .with_default("error_offset_m", 0.0, number(), "Constant part of the error.");
    Shape::Object(contact::gap(mesh, UNITS))
}

/// Harmonics of the mesh frequency.
fn harmonics_shape(amplitude: &str) -> Shape {
    list(Shape::Object(
        Object::new("A harmonic of the mesh frequency.")
            .needed("order", positive(), "Order: 1 for the mesh frequency itself.")
            .needed(amplitude, number(), "Amplitude.")
            .with_default("phase_rad", 0.0, number(), "Phase.")
            .mistake("harmonic", "write order"),
    ))
}

fn read_harmonics(node: &Node, amplitude: &str) -> Vec<MeshHarmonic> {
    let number = |item: &Node, key: &str| item.at(key).number();
    node.items()
        .iter()
        .map(|item| MeshHarmonic {
            order: number(item, "order"),
            amplitude: number(item, amplitude),
            phase: number(item, "phase_rad"),
        })
        .collect()
}

fn stiffness_shape() -> Shape {
    let pairs = |about| {
        Object::new(about)
            .needed("mean", positive(), "Mean stiffness.")
            .free("contact_ratio", within(1.0, 8.0), "Contact ratio; that of the geometry if left out.")
            .with_default("modulation", 1.0, within(0.0, 1.0), "Share that follows the number of tooth pairs.")
    };
    let constant = Object::new("The same at all times.").needed("value", positive(), "Stiffness.");
    let harmonic = Object::new("mean (1 + sum of amplitude cos(2 pi order clock + phase)).")
        .needed("mean", positive(), "Mean stiffness.")
        .needed("harmonics", harmonics_shape("amplitude"), "Harmonics, relative to the mean.");
    let rectangular = Object::new("high for the first part of the mesh period, else low.")
        .needed("high", positive(), "Stiffness at the start of the period.")
        .needed("low", at_least(0.0), "Stiffness in the rest of the period.")
        .needed("duty", between(0.0, 1.0), "Fraction of the period at high.");
    let ramps = pairs("Number of tooth pairs in contact, each entry and exit a ramp.").needed(
        "ramp",
        between(0.0, 0.5),
        "Half width of a ramp, fraction of the period.",
    );
    let fourier = pairs("Fourier series of the number of tooth pairs in contact, cut off.").needed(
        "orders",
        Shape::Whole { min: 1, max: 1000 },
        "Harmonics kept.",
    );
    Shape::Either(vec![
        positive(),
        Shape::Variant {
            tag: "kind",
            cases: vec![
                ("constant", constant),
                ("harmonic", harmonic),
                ("rectangular", rectangular),
                ("tooth-pairs", pairs("Number of tooth pairs in contact, rectangular.")),
                ("tooth-pairs-trapezoidal", ramps),
                ("fourier", fourier),
            ],
        },
    ])
}

fn read_stiffness(node: &Node, path: Option<PathOfContact>) -> MeshStiffness {
    let number = |key: &str| node.at(key).number();
    let pairs = |waveform| {
        let ratio = node.at("contact_ratio");
        let written = ratio.clone().written().map(|r| PathOfContact { approach: 0.0, recess: r.number() });
        let path = written.or(path).unwrap_or_else(|| {
            ratio.refuse("a contact ratio >= 1", "add contact_ratio, or the geometry it follows from");
            PathOfContact { approach: 0.0, recess: 1.0 }
        });
        if path.contact_ratio() < 1.0 {
            let found = format!("a contact ratio of {} from the geometry", path.contact_ratio());
            ratio.fault(found, "a contact ratio >= 1: a tooth pair always in contact", "change addendum or shifts");
        }
        MeshStiffness::Pairs { mean: number("mean"), path, waveform, modulation: number("modulation") }
    };
    if node.is_number() {
        return MeshStiffness::Constant(node.number());
    }
    match node.at("kind").text() {
        "harmonic" => {
            let harmonics = read_harmonics(&node.at("harmonics"), "amplitude");
            MeshStiffness::Harmonics { mean: number("mean"), harmonics }
        }
        "rectangular" => MeshStiffness::Rectangular { high: number("high"), low: number("low"), duty: number("duty") },
        "tooth-pairs" => pairs(Waveform::Rectangular),
        "tooth-pairs-trapezoidal" => pairs(Waveform::Trapezoidal { ramp: number("ramp") }),
        "fourier" => pairs(Waveform::Fourier { harmonics: node.at("orders").whole() as u32 }),
        _ => MeshStiffness::Constant(number("value")),
    }
}

/// The mesh written here, phase 0, between two rotary masses, with its path of contact if the geometry is known.
pub(super) fn read(node: &Node, rotary_masses: [f64; 2], path: Option<PathOfContact>) -> Mesh {
    let stiffness = read_stiffness(&node.at("stiffness"), path);
    let damping = |ratio: f64| mesh_damping(stiffness.mean(), ratio, rotary_masses);
    let flanks = if node.at("flanks").text() == "drive" { Flanks::Drive } else { Flanks::Both };
    let (law, half_backlash) = contact::read_gap(node, flanks, law::read(&node.at("law"), Some(&damping)));
    Mesh {
        error: read_harmonics(&node.at("error"), "amplitude_m"),
        error_offset: node.at("error_offset_m").number(),
        half_backlash,
        flanks,
        ..Mesh::new(law, stiffness)
    }
}

/// A reference rack.
pub(super) fn rack_shape() -> Object {
    angle(
        Object::new("Reference rack of the teeth.")
            .needed("module_m", positive(), "Module.")
            .with_default("addendum", 1.0, positive(), "Addendum, modules.")
            .with_default("dedendum", 1.25, positive(), "Dedendum, modules."),
        "pressure_angle",
        true,
    )
}

/// An angle that may be written in radians or in degrees.
pub(super) fn angle(object: Object, stem: &str, needed: bool) -> Object {
    let keys = [format!("{stem}_rad"), format!("{stem}_deg")];
    let object = object.free(keys[0].clone(), within(0.0, 1.5), "The angle in radians.").free(
        keys[1].clone(),
        within(0.0, 85.0),
        "The angle in degrees.",
    );
    if needed { object.exactly_one(keys) } else { object.at_most_one(keys) }
}

/// The angle written here in either unit, rad.
pub(super) fn read_angle(node: &Node, stem: &str) -> Option<f64> {
    let degrees = node.at(&format!("{stem}_deg")).written().map(|angle| angle.number().to_radians());
    node.at(&format!("{stem}_rad")).written().map(|angle| angle.number()).or(degrees)
}

/// The rack written here.
pub(super) fn read_rack(node: &Node) -> BasicRack {
    BasicRack {
        module: node.at("module_m").number(),
        pressure_angle: read_angle(node, "pressure_angle").unwrap_or(f64::NAN),
        addendum: node.at("addendum").number(),
        dedendum: node.at("dedendum").number(),
    }
}
