//! Contacts: a law, a gap, a stiffness and an error on one direction.

use super::{curve, harmonics, law, node::Node, schedule};
use crate::{
    gear::{Stiffness, contact::Law},
    system::{BackFlank, ContactSpec, Flanks},
};

fn keys(units: super::shape::Units) -> (String, String) {
    (units.key("half_backlash", "m"), units.key("total_backlash", "m"))
}

/// Reads law and half gap of a mesh or contact that has its gap under the two keys.
pub(super) fn read_gap(node: &Node, flanks: Flanks, law: Law) -> (Law, f64) {
    let (half_key, total_key) = keys(node.units);
    let (half, total) = (node.at(&half_key), node.at(&total_key));
    if let Some(half) = half.clone().written() {
        return close(&half, half.number(), flanks, law);
    }
    if let Some(total) = total.written() {
        return close(&total, 0.5 * total.number(), flanks, law);
    }
    if !law.is_bilateral() {
        half.refuse(
            format!("exactly one of \"{half_key}\" or \"{total_key}\""),
            format!("add \"{half_key}\", half the gap, or \"{total_key}\", the whole gap"),
        );
    }
    (law, 0.0)
}

/// Returns law and half gap `b`, written at `node`. Every law with flanks has a gap, a bilateral one has none; two flanks without a gap
/// between them become a bilateral mesh.
pub(super) fn close(node: &Node, b: f64, flanks: Flanks, law: Law) -> (Law, f64) {
    if law.is_bilateral() {
        if b != 0.0 {
            node.refuse(
                "no gap under a bilateral law",
                "remove the gap, or choose the law \"kelvin-voigt\", which lets go",
            );
        }
        return (law, 0.0);
    }
    if flanks == Flanks::Drive || b > 0.0 {
        return (law, b);
    }
    if b < 0.0 {
        node.refuse(
            "a gap >= 0 between two flanks",
            "a negative gap is interference: write 0 for a mesh without gap, or flanks \"drive\" for a wall",
        );
        return (law, 0.0);
    }
    if let Law::KelvinVoigt(linear, _) = law {
        node.warn("no gap between the two flanks: the mesh never lets go and is built as a bilateral one");
        return (Law::Bilateral(linear), 0.0);
    }
    node.refuse(
        "a gap > 0 between two flanks under this law",
        "write a gap, or flanks \"drive\" for one flank, or the law \"kelvin-voigt\"",
    );
    (law, 0.0)
}

/// Reads the stiffness of a law: one for a compliant law, none for a rigid one.
pub(super) fn read_stiffness(node: &Node, law: &Law) -> Stiffness {
    match (law, node.clone().written()) {
        (Law::Rigid(_), None) => Stiffness::Constant(0.0),
        (Law::Rigid(_), Some(written)) => {
            written.refuse("no stiffness under a rigid law", "remove the stiffness, or choose a compliant law");
            Stiffness::Constant(0.0)
        }
        (_, None) => {
            node.refuse("a stiffness > 0 or a schedule", "add stiffness: a compliant law needs one");
            Stiffness::Constant(0.0)
        }
        (_, Some(written)) => {
            let schedule = schedule::read(&written);
            if schedule.maximum() <= 0.0 {
                written.refuse("a stiffness that is positive at some time", "write a stiffness > 0");
            }
            schedule
        }
    }
}

/// Reads a contact, number `index`, on `n` freedoms.
pub(super) fn read(node: &Node, index: usize, n: usize) -> ContactSpec {
    let flanks = if node.at("flanks").text() == "drive" { Flanks::Drive } else { Flanks::Both };
    let direction = node.at("direction").vector(n);
    if direction.iter().all(|g| *g == 0.0) {
        node.at("direction").refuse("a direction with an entry that is not zero", "write the deflection's derivatives");
    }
    let (law, half_backlash) = read_gap(node, flanks, law::read(&node.at("law")));
    let amplitude = node.units.key("amplitude", "m");
    let (mean, error) = harmonics::or_curve(&node.at("error"), &amplitude, &curve::LENGTHS);
    let (error_offset, stiffness) =
        (node.at_unit("error_offset", "m").number() + mean, read_stiffness(&node.at("stiffness"), &law));
    let read_back = |back: Node| {
        if flanks == Flanks::Drive || law.is_bilateral() {
            back.fault(
                "a back flank",
                "a contact with two flanks and a gap",
                "remove it, or give the contact both flanks",
            );
        }
        let own = back.at("error").written().map(|own| harmonics::or_curve(&own, &amplitude, &curve::LENGTHS));
        let offset = back.at_unit("error_offset", "m").written().map(|offset| offset.number());
        let mean = own.as_ref().map_or(0.0, |(mean, _)| *mean);
        BackFlank {
            error_offset: offset.unwrap_or(if own.is_some() { 0.0 } else { error_offset }) + mean,
            error: own.map_or_else(|| error.clone(), |(_, own)| own),
            stiffness: back.at("stiffness").written().map_or_else(|| stiffness.clone(), |k| read_stiffness(&k, &law)),
        }
    };
    let back = node.at("back_flank").written().map(read_back);
    ContactSpec {
        name: node.at("name").written().map_or_else(|| format!("contact {}", index + 1), |name| name.text().to_owned()),
        direction,
        error,
        error_offset,
        half_backlash,
        flanks,
        stiffness,
        law,
        gap_damping: node.at("gap_damping_n_s_per_m").number(),
        back,
    }
}
