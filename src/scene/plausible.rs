//! Warnings of implausible numbers, with which a train can be built but which no gearbox has. Each gives the number and its usual range.
//! `docs/SCENE.md` lists the rules.

use std::f64::consts::PI;

use super::{mesh::ToothMesh, node::Node};
use crate::{
    gear::{Stiffness, geometry::iso_mesh_stiffness},
    system::{ContactSpec, Spec, bonded_modes, pressed},
    train::Mesh,
};

/// Largest backlash and error of a gear, modules. DIN 3967 has backlashes of 0.02 to 0.1 modules, ISO 1328 errors below 0.02.
const BACKLASH: f64 = 0.5;
const ERROR: f64 = 0.1;
/// Largest damping ratio of meshes in steel; usual are 0.01 to 0.2.
const DAMPING: f64 = 0.5;
/// Largest factor between a stiffness and that of ISO 6336-1; the second if the face width is a guess.
const STIFFNESS: [f64; 2] = [10.0, 50.0];
/// Face width in modules if none is given: usual are 6 to 30.
const WIDTH: f64 = 12.0;
/// Largest bending stress after Lewis, Pa: hardened teeth carry some 5e8.
const STRESS: f64 = 1e9;
/// Largest profile shift, modules: -0.8 to 1 are usual.
const SHIFT: f64 = 1.2;
/// Least radius of gyration of a body over its outer radius: a disc has 0.7.
const GYRATION: f64 = 0.05;
/// Largest motion of a bearing under the mean load, modules.
const SAG: f64 = 0.5;
/// Largest damping ratio of bearings and couplings: usual are 0.01 to 0.2.
const SUPPORT: f64 = 1.0;
/// Form factor Y of Lewis of a gear of 20 teeth; `Y = π (0.154 - 0.912/Z)` for 20 degrees.
const FORM: f64 = 0.34;
/// Largest speed of the pitch circle, m/s: turbine gears reach 200.
const SPEED: f64 = 300.0;
/// Least and largest module, m: 0.1 mm to 50 mm are made.
const MODULES: [f64; 2] = [5e-5, 0.1];
/// Least and largest face width, modules.
const WIDTHS: [f64; 2] = [0.2, 150.0];
/// Largest constant drag over the torque of the teeth.
const DRAG: f64 = 0.02;
/// Least helix angle, degrees; a smaller one is in radians.
const HELIX: f64 = 2.0;
/// Largest inertia of a gear over that of its disc of steel.
const INERTIA: f64 = 300.0;
/// Factor of that limit for a body that includes more than a gear.
pub(super) const LUMPED: f64 = 10.0;
/// Density of steel, kg/m³.
const STEEL: f64 = 7850.0;
/// Frequency, relative to the highest one, below which it is zero.
const ZERO: f64 = 1e-7;

/// Numbers of harmonics and contacts above which a train has unusually many.
const MANY: [usize; 2] = [5000, 1000];
/// Memory of a harmonic, B, and of a pair of contacts; time of a harmonic in a step, s. Measured on the pair of Kahraman and Singh and on walls.
const MEMORY: [f64; 2] = [2500.0, 8.5];
const TIME: f64 = 4e-7;

/// Warns of the cost of a train with unusually many harmonics or contacts.
pub(super) fn size(train: &Node, spec: &Spec) {
    let of_contact = |contact: &ContactSpec| {
        let stiffness =
            if let Stiffness::Harmonic { harmonics, .. } = &contact.stiffness { harmonics.len() } else { 0 };
        contact.error.len() + stiffness
    };
    let harmonics = spec.load_harmonics.len() + spec.contacts.iter().map(of_contact).sum::<usize>();
    let contacts = spec.contacts.len();
    if harmonics > MANY[0] {
        let (memory, time) = (MEMORY[0] * harmonics as f64 / 1e9, TIME * harmonics as f64);
        train.warn(format!("{harmonics} harmonics in all take about {memory:.2} GB, and {time:.1e} s in every step"));
    }
    if contacts > MANY[1] {
        let memory = MEMORY[1] * contacts as f64 * contacts as f64 / 1e9;
        train.warn(format!("{contacts} contacts take about {memory:.2} GB"));
    }
}

/// Returns whether teeth of this module are made.
fn is_made(teeth: &ToothMesh) -> bool {
    let m = teeth.rack.module;
    let widths = WIDTHS[0] * m..=WIDTHS[1] * m;
    (MODULES[0]..=MODULES[1]).contains(&m) && teeth.face_width.is_none_or(|width| widths.contains(&width))
}

/// Warns of the numbers of a mesh; `node` is the place of its contact, `rack` that of its rack.
pub(super) fn mesh(node: &Node, rack: &Node, mesh: &Mesh, teeth: &ToothMesh) {
    let m = teeth.rack.module;
    if !(MODULES[0]..=MODULES[1]).contains(&m) {
        rack.at("module_m").warn(format!("a module of {m} m; 0.0001 to 0.05 m are made: is it in millimetres?"));
        return;
    }
    if !is_made(teeth) {
        return;
    }
    let helix = teeth.rack.helix_angle.to_degrees();
    if helix > 0.0 && helix < HELIX {
        rack.at("helix_angle_deg")
            .warn(format!("a helix angle of {helix} deg; 5 to 40 deg are usual: is it in radians?"));
    }
    let total = 2.0 * mesh.half_backlash;
    if total > BACKLASH * m {
        let place =
            [node.at("total_backlash_m").written(), node.at("half_backlash_m").written()].into_iter().flatten().next();
        let usual = format!("{:.1e} to {:.1e} m, 0.02 to 0.1 modules, are usual", 0.02 * m, 0.1 * m);
        place.as_ref().unwrap_or(node).warn(format!("a backlash of {total} m between both flanks; {usual}"));
    }
    let error = mesh.error.iter().map(|h| h.amplitude.abs()).sum::<f64>() + mesh.error_offset.abs();
    if error > ERROR * m {
        node.at("error").warn(format!("errors of {error} m in all; up to {:.1e} m, 0.02 modules, are usual", 0.02 * m));
    }
    let ratio = node.at("law").at("damping_ratio").written().map(|ratio| ratio.number());
    if let Some(ratio) = ratio.filter(|ratio| *ratio > DAMPING) {
        node.at("law").at("damping_ratio").warn(format!("a damping ratio of {ratio}; 0.01 to 0.2 are usual"));
    }
    let (width, factor) = teeth.face_width.map_or((WIDTH * m, STIFFNESS[1]), |width| (width, STIFFNESS[0]));
    let [pinion, wheel] = teeth.gears;
    let iso =
        iso_mesh_stiffness(&teeth.rack, pinion, wheel, teeth.geometry.kind, teeth.geometry.path.contact_ratio(), width);
    let mean = mesh.stiffness.mean();
    if mesh.law.power().is_none() && !mesh.law.is_rigid() && !(iso / factor..=iso * factor).contains(&mean) {
        node.at("stiffness")
            .warn(format!("a mean stiffness of {mean:.3e} N/m; teeth of steel have about {iso:.1e} N/m (ISO 6336-1)"));
    }
}

/// Warns of a mass or an inertia that no gear of this size has. `k` is the index of the gear in the mesh; `most` is 1 for a gear alone and
/// [`LUMPED`] for one with all bodies fixed to it. A mass of 0 counts as none.
pub(super) fn inertia(node: &Node, (mass, inertia): (f64, f64), teeth: &ToothMesh, k: usize, most: f64) {
    let m = teeth.rack.module;
    let width = node.at("face_width_m").written().map(|width| width.number());
    if let Some(width) = width.filter(|width| !(WIDTHS[0] * m..=WIDTHS[1] * m).contains(width) && m < MODULES[1]) {
        let usual = format!("6 to 30 modules, {:.1e} to {:.1e} m, are usual", 6.0 * m, 30.0 * m);
        node.at("face_width_m").warn(format!("a face width of {width} m; {usual}: is it in millimetres?"));
        return;
    }
    if !is_made(teeth) {
        return;
    }
    let shift = teeth.gears[k].shift;
    if shift.abs() > SHIFT {
        node.at("profile_shift").warn(format!("a profile shift of {shift} modules; -0.8 to 1 are usual"));
    }
    let (reach, width) = (teeth.gears[k].tip_radius(&teeth.rack), teeth.face_width);
    let gyration = (inertia / mass).sqrt();
    if mass > 0.0 && !(GYRATION * reach..=1.05 * reach * most).contains(&gyration) {
        node.at("inertia_kg_m2").warn(format!(
            "{inertia:.3e} kg m2 of {mass} kg: a radius of gyration of {gyration:.2e} m; the teeth end at {reach:.2e} m"
        ));
        return;
    }
    let disc = 0.5 * PI * STEEL * width.unwrap_or(0.3 * reach) * reach.powi(4);
    let factor = INERTIA * most;
    if inertia > 0.0 && !(disc / INERTIA..=disc * factor).contains(&inertia) {
        node.at("inertia_kg_m2")
            .warn(format!("{inertia:.3e} kg m2; a disc of steel of this size has about {disc:.1e} kg m2"));
    }
}

/// Warns of a damping ratio of a bearing or a coupling.
pub(super) fn support(node: &Node) {
    if let Some(ratio) = node.at("damping_ratio").written().map(|ratio| ratio.number()).filter(|ratio| *ratio > SUPPORT)
    {
        node.at("damping_ratio").warn(format!("a damping ratio of {ratio}; 0.01 to 0.2 are usual"));
    }
}

/// Warns of a length that teeth of this module do not have, such as runout: up to 0.02 modules are usual.
pub(super) fn runout(node: &Node, length: f64, module: f64) {
    if length.abs() > ERROR * module {
        node.warn(format!("{length} m; up to {:.1e} m, 0.02 modules, are usual", 0.02 * module));
    }
}

/// Warns of a drag, N m, that no bearing has.
pub(super) fn drag(node: &Node, torque: f64, teeth: &ToothMesh, k: usize) {
    let width = teeth.face_width.unwrap_or(WIDTH * teeth.rack.module);
    let most = DRAG * STRESS * FORM * width * teeth.rack.module * teeth.geometry.base_radii[k];
    if is_made(teeth) && torque.abs() > most {
        node.at("drag").warn(format!(
            "a drag of {torque} N m; bearings of such a gear have less than {most:.1e} N m: is it in N mm?"
        ));
    }
}

/// Warns of planets whose tip circles overlap: positions, rad, distance from the axis and radius of the tip circle, m.
pub(super) fn planets(node: &Node, positions: &[f64], distance: f64, tip: f64) {
    let mut sorted = positions.to_vec();
    sorted.sort_by(f64::total_cmp);
    let next = sorted.iter().skip(1).copied().chain(sorted.first().map(|first| first + 2.0 * PI));
    let least =
        sorted.iter().zip(next).map(|(a, b)| 2.0 * distance * libm::sin(0.5 * (b - a))).fold(f64::INFINITY, f64::min);
    if positions.len() > 1 && least < 2.0 * tip {
        node.warn(format!(
            "planets overlap: centres {:.2} mm apart, tip circles of {:.2} mm; take fewer planets or fewer teeth",
            1e3 * least,
            2e3 * tip
        ));
    }
}

/// Warns of loads and speeds that no teeth bear, and of bodies without support. `load` and `speed` are their places.
pub(super) fn train(train: &Node, spec: &Spec, meshes: &[ToothMesh]) {
    if meshes.is_empty() || !meshes.iter().all(is_made) {
        return;
    }
    let rest = pressed(spec).ok();
    let forces = rest.as_ref().map(|(at, _)| at.forces.clone()).unwrap_or_default();
    let contacts = meshes.iter().flat_map(|mesh| std::iter::repeat_n(mesh, mesh.phases.len()));
    let stress = |(mesh, force): (&ToothMesh, &f64)| {
        let width = mesh.face_width.unwrap_or(WIDTH * mesh.rack.module);
        let form = PI * (0.154 - 0.912 / f64::from(mesh.gears[0].teeth.min(mesh.gears[1].teeth)));
        force.abs() / (width * mesh.rack.module * form.max(0.5 * FORM))
    };
    let worst = contacts.zip(&forces).map(|pair| (pair.0, pair.1, stress(pair))).max_by(|a, b| a.2.total_cmp(&b.2));
    if let Some((mesh, force, stress)) = worst.filter(|worst| worst.2 > STRESS) {
        load(train).warn(format!(
            "{}: a force of {:.0} N bends the teeth with {:.0} MPa (Lewis); up to 500 MPa are usual: is the torque in N mm?",
            mesh.name,
            force.abs(),
            1e-6 * stress
        ));
    }
    let least = meshes.iter().map(|mesh| mesh.rack.module).fold(f64::INFINITY, f64::min);
    let strongest = spec.load_harmonics.iter().flat_map(|load| &load.vector).fold(0.0, |m: f64, f| m.max(f.abs()));
    let largest = meshes
        .iter()
        .map(|mesh| mesh.face_width.unwrap_or(WIDTH * mesh.rack.module) * mesh.rack.module)
        .fold(0.0, f64::max);
    if strongest > STRESS * FORM * largest {
        let orders = train
            .at("shafts")
            .items()
            .into_iter()
            .map(|shaft| shaft.at("orders"))
            .find(|orders| !orders.items().is_empty());
        orders.as_ref().unwrap_or(train).warn(format!(
            "a load that changes by {strongest:.3e} N on the base circle; the teeth carry some {:.1e} N",
            0.5 * STRESS * FORM * largest
        ));
    }
    if let Some((at, _)) = &rest {
        let sags = |i: &usize| {
            !spec.freedoms[*i].starts_with("u_")
                && spec.stiffness[(*i, *i)] > 0.0
                && at.position[*i].abs() > SAG * least
        };
        let sagging: Vec<usize> = (0..spec.freedoms.len()).filter(sags).collect();
        if let Some(i) = sagging.first() {
            let names = sagging.iter().map(|i| spec.freedoms[*i].as_str()).collect::<Vec<_>>().join(", ");
            train.warn(format!(
                "the mean load moves {names} by up to {:.1e} m, more than half a module: are bearings in N/mm or N/um?",
                sagging.iter().map(|i| at.position[*i].abs()).fold(at.position[*i].abs(), f64::max)
            ));
        }
    }
    let speed = |mesh: &ToothMesh| mesh.frequency * PI * mesh.rack.transverse_module();
    if let Some(mesh) = meshes.iter().max_by(|a, b| speed(a).total_cmp(&speed(b))).filter(|mesh| speed(mesh) > SPEED) {
        let place = speed_of(train);
        place.warn(format!("{}: {:.0} m/s on the pitch circle; up to 200 m/s are usual", mesh.name, speed(mesh)));
    }
    unheld(train, spec);
}

/// Returns the place of the load of a train.
fn load<'a>(train: &Node<'a>) -> Node<'a> {
    let shafts = train.at("shafts");
    let of_shafts = shafts
        .items()
        .into_iter()
        .map(|shaft| shaft.at("torque_nm"))
        .find(|torque| torque.clone().written().is_some_and(|t| !t.is_text() && t.number() != 0.0));
    let direct =
        ["torque_nm", "load"].map(|key| train.at(key)).into_iter().find(|node| node.clone().written().is_some());
    of_shafts.or(direct).unwrap_or_else(|| train.clone())
}

/// Returns the place of the speed of a train.
fn speed_of<'a>(train: &Node<'a>) -> Node<'a> {
    let of_shafts = train
        .at("shafts")
        .items()
        .into_iter()
        .map(|shaft| shaft.at("speed_rpm"))
        .find(|speed| speed.clone().written().is_some());
    of_shafts.unwrap_or_else(|| train.at("speed_rpm"))
}

/// Warns of freedoms that move without any stiffness, beyond the rotation of the train as a whole.
fn unheld(train: &Node, spec: &Spec) {
    let Ok(modes) = bonded_modes(spec) else { return };
    let highest = modes.omega.iter().copied().fold(0.0, f64::max);
    let free: Vec<usize> = (0..modes.omega.len()).filter(|k| modes.omega[*k] <= ZERO * highest).collect();
    if free.len() < 2 {
        return;
    }
    // Shares of the free motions in each freedom; those without rotation come first.
    let share = |i: usize| free.iter().map(|k| modes.shapes[(i, *k)].powi(2) * spec.mass[(i, i)]).sum::<f64>();
    let moving: Vec<usize> = (0..spec.freedoms.len()).filter(|i| share(*i) > 1e-6).collect();
    let sideways: Vec<usize> = moving.iter().copied().filter(|i| !spec.freedoms[*i].starts_with("u_")).collect();
    let named = if sideways.is_empty() { moving } else { sideways };
    let names = named.iter().map(|i| spec.freedoms[*i].as_str()).collect::<Vec<_>>().join(", ");
    train.warn(format!(
        "{} natural frequencies are zero, one is usual: nothing holds {names}; add a stiffness",
        free.len()
    ));
}
