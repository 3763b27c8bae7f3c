//! The figures of a study, one file each.
//!
//! Each takes scenes and numbers to vary, runs what it needs, and gives a figure with what was measured on the way.

mod apart;
mod cycles;
mod forces;
mod harmonics;
mod history;
mod modes;
mod threshold;
mod trajectories;
mod waterfall;

pub use apart::{Curve, Way, apart, fraction_title};
pub use cycles::{Cycle, cycles};
pub use forces::{Forces, forces};
pub use harmonics::{Harmonics, harmonics};
pub use history::{History, history};
pub use modes::{ModeRow, modes};
pub use threshold::{ThresholdRow, threshold};
pub use trajectories::{Trajectory, trajectories};
pub use waterfall::{Strongest, waterfall};

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use serde_json::json;

use super::{
    Case, StudyError,
    steady::{Rule, Seed, Steady, steady},
};
use crate::{hybrid::ContactView, scene::Scene};

/// What every figure needs besides its scene.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// When a transient is over.
    pub rule: Rule,
    /// Set to break off.
    pub interrupted: &'a AtomicBool,
    /// Called after each scene that was run.
    pub done: &'a (dyn Fn() + Sync),
}

impl Context<'_> {
    /// Steady motion of `scene`.
    ///
    /// # Errors
    /// As [`steady`].
    pub fn steady(&self, scene: &Scene, seed: Option<&Seed>) -> Result<Steady, StudyError> {
        let steady = steady(scene, seed, &self.rule, self.interrupted);
        (self.done)();
        steady
    }

    /// `work` for every item, on all cores, results in order; the first error in that order counts.
    ///
    /// # Errors
    /// That of `work`; [`StudyError::Interrupted`].
    pub fn each<T: Sync, R: Send>(
        &self,
        items: &[T],
        work: impl Fn(&T) -> Result<R, StudyError> + Sync,
    ) -> Result<Vec<R>, StudyError> {
        let run = |item: &T| {
            if self.interrupted.load(Ordering::Relaxed) { Err(StudyError::Interrupted) } else { work(item) }
        };
        items.par_iter().map(run).collect::<Vec<_>>().into_iter().collect()
    }

    /// Steady motions along `values` of the number at `pointer`, each on its own from the scene's start.
    ///
    /// # Errors
    /// That of the first value that fails.
    pub fn cold(&self, scene: &Scene, pointer: &str, values: &[f64]) -> Result<Vec<Steady>, StudyError> {
        self.each(values, |value| self.steady(&scene.with(pointer, json!(value))?, None))
    }

    /// Steady motions along `values`, each taking up the motion before it.
    ///
    /// # Errors
    /// That of the first value that fails.
    pub fn followed(
        &self,
        scene: &Scene,
        pointer: &str,
        values: impl Iterator<Item = f64>,
    ) -> Result<Vec<Steady>, StudyError> {
        let mut seed = None;
        let mut rows = Vec::new();
        for value in values {
            let row = self.steady(&scene.with(pointer, json!(value))?, seed.as_ref())?;
            seed = Some(row.end.clone());
            rows.push(row);
        }
        Ok(rows)
    }
}

/// Where a train of this kind has its speed, rev/min.
#[must_use]
pub fn speed_pointer(scene: &Scene) -> Option<&'static str> {
    matches!(kind(scene), "planetary" | "gear-pair").then_some("/train/speed_rpm")
}

/// Where a train of this kind has its load, N m.
#[must_use]
pub fn load_pointer(scene: &Scene) -> Option<&'static str> {
    match kind(scene) {
        "planetary" => Some("/train/load/output_torque_nm"),
        "gear-pair" => Some("/train/torque_nm"),
        _ => None,
    }
}

fn kind(scene: &Scene) -> &str {
    scene.resolved()["train"]["kind"].as_str().unwrap_or_default()
}

/// Units in which motions are shown, and the factors that lead to them.
struct Units {
    /// ms
    time: (f64, &'static str),
    /// µm
    length: (f64, &'static str),
    /// N
    force: &'static str,
    /// Hz
    frequency: &'static str,
}

impl Units {
    fn of(case: &Case) -> Self {
        if case.built.dimensionless {
            Self { time: (1.0, ""), length: (1.0, ""), force: "", frequency: "" }
        } else {
            Self { time: (1e3, "ms"), length: (1e6, "µm"), force: "N", frequency: "Hz" }
        }
    }
}

/// A contact's name without its number: `ring-planet 2` is one of the `ring-planet` meshes.
#[must_use]
pub fn family(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end()
}

/// The first contact of each family of a case, in order: `(number, family)`.
fn representatives(case: &Case) -> Vec<(usize, String)> {
    firsts((0..case.structure.contact_count()).map(|j| case.structure.contact_name(j)))
}

/// The first contact of each family of a steady motion.
fn families(steady: &Steady) -> Vec<(usize, String)> {
    firsts(steady.contacts.iter().map(|contact| contact.report.name.as_str()))
}

fn firsts<'n>(names: impl Iterator<Item = &'n str>) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    for (j, name) in names.enumerate() {
        if found.iter().all(|(_, known)| known != family(name)) {
            found.push((j, family(name).to_owned()));
        }
    }
    found
}

/// A scene's number, or zero.
pub(super) fn number(scene: &Scene, pointer: &str) -> f64 {
    scene.resolved().pointer(pointer).and_then(serde_json::Value::as_f64).unwrap_or(0.0)
}
