//! Quantities of a train.

use std::cell::OnceCell;

use nalgebra::DMatrix;

use super::{Quantity, Target};
use crate::{
    linalg::{Modes, natural_modes},
    system::{ContactSpec, Equilibrium, EquilibriumError, Spec, bonded_stiffness, equilibrium, tangent_stiffness},
    train::planetary::{FamilyModes, families},
};

/// Fault of a quantity that a train does not have, with what it has instead and a remedy.
#[derive(Clone, Debug)]
pub(super) struct QuantityFault {
    pub found: String,
    pub remedy: &'static str,
}

impl QuantityFault {
    fn new(found: impl ToString, remedy: &'static str) -> Self {
        Self { found: found.to_string(), remedy }
    }
}

/// Value of a quantity; for the nearest frequency also its name.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub value: f64,
    pub matched: Option<String>,
}

/// Train, linear about its static equilibrium. Each part is solved at its first use: a target that cannot be read must not prevent the
/// reading of others.
pub(super) struct Train<'a> {
    spec: &'a Spec,
    statics: OnceCell<Result<Equilibrium, QuantityFault>>,
    stiffness: OnceCell<Result<DMatrix<f64>, QuantityFault>>,
    modes: OnceCell<Result<Modes, QuantityFault>>,
    families: OnceCell<Result<Vec<FamilyModes>, QuantityFault>>,
}

impl<'a> Train<'a> {
    pub fn new(spec: &'a Spec) -> Self {
        let (statics, stiffness) = (OnceCell::new(), OnceCell::new());
        Self { spec, statics, stiffness, modes: OnceCell::new(), families: OnceCell::new() }
    }

    /// Returns the value of a target's quantity.
    pub fn read(&self, target: &Target) -> Result<Reading, QuantityFault> {
        let plain = |value| Reading { value, matched: None };
        match &target.quantity {
            Quantity::Family(family, number) => {
                let part = self.families()?.iter().find(|part| part.family == *family);
                let hertz = part.map_or(Vec::new(), FamilyModes::hertz);
                nth(&hertz, *number, family.name()).map(plain)
            }
            Quantity::Mode(number) => nth(&self.modes()?.hertz(), *number, "natural").map(plain),
            Quantity::Nearest => self.nearest(target.wanted),
            Quantity::Force(name) => {
                let Some(j) = self.spec.contacts.iter().position(|contact| contact.name == *name) else {
                    let known: Vec<&str> = self.spec.contacts.iter().map(|contact| contact.name.as_str()).collect();
                    let found = format!("the train has no contact of this name, but {}", known.join(", "));
                    return Err(QuantityFault::new(found, "choose one of these"));
                };
                Ok(plain(self.statics()?.forces[j]))
            }
        }
    }

    fn nearest(&self, wanted: f64) -> Result<Reading, QuantityFault> {
        let named: Vec<(f64, String)> = match self.families() {
            Ok(parts) => {
                let label = |part: &FamilyModes, i: usize| Quantity::Family(part.family, i + 1).to_string();
                let rows =
                    parts.iter().flat_map(|p| p.hertz().into_iter().enumerate().map(move |(i, f)| (f, label(p, i))));
                rows.collect()
            }
            Err(_) => {
                let hertz = self.modes()?.hertz();
                hertz.into_iter().enumerate().map(|(i, f)| (f, Quantity::Mode(i + 1).to_string())).collect()
            }
        };
        let least = named.into_iter().min_by(|a, b| (a.0 - wanted).abs().total_cmp(&(b.0 - wanted).abs()));
        let (value, name) = least.ok_or_else(|| count("natural", 0))?;
        Ok(Reading { value, matched: Some(name) })
    }

    fn statics(&self) -> Result<&Equilibrium, QuantityFault> {
        self.statics.get_or_init(|| equilibrium(self.spec).map_err(unbalanced)).as_ref().map_err(Clone::clone)
    }

    /// Returns `K` with every contact closed, N/m: linear contacts at their mean stiffness, power laws at their tangent.
    fn stiffness(&self) -> Result<&DMatrix<f64>, QuantityFault> {
        let solve = || {
            if self.spec.contacts.iter().all(is_linear) {
                return Ok(bonded_stiffness(self.spec, None));
            }
            let tangents = tangent_stiffness(self.spec, self.statics()?);
            match tangents.iter().position(|k| !k.is_finite() || *k <= 0.0) {
                // A power-law contact without load has no stiffness.
                Some(j) => {
                    let name = &self.spec.contacts[j].name;
                    let found =
                        format!("contact {name} carries no static load: its power law has no tangent stiffness there");
                    Err(QuantityFault::new(found, "give the train a load, or its contacts a linear law"))
                }
                None => Ok(bonded_stiffness(self.spec, Some(&tangents))),
            }
        };
        self.stiffness.get_or_init(solve).as_ref().map_err(Clone::clone)
    }

    fn modes(&self) -> Result<&Modes, QuantityFault> {
        let unstable = |error| QuantityFault::new(error, "check masses and supports with `flank check`");
        let solve = || natural_modes(self.stiffness()?, &self.spec.mass).map_err(unstable);
        self.modes.get_or_init(solve).as_ref().map_err(Clone::clone)
    }

    fn families(&self) -> Result<&Vec<FamilyModes>, QuantityFault> {
        let remedy = "name modes by number, mode:N, or write frequency=VALUE for the nearest";
        let solve = || families(self.spec, self.stiffness()?).map_err(|error| QuantityFault::new(error, remedy));
        self.families.get_or_init(solve).as_ref().map_err(Clone::clone)
    }
}

/// Returns whether a contact's stiffness does not depend on its load.
pub(super) fn is_linear(contact: &ContactSpec) -> bool {
    contact.law.is_linear()
}

/// Returns the value with this number, counted from 1.
fn nth(values: &[f64], number: usize, what: &str) -> Result<f64, QuantityFault> {
    values.get(number - 1).copied().ok_or_else(|| count(what, values.len()))
}

fn count(what: &str, count: usize) -> QuantityFault {
    let found = format!("the train has {count} {what} frequencies");
    QuantityFault::new(found, "choose a smaller number, or another family")
}

fn unbalanced(error: EquilibriumError) -> QuantityFault {
    let remedy = match error {
        EquilibriumError::Rigid { .. } => {
            "rigid contacts have no stiffness: give them a linear law, or a power law under load"
        }
        _ => "hold every free motion that is loaded, and load every power-law contact",
    };
    QuantityFault::new(error, remedy)
}
