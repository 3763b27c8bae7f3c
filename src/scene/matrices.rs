//! Trains given as matrices and contacts.

use super::{contact, harmonics, load, node::Node};
use crate::{
    gear::Stiffness,
    system::{ContactSpec, LoadHarmonic, LoadSchedule, Spec},
};

pub(super) fn read(node: &Node) -> Spec {
    let mass_node = node.at("mass_kg");
    let n = mass_node.items().len();
    let mass = mass_node.matrix(n);
    let asymmetry = (&mass - mass.transpose()).amax();
    if asymmetry > 1.0e-12 * mass.amax() {
        mass_node.fault(
            format!("a matrix that differs from its transpose by {asymmetry:e}"),
            "a symmetric matrix",
            "write the same number above and below the diagonal",
        );
    } else if mass.clone().cholesky().is_none() {
        mass_node.fault(
            "a matrix that is not positive definite",
            "a positive definite matrix: every motion has kinetic energy",
            "write a mass > 0 for every freedom, or drop the freedom",
        );
    }
    let load_harmonics = node
        .at("load_harmonics")
        .items()
        .iter()
        .map(|load| {
            let (omega, phase) = harmonics::read_timing(load);
            LoadHarmonic { vector: load.at("vector_n").vector(n), omega, phase }
        })
        .collect();
    let schedules = node.at("load_schedules").items();
    let schedule = |item: &Node| {
        Some(LoadSchedule { vector: item.at("vector_n").vector(n), factor: load::read(item, &[], None)? })
    };
    let load_schedules = schedules.iter().filter_map(schedule).collect();
    let contacts = node.at("contacts").items();
    let mut spec = Spec {
        freedoms: names(&node.at("freedoms"), n),
        mass,
        damping: node.at("damping_n_s_per_m").matrix(n),
        stiffness: node.at("stiffness_n_per_m").matrix(n),
        load: node.at("load_n").vector(n),
        load_harmonics,
        contacts: contacts.iter().enumerate().map(|(i, item)| contact::read(item, i, n)).collect(),
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules,
    };
    for (i, c) in spec.contacts.iter().enumerate() {
        if spec.contacts[..i].iter().any(|other| other.name == c.name) {
            let found = format!("a second contact called \"{}\"", c.name);
            contacts[i].at("name").fault(found, "a name of its own", "write a different name for each contact");
        }
    }
    if spec.stiffness != spec.stiffness.transpose() {
        node.at("stiffness_n_per_m")
            .warn("the stiffness matrix is not symmetric: energy is not conserved without damping");
    }
    spec.omega = base_frequency(node, &spec);
    spec
}

fn names(node: &Node, n: usize) -> Vec<String> {
    let items = node.items();
    if node.clone().written().is_none() {
        return (1..=n).map(|i| format!("q{i}")).collect();
    }
    if items.len() != n {
        node.refuse(format!("{n} names, one per freedom"), "write one name per row of the mass matrix");
    }
    let names: Vec<String> = items.iter().map(|item| item.text().to_owned()).collect();
    for (i, item) in items.iter().enumerate() {
        if names[i].is_empty() || names[..i].contains(&names[i]) {
            item.refuse("a name of its own", "write a different name for each freedom");
        }
    }
    names
}

/// Returns the frequency of one cycle: the given one, or the lowest of the excitation if all are its multiples.
pub(super) fn base_frequency(node: &Node, spec: &Spec) -> Option<f64> {
    if let Some(written) = node.at_unit("base_frequency", "rad_per_s").written() {
        return Some(written.number());
    }
    let of_period = |period: f64| std::f64::consts::TAU / period;
    let schedules =
        spec.contacts.iter().flat_map(ContactSpec::schedules).chain(spec.load_schedules.iter().map(|l| &l.factor));
    let scheduled = schedules.flat_map(|schedule| match schedule {
        Stiffness::Harmonic { harmonics, .. } => harmonics.iter().map(|h| h.omega).collect(),
        Stiffness::Periodic { period, .. } => vec![of_period(*period)],
        Stiffness::Constant(_) | Stiffness::Listed { .. } => vec![],
    });
    let errors = spec.contacts.iter().flat_map(ContactSpec::errors).flatten().map(|h| h.omega);
    let loads = spec.load_harmonics.iter().map(|h| h.omega);
    let all: Vec<f64> = loads.chain(errors).chain(scheduled).collect();
    let least = all.iter().copied().reduce(f64::min)?;
    let multiple = |omega: &f64| (omega / least - (omega / least).round()).abs() <= 1.0e-12 * omega / least;
    all.iter().all(multiple).then_some(least)
}
