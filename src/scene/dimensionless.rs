//! Gear pair of Kahraman and Singh: one relative freedom, lengths in half gaps, time in natural periods.

use super::{contact, harmonics, law, load, matrices, node::Node, schedule};
use crate::{
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    system::{ContactSpec, Flanks, LoadHarmonic, LoadSchedule, Spec},
};
use nalgebra::DMatrix;

pub(super) fn read(node: &Node) -> Spec {
    let damping = 2.0 * node.at("damping_ratio").number();
    let release = node.at("release");
    let (everywhere, law) = if node.at("damping_in_gap").flag() {
        if release.clone().written().is_some() {
            release
                .refuse("nothing while the damper acts everywhere", "remove release, or set damping_in_gap to false");
        }
        // A spring alone opens at zero deflection and zero force at once.
        (damping, Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection))
    } else {
        (0.0, Law::KelvinVoigt(Linear { damping }, law::read_release(&release)))
    };
    let wave = |item: &Node, inertial: bool| {
        let (omega, phase) = harmonics::read_timing(item);
        let amplitude = item.at("amplitude").number();
        LoadHarmonic { vector: vec![if inertial { amplitude * omega * omega } else { amplitude }], omega, phase }
    };
    let (mean, factor) = load::or_schedule(&node.at("mean_load"), &[], None);
    let errors = node.at("transmission_error").items();
    let loads = node.at("load_harmonics").items();
    let stiffness = schedule::read(&node.at("stiffness"));
    if stiffness.maximum() <= 0.0 {
        node.at("stiffness").refuse("a stiffness that is positive at some time", "write a mean stiffness of 1");
    }
    if (stiffness.mean() - 1.0).abs() > 1.0e-6 && !matches!(stiffness, Stiffness::Listed { .. }) {
        node.at("stiffness")
            .warn(format!("the mean stiffness is {}, not 1: time is not in natural periods", stiffness.mean()));
    }
    let gap = node.at("half_backlash");
    let (law, half_backlash) = contact::close(&gap, gap.number(), Flanks::Both, law);
    let mut spec = Spec {
        freedoms: vec!["x".to_owned()],
        mass: DMatrix::from_element(1, 1, 1.0),
        damping: DMatrix::from_element(1, 1, everywhere),
        stiffness: DMatrix::zeros(1, 1),
        load: vec![if factor.is_some() { 0.0 } else { mean }],
        load_harmonics: errors.iter().map(|e| wave(e, true)).chain(loads.iter().map(|l| wave(l, false))).collect(),
        contacts: vec![ContactSpec {
            name: "mesh".to_owned(),
            direction: vec![1.0],
            error: vec![],
            error_offset: 0.0,
            half_backlash,
            flanks: Flanks::Both,
            stiffness,
            law,
            gap_damping: 0.0,
            back: None,
        }],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: factor.into_iter().map(|factor| LoadSchedule { vector: vec![1.0], factor }).collect(),
    };
    spec.omega = matrices::base_frequency(node, &spec);
    spec
}
