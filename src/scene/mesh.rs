//! Gear meshes in their own clock, and the rack their teeth are cut with.

use serde_json::json;

use super::{
    build, contact, law,
    node::Node,
    schedule::tooth_pairs,
    shape::{Object, Shape, Units, at_least, between, choice, list, number, positive, within},
};
use crate::{
    gear::{
        BasicRack, Gear, Material, MeshGeometry, MeshHarmonic, MeshKind, MeshStiffness, PathOfContact, Waveform,
        contact::{Law, Linear},
        geometry::{hertz_stiffness, iso_mesh_stiffness, low_load_factor},
    },
    train::{Flanks, Mesh, TrainError, mesh_damping},
};

const UNITS: Units = Units::Si;

/// A mesh: law, gap, stiffness and error.
pub(super) fn shape() -> Shape {
    let mesh = Object::new("A gear mesh; its clock runs in mesh periods, t times the mesh frequency plus the phase.")
        .needed("law", law::shape(UNITS, true), "Contact law.")
        .with_default("flanks", "both", choice(&["both", "drive"]), "Drive and back flank, or the drive flank only.")
        .free("stiffness", stiffness_shape(), "Mesh stiffness, N/m (N/m^n under a power law); none for a rigid law.")
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
    let hertz = Object::new("Hertz stiffness of the flanks at the pitch point, N/m^1.5, taken as spheres.")
        .with_default("young_pa", Material::STEEL.young, positive(), "Young's modulus of both gears.")
        .with_default("poisson", Material::STEEL.poisson, within(0.0, 0.5), "Poisson's ratio of both gears.");
    let iso = Object::new("Mean stiffness of ISO 6336-1, method B, of steel gears.")
        .needed("face_width_m", positive(), "Face width.")
        .free("line_load_n_per_m", positive(), "Load per face width: below 1e5 N/m the stiffness falls with it.");
    Shape::Either(vec![
        positive(),
        Shape::Variant {
            tag: "kind",
            cases: [("constant", constant), ("harmonic", harmonic), ("rectangular", rectangular)]
                .into_iter()
                .chain(tooth_pairs(pairs))
                .chain([("hertz", hertz), ("iso-6336", iso)])
                .collect(),
        },
    ])
}

/// Two gears in mesh, where a scene gives their teeth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Engaged {
    /// Their rack.
    pub rack: BasicRack,
    /// Driving and driven gear.
    pub gears: [Gear; 2],
    /// How they mesh.
    pub geometry: MeshGeometry,
}

impl Engaged {
    /// Two gears brought into mesh; gears that cannot mesh are a fault of the rack at `node`.
    pub fn new(node: &Node, rack: BasicRack, gears: [Gear; 2], kind: MeshKind) -> Option<Self> {
        let geometry = MeshGeometry::new(&rack, gears[0], gears[1], kind).map_err(TrainError::from);
        build::assembled(node, geometry).map(|geometry| Self { rack, gears, geometry })
    }
}

fn read_stiffness(node: &Node, law: &Law, engaged: Option<&Engaged>) -> MeshStiffness {
    let number = |key: &str| node.at(key).number();
    let pairs = |waveform| {
        let path = path_of_contact(&node.at("contact_ratio"), engaged);
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
        "constant" => MeshStiffness::Constant(number("value")),
        _ => MeshStiffness::Constant(from_teeth(node, law, engaged)),
    }
}

fn path_of_contact(ratio: &Node, engaged: Option<&Engaged>) -> PathOfContact {
    let written = ratio.clone().written().map(|r| PathOfContact { approach: 0.0, recess: r.number() });
    let path = written.or(engaged.map(|e| e.geometry.path)).unwrap_or_else(|| {
        ratio.refuse("a contact ratio >= 1", "add contact_ratio, or the rack it follows from");
        PathOfContact { approach: 0.0, recess: 1.0 }
    });
    if path.contact_ratio() < 1.0 {
        let found = format!("a contact ratio of {} from the rack", path.contact_ratio());
        ratio.fault(found, "a contact ratio >= 1: a tooth pair always in contact", "change addendum or shifts");
    }
    path
}

/// A stiffness that follows from the teeth.
fn from_teeth(node: &Node, law: &Law, engaged: Option<&Engaged>) -> f64 {
    let kind = node.at("kind");
    let Some(Engaged { rack, gears: [pinion, wheel], geometry }) = engaged else {
        kind.refuse("a stiffness in numbers, as no rack is given", "add the rack, or write the stiffness");
        return 1.0;
    };
    let hertzian = matches!(law, Law::Power(power) if power.exponent.value() == 1.5);
    let belongs = if kind.text() == "hertz" { hertzian } else { !matches!(law, Law::Power(_)) };
    if !belongs {
        kind.refuse(
            "\"hertz\" under a power law of exponent 1.5, \"iso-6336\" under a linear law",
            "choose the stiffness that belongs to the law",
        );
    }
    if kind.text() == "hertz" {
        let material = Material { young: node.at("young_pa").number(), poisson: node.at("poisson").number() };
        return hertz_stiffness(geometry.curvature_radii(), geometry.kind, [material; 2]);
    }
    let width = node.at("face_width_m").number();
    let load = node.at("line_load_n_per_m").written().map_or(1.0, |load| low_load_factor(load.number()));
    load * iso_mesh_stiffness(rack, *pinion, *wheel, geometry.kind, geometry.path.contact_ratio(), width)
}

/// The mesh written here, phase 0, between two rotary masses, with their teeth if a rack is given.
pub(super) fn read(node: &Node, rotary_masses: [f64; 2], engaged: Option<&Engaged>) -> Mesh {
    let (law_node, stiffness_node) = (node.at("law"), node.at("stiffness"));
    let flanks = if node.at("flanks").text() == "drive" { Flanks::Drive } else { Flanks::Both };
    let law = law::read(&law_node);
    let stiffness = match (&law, stiffness_node.clone().written()) {
        (Law::Rigid(_), None) => MeshStiffness::Constant(0.0),
        (Law::Rigid(_), Some(written)) => {
            written.refuse("no stiffness under a rigid law", "remove it (null over a preset), or choose another law");
            MeshStiffness::Constant(0.0)
        }
        (_, Some(written)) => read_stiffness(&written, &law, engaged),
        (_, None) => {
            stiffness_node.refuse("a stiffness > 0 or a schedule", "add stiffness: a compliant law needs one");
            MeshStiffness::Constant(1.0)
        }
    };
    let ratio = law_node.at("damping_ratio").written();
    let damping = ratio.map(|ratio| Linear { damping: mesh_damping(stiffness.mean(), ratio.number(), rotary_masses) });
    let law = match (law, damping) {
        (Law::Bilateral(_), Some(linear)) => Law::Bilateral(linear),
        (Law::KelvinVoigt(_, release), Some(linear)) => Law::KelvinVoigt(linear, release),
        (law, _) => law,
    };
    let (law, half_backlash) = contact::read_gap(node, flanks, law);
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
