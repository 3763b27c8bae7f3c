//! Participation of freedoms, by groups, and of natural modes in a motion.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::{
    linalg::natural_modes,
    study::figures,
    system::{Spec, bonded_stiffness, equilibrium, tangent_stiffness},
};

/// Group of freedoms: x and y of a body, or the same freedom of all planets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct FreedomGroup {
    /// Name in words.
    pub words: String,
    /// Freedoms of the group.
    pub freedoms: Vec<String>,
}

/// Returns the freedoms by groups, in the order of the train.
///
/// Names are read as `x_s, y_s, u_s` of a body, `xi_i, eta_i, u_i` of planet i. Numbers count planets if other bodies have letters, else
/// bodies. A name of another form is a group by itself.
pub fn groups(freedoms: &[String]) -> Vec<FreedomGroup> {
    let split = |name: &str| name.split_once('_').map(|(stem, of)| (stem.to_owned(), of.to_owned()));
    let numbered = |of: &str| !of.is_empty() && of.chars().all(|c| c.is_ascii_digit());
    let lettered = freedoms.iter().filter_map(|name| split(name)).any(|(_, of)| !numbered(&of));
    let mut found: Vec<FreedomGroup> = Vec::new();
    for name in freedoms {
        let words = match split(name) {
            Some((stem, of)) if lettered && numbered(&of) => planets(&stem),
            Some((stem, of)) if matches!(stem.as_str(), "x" | "y") => format!("{} centre", body(&of)),
            Some((stem, of)) if stem == "u" => format!("{} rotation", body(&of)),
            None if matches!(name.as_str(), "xi" | "eta" | "u") && freedoms.len() > 1 => planets(name),
            _ => name.clone(),
        };
        match found.iter_mut().find(|group| group.words == words) {
            Some(group) => group.freedoms.push(name.clone()),
            None => found.push(FreedomGroup { words, freedoms: vec![name.clone()] }),
        }
    }
    found
}

const PLANETS: [(&str, &str); 3] = [("xi", "planets radial"), ("eta", "planets tangential"), ("u", "planets rotation")];
const BODIES: [(&str, &str); 3] = [("s", "sun"), ("r", "ring"), ("c", "carrier")];

fn planets(stem: &str) -> String {
    known(&PLANETS, stem).unwrap_or_else(|| format!("{stem} of all planets"))
}

fn body(name: &str) -> String {
    known(&BODIES, name).unwrap_or_else(|| format!("body {name}"))
}

fn known(table: &[(&str, &str)], name: &str) -> Option<String> {
    table.iter().find(|(key, _)| *key == name).map(|(_, words)| (*words).to_owned())
}

/// Returns the shares of the groups in the kinetic energy of a motion with velocity covariance S: `Σ_i (M S)_ii / tr(M S)`; none for a
/// motion at rest.
pub fn motion_shares(spec: &Spec, covariance: &DMatrix<f64>, groups: &[FreedomGroup]) -> Option<Vec<f64>> {
    let energy = (&spec.mass * covariance).diagonal();
    let whole = energy.sum();
    (whole > 0.0).then(|| groups.iter().map(|group| sum(spec, group, &energy) / whole).collect())
}

fn sum(spec: &Spec, group: &FreedomGroup, of: &DVector<f64>) -> f64 {
    let index = |name: &String| spec.freedoms.iter().position(|freedom| freedom == name);
    group.freedoms.iter().filter_map(index).map(|i| of[i]).sum()
}

/// Natural mode φ of the train with every contact closed, `φᵀ M φ = 1`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Mode {
    /// Angular frequency ω, rad/s (per unit of time, of a dimensionless train).
    pub omega: f64,
    /// Share of each group in its kinetic energy, `Σ φ_i (M φ)_i`; that in its strain energy is the same. Sum 1.
    pub groups: Vec<f64>,
    /// Weight in the deflection of the first contact of each family, `(gᵀ φ)² / (gᵀ M⁻¹ g)`. Over all modes they sum to 1.
    pub meshes: Vec<f64>,
    /// Share of the contacts in its strain energy, `Σ k (gᵀ φ)² / ω²`; none for a free motion.
    pub strain_of_contacts: Option<f64>,
    /// Share in the kinetic energy of the steady motion, `(M φ)ᵀ S (M φ) / tr(M S)`. Over all modes they sum to 1.
    pub motion: Option<f64>,
}

/// Returns the natural modes of a train about its rest under the constant load, power laws with their tangent there; or the reason for
/// which there are none.
pub fn modes(spec: &Spec, covariance: &DMatrix<f64>, groups: &[FreedomGroup]) -> Result<Vec<Mode>, String> {
    if spec.contacts.iter().any(|contact| contact.law.is_rigid()) {
        return Err("rigid contacts have no stiffness".to_owned());
    }
    let nonlinear = spec.contacts.iter().any(|contact| contact.law.power().is_some());
    let stiffness: Vec<f64> = match equilibrium(spec) {
        Ok(rest) => tangent_stiffness(spec, &rest),
        Err(error) if nonlinear => return Err(error.to_string()),
        Err(_) => spec.contacts.iter().map(|contact| contact.stiffness.mean()).collect(),
    };
    if stiffness.iter().any(|k| !k.is_finite()) {
        return Err("nothing presses on a power-law contact at rest, so that it has no tangent".to_owned());
    }
    let modes = natural_modes(&bonded_stiffness(spec, Some(&stiffness)), &spec.mass).map_err(|e| e.to_string())?;
    let direction = |j: usize| DVector::from_column_slice(&spec.contacts[j].direction);
    // With all modes Σ φ φᵀ = M⁻¹: the weights of a contact sum to its mobility gᵀ M⁻¹ g.
    let weights = |j: usize| modes.shapes.tr_mul(&direction(j)).map(|w| w * w);
    let all: Vec<DVector<f64>> = (0..spec.contacts.len()).map(weights).collect();
    let whole = (&spec.mass * covariance).trace();
    let mode = |k: usize| {
        let shape = modes.shapes.column(k).into_owned();
        let momentum = &spec.mass * &shape;
        let energy = shape.component_mul(&momentum);
        let omega = modes.omega[k];
        let strain = |(weights, stiffness): (&DVector<f64>, &f64)| stiffness * weights[k];
        let strain: f64 = all.iter().zip(&stiffness).map(strain).sum();
        Mode {
            omega,
            groups: groups.iter().map(|group| sum(spec, group, &energy)).collect(),
            meshes: firsts(spec).into_iter().map(|(j, _)| all[j][k] / all[j].sum()).collect(),
            strain_of_contacts: (omega > 0.0).then(|| strain / (omega * omega)),
            motion: (whole > 0.0).then(|| momentum.dot(&(covariance * &momentum)) / whole),
        }
    };
    Ok((0..modes.omega.len()).map(mode).collect())
}

/// Returns the first contact of each family: index and family.
pub(super) fn firsts(spec: &Spec) -> Vec<(usize, String)> {
    figures::firsts(spec.contacts.iter().map(|contact| figures::family(&contact.name)))
}
