//! Gear meshes in their own clock, and the rack of their teeth.

use super::{
    build, contact,
    curve::{self, OverMesh},
    harmonics, law,
    node::Node,
};
use crate::{
    gear::{
        BasicRack, Gear, Material, MeshGeometry, MeshHarmonic, MeshKind, MeshStiffness, PathOfContact, Waveform,
        contact::{Law, Linear},
        geometry::{hertz_stiffness, iso_mesh_stiffness, low_load_factor},
    },
    system::Flanks,
    train::{Mesh, MeshBack, TrainError, mesh_damping},
};

/// Reads the harmonics of an error, as sines.
fn read_sines(node: &Node) -> Vec<MeshHarmonic> {
    let harmonic = |item: &Node| MeshHarmonic {
        order: item.at("order").number(),
        amplitude: item.at("amplitude_m").number(),
        phase: harmonics::read_phase(item, "sine"),
    };
    node.items().iter().map(harmonic).collect()
}

/// Reads the harmonics of a stiffness, as cosines relative to its `mean`.
fn read_cosines(node: &Node, mean: f64) -> Vec<MeshHarmonic> {
    let harmonic = |item: &Node| MeshHarmonic {
        order: item.at("order").number(),
        amplitude: item
            .at("amplitude")
            .written()
            .map_or_else(|| item.at("amplitude_n_per_m").number() / mean, |a| a.number()),
        phase: harmonics::read_phase(item, "cosine"),
    };
    node.items().iter().map(harmonic).collect()
}

/// Two gears in mesh, as parts of a train.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ToothMesh {
    /// Name; that of the contact if there is one.
    pub name: String,
    /// Reference rack.
    pub rack: BasicRack,
    /// Pinion and wheel, or pinion and ring.
    pub gears: [Gear; 2],
    /// True if the rack is given; else it follows from base radii and working angle without profile shift.
    pub is_given: bool,
    /// Geometry at its working position.
    pub geometry: MeshGeometry,
    /// Common face width, m, if one is given.
    pub face_width: Option<f64>,
    /// Mesh frequency, Hz; 0 for a train at rest.
    pub frequency: f64,
    /// Mesh phases, periods, one for each of its contacts.
    pub phases: Vec<f64>,
}

/// Two gears in mesh, if a scene gives their teeth.
#[derive(Clone, Copy, Debug)]
pub(super) struct GearPairing {
    pub rack: BasicRack,
    pub gears: [Gear; 2],
    pub geometry: MeshGeometry,
    /// Common face width, m, if one is given.
    pub face_width: Option<f64>,
}

impl GearPairing {
    /// Returns two gears in mesh, pinion first, with the given face widths; gears that cannot mesh are a fault at `node`.
    pub fn new(node: &Node, rack: BasicRack, gears: [Gear; 2], kind: MeshKind, widths: [&Node; 2]) -> Option<Self> {
        let geometry = MeshGeometry::new(&rack, gears[0], gears[1], kind).map_err(TrainError::from);
        Some(Self::with(rack, gears, build::assembled(node, geometry)?, widths))
    }

    /// Returns two gears in mesh, pinion first, with a given geometry.
    pub fn with(rack: BasicRack, gears: [Gear; 2], mut geometry: MeshGeometry, widths: [&Node; 2]) -> Self {
        let written = widths.map(|gear| gear.at("face_width_m").written().map(|width| width.number()));
        let face_width = written.into_iter().flatten().reduce(f64::min);
        geometry.path.overlap = face_width.map_or(0.0, |width| rack.overlap(width));
        Self { rack, gears, geometry, face_width }
    }

    /// Returns the mesh with the clock of its contacts: mesh frequency, Hz, and a phase for each of them, periods.
    pub fn mesh(&self, name: &str, frequency: f64, phases: Vec<f64>) -> ToothMesh {
        let Self { rack, gears, geometry, face_width } = *self;
        ToothMesh { name: name.to_owned(), rack, is_given: true, gears, geometry, face_width, frequency, phases }
    }
}

fn read_stiffness(node: &Node, law: &Law, engaged: Option<&GearPairing>) -> MeshStiffness {
    let number = |key: &str| node.at(key).number();
    let pairs = |waveform| {
        let path = path_of_contact(&node.at("contact_ratio"), engaged);
        if engaged.is_some_and(|e| e.rack.helix_angle > 0.0 && e.face_width.is_none()) {
            node.at("kind").fault(
                "lines of contact of helical teeth without a face width",
                "a face width of one of the gears at least",
                "add face_width_m to the gears, or give the stiffness another kind",
            );
        }
        MeshStiffness::Pairs { mean: number("mean"), path, waveform, modulation: number("modulation") }
    };
    if node.is_number() {
        return MeshStiffness::Constant(node.number());
    }
    match node.at("kind").text() {
        "harmonic" => {
            let harmonics = read_cosines(&node.at("harmonics"), number("mean"));
            MeshStiffness::Harmonics { mean: number("mean"), harmonics }
        }
        "curve" => curve_stiffness(node, engaged).unwrap_or(MeshStiffness::Constant(1.0)),
        "rectangular" => MeshStiffness::Rectangular { high: number("high"), low: number("low"), duty: number("duty") },
        "tooth-pairs" => pairs(Waveform::Rectangular),
        "tooth-pairs-trapezoidal" => pairs(Waveform::Trapezoidal { ramp: number("ramp") }),
        "fourier" => pairs(Waveform::Fourier { harmonics: node.at("orders").whole() as u32 }),
        "constant" => MeshStiffness::Constant(number("value")),
        _ => MeshStiffness::Constant(from_teeth(node, law, engaged)),
    }
}

/// Reads a measured stiffness, as lines or as a series.
fn curve_stiffness(node: &Node, engaged: Option<&GearPairing>) -> Option<MeshStiffness> {
    let OverMesh { curve, periods } = curve::over_mesh(node, &curve::STIFFNESSES, teeth(engaged))?;
    let curve = curve::stiffness(node, curve)?;
    if node.at("as").text() == "lines" {
        return Some(MeshStiffness::Lines { curve, periods });
    }
    let (mean, harmonics) = curve::relative_series(node, &curve);
    let own = |h: MeshHarmonic| MeshHarmonic { order: h.order / f64::from(periods), ..h };
    Some(MeshStiffness::Harmonics { mean, harmonics: harmonics.into_iter().map(own).collect() })
}

fn teeth(engaged: Option<&GearPairing>) -> Option<[u32; 2]> {
    engaged.map(|engaged| engaged.gears.map(|gear| gear.teeth))
}

fn path_of_contact(ratio: &Node, engaged: Option<&GearPairing>) -> PathOfContact {
    let of_teeth = engaged.map(|e| e.geometry.path);
    let overlap = of_teeth.map_or(0.0, |path| path.overlap);
    let written = ratio.clone().written().map(|r| PathOfContact { approach: 0.0, recess: r.number(), overlap });
    let path = written.or(of_teeth).unwrap_or_else(|| {
        ratio.refuse("a contact ratio >= 1", "add contact_ratio, or the rack it follows from");
        PathOfContact { recess: 1.0, ..PathOfContact::default() }
    });
    let total = path.contact_ratio() + path.overlap;
    if total < 1.0 {
        let found = format!("a contact ratio of {total} from the rack");
        ratio.fault(found, "a contact ratio >= 1: a tooth pair always in contact", "change addendum or shifts");
    }
    path
}

/// Returns a stiffness that follows from the teeth, N/m.
fn from_teeth(node: &Node, law: &Law, engaged: Option<&GearPairing>) -> f64 {
    let kind = node.at("kind");
    let Some(GearPairing { rack, gears: [pinion, wheel], geometry, face_width }) = engaged else {
        kind.refuse("a stiffness in numbers, as no rack is given", "add the rack, or write the stiffness");
        return 1.0;
    };
    let hertzian = law.power().is_some_and(|power| power.exponent.value() == 1.5);
    let belongs = if kind.text() == "hertz" { hertzian } else { law.power().is_none() };
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
    let width_node = node.at("face_width_m");
    let width = width_node.clone().written().map(|width| width.number()).or(*face_width).unwrap_or_else(|| {
        width_node.refuse("a face width > 0", "add face_width_m here or to the gears");
        1.0
    });
    let load = node.at("line_load_n_per_m").written().map_or(1.0, |load| low_load_factor(load.number()));
    load * iso_mesh_stiffness(rack, *pinion, *wheel, geometry.kind, geometry.path.contact_ratio(), width)
}

/// Reads a mesh, phase 0, between two rotary masses, with its teeth if a rack is given.
pub(super) fn read(node: &Node, rotary_masses: [f64; 2], engaged: Option<&GearPairing>) -> Mesh {
    let (law_node, stiffness_node) = (node.at("law"), node.at("stiffness"));
    let flanks = if node.at("flanks").text() == "drive" { Flanks::Drive } else { Flanks::Both };
    let law = law::read(&law_node);
    let stiffness = own_stiffness(&stiffness_node, &law, engaged);
    let ratio = law_node.at("damping_ratio").written();
    // Along the normal of helical teeth a rotation moves less, and its effective mass is larger.
    let normal = engaged.map_or(1.0, |e| libm::cos(e.geometry.base_helix).powi(2));
    let masses = rotary_masses.map(|mass| mass / normal);
    let damping = ratio.map(|ratio| Linear { damping: mesh_damping(stiffness.mean(), ratio.number(), masses) });
    let law = match (law, damping) {
        (Law::Bilateral(_), Some(linear)) => Law::Bilateral(linear),
        (Law::KelvinVoigt(_, release), Some(linear)) => Law::KelvinVoigt(linear, release),
        (law, _) => law,
    };
    let (law, half_backlash) = contact::read_gap(node, flanks, law);
    let (mean, error) = read_error(&node.at("error"), engaged);
    let error_offset = node.at("error_offset_m").number() + mean;
    let mut mesh = Mesh { error, error_offset, half_backlash, flanks, ..Mesh::new(law, stiffness) };
    mesh.gap_damping = node.at("gap_damping_n_s_per_m").number();
    mesh.back = node.at("back_flank").written().map(|back| read_back(&back, &mesh, engaged));
    let (thicker, thickness) = read_error(&node.at("thickness_error"), engaged);
    if thicker != 0.0 || !thickness.is_empty() {
        thicken(&mut mesh, thicker, &thickness);
    }
    if let Some(back) = &mesh.back {
        let size = |list: &[MeshHarmonic]| list.iter().map(|h| h.amplitude.abs()).sum::<f64>();
        node.remark(format!(
            "flanks that differ: mean stiffness {:.4e} and {:.4e} N/m, errors up to {:.3e} and {:.3e} m",
            mesh.stiffness.mean(),
            back.stiffness.mean(),
            size(&mesh.error),
            size(&back.error)
        ));
    }
    if mesh.back.is_some() && (flanks == Flanks::Drive || mesh.law.is_bilateral()) {
        let key = if node.at("back_flank").written().is_some() { "back_flank" } else { "thickness_error" };
        node.at(key).fault(
            "flanks that differ",
            "a mesh with two flanks and a gap",
            "remove it, or give the mesh both flanks",
        );
    }
    mesh
}

/// Reads the stiffness of a law: one for a compliant law, none for a rigid one.
fn own_stiffness(node: &Node, law: &Law, engaged: Option<&GearPairing>) -> MeshStiffness {
    match (law, node.clone().written()) {
        (Law::Rigid(_), None) => MeshStiffness::Constant(0.0),
        (Law::Rigid(_), Some(written)) => {
            written.refuse("no stiffness under a rigid law", "remove it (null over a preset), or choose another law");
            MeshStiffness::Constant(0.0)
        }
        (_, Some(written)) => read_stiffness(&written, law, engaged),
        (_, None) => {
            node.refuse("a stiffness > 0 or a schedule", "add stiffness: a compliant law needs one");
            MeshStiffness::Constant(1.0)
        }
    }
}

/// Reads mean and harmonics of an error.
fn read_error(node: &Node, engaged: Option<&GearPairing>) -> (f64, Vec<MeshHarmonic>) {
    let measured = curve::is_curve(node).then(|| curve::mesh_error(node, teeth(engaged))).flatten();
    measured.unwrap_or_else(|| (0.0, read_sines(node)))
}

/// Reads the back flank; missing keys are those of the drive flank.
fn read_back(node: &Node, mesh: &Mesh, engaged: Option<&GearPairing>) -> MeshBack {
    let stiffness = node.at("stiffness").written().map(|written| own_stiffness(&written, &mesh.law, engaged));
    let error = node.at("error").written().map(|written| read_error(&written, engaged));
    let offset = node.at("error_offset_m").written().map(|offset| offset.number());
    let mean = error.as_ref().map_or(0.0, |(mean, _)| *mean);
    MeshBack {
        stiffness: stiffness.unwrap_or_else(|| mesh.stiffness.clone()),
        error_offset: offset.unwrap_or(if error.is_some() { 0.0 } else { mesh.error_offset }) + mean,
        error: error.map_or_else(|| mesh.error.clone(), |(_, error)| error),
        phase: node.at("phase").number(),
    }
}

/// Adds half an excess of thickness to each flank.
fn thicken(mesh: &mut Mesh, mean: f64, harmonics: &[MeshHarmonic]) {
    let mut back = mesh.back.take().unwrap_or_else(|| MeshBack {
        stiffness: mesh.stiffness.clone(),
        error: mesh.error.clone(),
        error_offset: mesh.error_offset,
        phase: 0.0,
    });
    // The error of the drive flank opens it, that of the back flank closes it. The back flank is ahead in the clock of the mesh.
    let part = |share: f64, ahead: f64| {
        let of = move |h: &MeshHarmonic| MeshHarmonic {
            amplitude: share * h.amplitude,
            phase: h.phase - std::f64::consts::TAU * h.order * ahead,
            ..*h
        };
        harmonics.iter().map(of)
    };
    mesh.error.extend(part(-0.5, 0.0));
    back.error.extend(part(0.5, back.phase));
    mesh.error_offset -= 0.5 * mean;
    back.error_offset += 0.5 * mean;
    mesh.back = Some(back);
}

/// Reads an angle in either unit, rad.
pub(super) fn read_angle(node: &Node, stem: &str) -> Option<f64> {
    let degrees = node.at(&format!("{stem}_deg")).written().map(|angle| angle.number().to_radians());
    node.at(&format!("{stem}_rad")).written().map(|angle| angle.number()).or(degrees)
}

pub(super) fn read_rack(node: &Node) -> BasicRack {
    BasicRack {
        module: node.at("module_m").number(),
        pressure_angle: read_angle(node, "pressure_angle").unwrap_or(f64::NAN),
        helix_angle: node.at("helix_angle_deg").number().to_radians(),
        addendum: node.at("addendum").number(),
        dedendum: node.at("dedendum").number(),
    }
}
