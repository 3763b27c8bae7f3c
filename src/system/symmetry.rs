//! Equal degrees of freedom and contacts, which stay equal bit for bit.
//!
//! The classes are an equitable partition of the train. Members of a class have the same parameters, and the same number of couplings of
//! each kind with members of every other class. States that are equal within each class then stay equal under the flow and under every jump
//! that treats equal contacts equally. Along a step, equal rows are summed in the same order, which keeps this bit for bit. The solution of
//! equations does not, and [`Symmetry::restore`] repairs it.

use std::collections::BTreeMap;

use super::{ContactSpec, Spec, assemble::PerContact};

/// Relative difference below which values differ only by the rounding of a solved system.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// Class number and shared value of its members, for each class.
pub(crate) type Equal = PerContact<(usize, f64)>;

/// The classes with more than one member.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Symmetry {
    freedoms: Vec<Vec<usize>>,
    contacts: Vec<Vec<usize>>,
}

/// Numbers the distinct signatures in order of their first member.
fn number(signatures: Vec<Vec<u64>>) -> Vec<u64> {
    let mut known = BTreeMap::new();
    let mut colours = Vec::with_capacity(signatures.len());
    for signature in signatures {
        let next = known.len() as u64;
        colours.push(*known.entry(signature).or_insert(next));
    }
    colours
}

fn classes(colours: &[u64]) -> Vec<Vec<usize>> {
    let mut members: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    colours.iter().enumerate().for_each(|(i, colour)| members.entry(*colour).or_default().push(i));
    members.into_values().filter(|class| class.len() > 1).collect()
}

impl Symmetry {
    /// Returns the coarsest equitable partition, by refinement of colours.
    pub fn new(spec: &Spec, flanks: &[ContactSpec]) -> Self {
        let n = spec.freedoms.len();
        let matrices = [&spec.mass, &spec.damping, &spec.stiffness];
        let mut freedoms = number(
            (0..n)
                .map(|i| {
                    let own = matrices.iter().map(|m| m[(i, i)].to_bits()).chain([spec.load[i].to_bits()]);
                    let harmonics = spec.load_harmonics.iter().map(|l| l.vector[i].to_bits());
                    own.chain(harmonics).chain(spec.load_schedules.iter().map(|l| l.vector[i].to_bits())).collect()
                })
                .collect(),
        );
        // All properties of a contact except its name and direction.
        let text = |c: &ContactSpec| {
            let own = format!("{:?}", (c.law, &c.error, c.error_offset, c.half_backlash, c.flanks, &c.stiffness));
            own.into_bytes().into_iter().map(u64::from).collect()
        };
        let mut contacts = number(flanks.iter().map(text).collect());
        loop {
            let count = |colours: &[u64]| colours.iter().max().map_or(0, |most| *most);
            let before = (count(&freedoms), count(&contacts));
            let sorted = |own: u64, mut met: Vec<Vec<u64>>| {
                met.sort();
                [vec![own], met.concat()].concat()
            };
            let freedom = |i: usize| {
                let others =
                    (0..n).filter(|j| *j != i && matrices.iter().any(|m| m[(i, *j)] != 0.0 || m[(*j, i)] != 0.0));
                let coupled = others.map(|j| {
                    let entries = matrices.iter().flat_map(|m| [m[(i, j)].to_bits(), m[(j, i)].to_bits()]);
                    entries.chain([freedoms[j]]).collect()
                });
                let met = (0..contacts.len()).filter(|c| flanks[*c].direction[i] != 0.0);
                let met = met.map(|c| vec![flanks[c].direction[i].to_bits(), contacts[c]]);
                sorted(freedoms[i], coupled.chain(met).collect())
            };
            let contact = |c: usize| {
                let direction = &flanks[c].direction;
                let met = (0..n).filter(|i| direction[*i] != 0.0).map(|i| vec![direction[i].to_bits(), freedoms[i]]);
                sorted(contacts[c], met.collect())
            };
            let refined = number((0..n).map(freedom).collect());
            let met = number((0..contacts.len()).map(contact).collect());
            (freedoms, contacts) = (refined, met);
            if before == (count(&freedoms), count(&contacts)) {
                return Self { freedoms: classes(&freedoms), contacts: classes(&contacts) };
            }
        }
    }

    /// Returns the classes of equal degrees of freedom, with the members in the order of the train.
    pub fn freedoms(&self) -> &[Vec<usize>] {
        &self.freedoms
    }

    /// Returns the index of the first member of the class of each of `n` degrees of freedom and of each of `contacts` contacts.
    pub fn firsts(&self, n: usize, contacts: usize) -> [Box<[usize]>; 2] {
        [(n, &self.freedoms), (contacts, &self.contacts)].map(|(count, classes)| {
            let mut firsts: Box<[usize]> = (0..count).collect();
            classes.iter().for_each(|class| class.iter().for_each(|i| firsts[*i] = class[0]));
            firsts
        })
    }

    /// Returns whether no two degrees of freedom are equal.
    pub fn is_empty(&self) -> bool {
        self.freedoms.is_empty()
    }

    /// Returns the classes of degrees of freedom whose members are equal in `values`, and these values.
    pub fn equal(&self, values: &[f64]) -> Equal {
        let is_equal = |class: &Vec<usize>| class.iter().all(|i| values[*i] == values[class[0]]);
        let numbered = self.freedoms.iter().enumerate();
        numbered.filter(|(_, class)| is_equal(class)).map(|(c, class)| (c, values[class[0]])).collect()
    }

    /// Makes the members of the classes in `equal` equal again, if they differ only by rounding.
    pub fn restore(&self, equal: &Equal, values: &mut [f64]) {
        for (class, before) in equal {
            restore(&self.freedoms[*class], before.abs(), values);
        }
    }

    /// Returns whether all contacts of each class agree in the value that `state` returns.
    pub fn agree<T: PartialEq>(&self, state: impl Fn(usize) -> T) -> bool {
        self.contacts.iter().all(|class| class.iter().all(|j| state(*j) == state(class[0])))
    }

    /// Copies the low part of the first member to the members of each class in `equal` that are equal in `values`.
    pub fn share(&self, equal: &Equal, values: &[f64], low: &mut [f64]) {
        for (class, _) in equal {
            let class = &self.freedoms[*class];
            if class.iter().any(|i| values[*i] != values[class[0]]) {
                continue;
            }
            class.iter().for_each(|i| low[*i] = low[class[0]]);
        }
    }

    /// Returns whether all members of all classes are equal in `values`.
    pub fn are_all_equal(&self, values: &[f64]) -> bool {
        self.freedoms.iter().all(|class| class.iter().all(|i| values[*i] == values[class[0]]))
    }

    /// Makes the forces of the contacts of each class equal, if the whole class is in `held` and they differ only by rounding.
    pub fn restore_forces(&self, held: &[usize], forces: &mut [f64]) {
        let size = forces[..held.len()].iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        for class in &self.contacts {
            let places: PerContact<usize> = class.iter().filter_map(|j| held.iter().position(|k| k == j)).collect();
            if places.len() == class.len() {
                restore(&places, size, forces);
            }
        }
    }
}

/// Makes `values` of the members of a class equal; `size` is the size of the terms that were summed.
fn restore(class: &[usize], size: f64, values: &mut [f64]) {
    let first = values[class[0]];
    if class.iter().all(|i| (values[*i] - first).abs() <= ROUNDING * (size + first.abs())) {
        class.iter().for_each(|i| values[*i] = first);
    }
}
