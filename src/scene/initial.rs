//! State at the start of a run.

use super::node::Node;
use crate::system::{Flanks, Spec, pressed, quasi_static};

/// State of a start beyond coordinates and velocities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// Latched approach speeds, m/s, with the indices of their contacts.
    pub latched: Vec<(usize, f64)>,
    /// Contacts without force inside the zone of a flank.
    pub detached: Vec<usize>,
}

/// Returns coordinates and velocities at `start`, s, `[n]` each, with the further state.
pub(super) fn read(node: &Node, spec: &Spec, start: f64) -> (Vec<f64>, Vec<f64>, Memory) {
    let n = spec.freedoms.len();
    let mut memory = Memory::default();
    let (q, v) = match node.text() {
        "rest" => (vec![0.0; n], vec![0.0; n]),
        "static" | "quasi-static" => at_equilibrium(node, spec, start),
        _ => {
            memory = read_memory(node, spec);
            (vector(&node.at("q"), spec), vector(&node.at("v"), spec))
        }
    };
    outside_walls(node, spec, &q);
    (q, v, memory)
}

fn read_memory(node: &Node, spec: &Spec) -> Memory {
    let contact = |name: &str, entry: &Node| {
        let found = spec.contacts.iter().position(|c| c.name == name);
        if found.is_none() {
            let names = spec.contacts.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
            entry.fault(
                format!("a contact the train does not have: {name}"),
                names,
                "name one of the train's contacts",
            );
        }
        found
    };
    let mut memory = Memory::default();
    if let Some(latched) = node.at("latched").written() {
        for (name, entry) in latched.entries() {
            let Some(j) = contact(name, &entry) else { continue };
            if !spec.contacts[j].law.is_latched() {
                entry.refuse("a contact whose law has hysteresis", "leave the contact out");
            }
            let speed = entry.number();
            if speed <= 0.0 {
                entry.refuse("> 0", "give the approach speed at which the contact began");
            }
            memory.latched.push((j, speed));
        }
    }
    if let Some(detached) = node.at("detached").written() {
        memory.detached.extend(detached.items().iter().filter_map(|item| contact(item.text(), item)));
    }
    memory
}

fn vector(node: &Node, spec: &Spec) -> Vec<f64> {
    if node.is_list() {
        return node.vector(spec.freedoms.len());
    }
    let mut values = vec![0.0; spec.freedoms.len()];
    for (name, entry) in node.entries() {
        match spec.freedoms.iter().position(|freedom| freedom == name) {
            Some(i) => values[i] = entry.number(),
            None => {
                let close = super::fault::nearest(name, spec.freedoms.iter().map(String::as_str));
                let remedy = close.map_or_else(
                    || "name one of the train's freedoms".to_owned(),
                    |close| format!("did you mean \"{close}\"?"),
                );
                entry.fault("a freedom the train does not have", spec.freedoms.join(", "), remedy);
            }
        }
    }
    values
}

fn at_equilibrium(node: &Node, spec: &Spec, start: f64) -> (Vec<f64>, Vec<f64>) {
    let zero = || vec![0.0; spec.freedoms.len()];
    if spec.contacts.iter().any(|c| c.law.is_rigid()) {
        let allowed = format!("\"{}\" for compliant contact laws only", node.text());
        node.refuse(allowed, "start from \"rest\" or from coordinates q");
        return (zero(), zero());
    }
    let is_static = node.text() == "static";
    let found =
        if is_static { pressed(spec).map(|(at, is_back)| (at, is_back, zero())) } else { quasi_static(spec, start) };
    match found {
        Ok((found, is_back, velocity)) => {
            if (0..is_back.len()).any(|j| found.pulls(spec, &is_back, j)) {
                node.warn("not every contact is pressed in the static state: the run starts from where all are closed");
            }
            if is_static {
                on_other_flanks(node, spec, (&found.position, &is_back), start);
            }
            (found.position, velocity)
        }
        Err(error) => {
            node.start_fault(
                error.to_string(),
                "a train whose constant load its supports and meshes can carry",
                "start from \"rest\" or from coordinates q, or add a support",
            );
            (zero(), zero())
        }
    }
}

/// Warns of contacts that the errors at the start press on their other flanks, as the static state includes only their means.
fn on_other_flanks(node: &Node, spec: &Spec, (q, is_back): (&[f64], &[bool]), start: f64) {
    let contacts = spec.contacts.iter().zip(is_back);
    for (contact, is_back) in contacts.filter(|(c, _)| c.flanks == Flanks::Both && !c.law.is_bilateral()) {
        let error = contact.error_offset + contact.error_at(start)[0];
        let deflection = contact.direction.iter().zip(q).map(|(g, x)| g * x).sum::<f64>() - error;
        let (flank, towards) = if *is_back { ("drive", deflection) } else { ("back", -deflection) };
        let depth = towards - contact.half_backlash;
        if depth > 0.0 {
            node.warn(format!(
                "{} starts {depth:.3e} m inside its {flank} flank, as \"static\" leaves the error at the start out; \
                 \"quasi-static\" includes it",
                contact.name
            ));
        }
    }
}

/// Refuses a start inside a rigid flank.
fn outside_walls(node: &Node, spec: &Spec, q: &[f64]) {
    for contact in spec.contacts.iter().filter(|c| c.law.is_rigid()) {
        // Whole cycles do not change the phase, so the start cycle does not enter.
        let error = contact.error_offset + contact.error_at(0.0)[0];
        let deflection = contact.direction.iter().zip(q).map(|(g, x)| g * x).sum::<f64>() - error;
        let (b, slack) = (contact.half_backlash, 1.0e-9 * (contact.half_backlash.abs() + deflection.abs()));
        let [drive, back] = [deflection - b, if contact.flanks == Flanks::Both { -b - deflection } else { -slack }];
        if drive.max(back) > slack {
            node.start_fault(
                format!("a start inside the rigid flank of {}, by {:e}", contact.name, drive.max(back)),
                "a start with every gap open or closed",
                "start with the gap open, or choose a compliant law",
            );
        }
    }
}
