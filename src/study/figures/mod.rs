//! The figures of a study.
//!
//! Each takes scenes and numbers to vary, runs what it needs, and gives a figure with what was measured on the way.

mod centres;
mod curves;
mod cycles;
mod modes;
mod spectra;
#[cfg(test)]
#[path = "../../../tests/unit/figures.rs"]
mod tests;

pub(super) use centres::{history, trajectories};
pub(super) use curves::{along, apart, facts, fraction_title, harmonics, threshold};
pub(super) use cycles::cycles;
pub(super) use modes::{ModeRow, listing, modes};
pub(super) use spectra::{forces, waterfall};

use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    record::{Recording, record},
    steady::{Rule, Seed, Steady, settled, steady},
};
use crate::{analysis::Spectrum, hybrid::ContactView, orbit::Motion, scene::Scene, simulation::Simulation, task::Task};

/// What every figure needs besides its scene.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// When a transient is over.
    pub rule: Rule,
    /// Cancels it, and hears of each scene that was run.
    pub task: Task<'a>,
}

impl Context<'_> {
    /// Steady motion of `scene`.
    pub(super) fn steady(&self, scene: &Scene, seed: Option<&Seed>) -> Result<Steady, StudyError> {
        // Periodic or not is enough for a figure.
        let steady = steady(scene, seed, &Rule { decides: false, ..self.rule }, self.task);
        self.task.advance();
        steady
    }

    /// The settled motion over as many cycles as `cycles` says for its period, with `per_cycle` samples of each; its kind, if `decides`.
    fn recorded(
        &self,
        simulation: &Simulation,
        (per_cycle, decides): (u32, bool),
        cycles: impl Fn(Option<u64>) -> u64,
    ) -> Result<(Recording, Motion), StudyError> {
        let (mut engine, settled, _) = settled(simulation, None, &Rule { decides, ..self.rule }, self.task)?;
        let recording = record(simulation, &mut engine, cycles(settled.period), per_cycle)?;
        self.task.advance();
        Ok((recording, settled))
    }

    /// `work` for every item, on all cores, results in order; the first error in that order counts.
    pub(super) fn each<T: Sync, R: Send>(
        &self,
        items: &[T],
        work: impl Fn(&T) -> Result<R, StudyError> + Sync,
    ) -> Result<Vec<R>, StudyError> {
        let run = |item: &T| {
            if self.task.is_cancelled() { Err(StudyError::Interrupted) } else { work(item) }
        };
        items.par_iter().with_max_len(1).map(run).collect::<Vec<_>>().into_iter().collect()
    }

    /// Steady motions along `values` of the number at `pointer`, each on its own from the scene's start.
    fn cold(&self, scene: &Scene, pointer: &str, values: &[f64]) -> Result<Vec<Steady>, StudyError> {
        self.each(values, |value| self.steady(&scene.with(pointer, json!(value))?, None))
    }

    /// Steady motions along `values`, each taking up the motion before it.
    fn followed(
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
pub(super) fn speed_pointer(scene: &Scene) -> Option<&'static str> {
    matches!(kind(scene), "planetary" | "gear-pair").then_some("/train/speed_rpm")
}

/// Where a train of this kind has its load, N m.
pub(super) fn load_pointer(scene: &Scene) -> Option<&'static str> {
    match kind(scene) {
        "planetary" => Some("/train/load/output_torque_nm"),
        "gear-pair" => Some("/train/torque_nm"),
        _ => None,
    }
}

/// The kind of a scene's train.
pub(super) fn kind(scene: &Scene) -> &str {
    scene.resolved()["train"]["kind"].as_str().unwrap_or_default()
}

/// Units in which motions are shown, and the factors that lead to them.
pub(super) struct Units {
    /// ms
    pub time: (f64, &'static str),
    /// µm
    pub length: (f64, &'static str),
    /// N
    pub force: &'static str,
    /// Hz
    frequency: &'static str,
}

impl Units {
    pub fn of(simulation: &Simulation) -> Self {
        if simulation.dimensionless {
            Self { time: (1.0, ""), length: (1.0, ""), force: "", frequency: "" }
        } else {
            Self { time: (1e3, "ms"), length: (1e6, "µm"), force: "N", frequency: "Hz" }
        }
    }

    #[cfg(feature = "plot")]
    /// The same for times up to `time`, s, and lengths up to `length`, m.
    pub fn fit(self, time: f64, length: f64) -> Self {
        if self.force.is_empty() {
            return self;
        }
        let time = if time >= 1.0 { (1.0, "s") } else { self.time };
        let length = match length {
            length if length >= 0.1 => (1.0, "m"),
            length if length >= 1e-3 => (1e3, "mm"),
            _ => self.length,
        };
        Self { time, length, ..self }
    }
}

/// A contact's name without its number: `ring-planet 2` is one of the `ring-planet` meshes. Contacts without names of their own,
/// `contact 2`, are no family.
pub(super) fn family(name: &str) -> &str {
    if name.starts_with("contact ") { name } else { name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end() }
}

/// The first contact of each family of a case, in order: `(number, family)`.
pub(super) fn representatives(simulation: &Simulation) -> Vec<(usize, String)> {
    firsts((0..simulation.structure.contact_count()).map(|j| family(simulation.structure.contact_name(j))))
}

/// The first contact of each family of a steady motion.
pub(super) fn families(steady: &Steady) -> Vec<(usize, String)> {
    firsts(steady.contacts.iter().map(|contact| family(&contact.report.name)))
}

/// The first item of each family.
pub(super) fn firsts<'n>(families: impl Iterator<Item = &'n str>) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    for (j, family) in families.enumerate() {
        if found.iter().all(|(_, known)| known != family) {
            found.push((j, family.to_owned()));
        }
    }
    found
}

/// Frequencies and amplitudes of a spectrum up to `highest`, without its mean.
pub(super) fn lines(spectrum: &Spectrum, highest: f64) -> Vec<(f64, f64)> {
    let lines = spectrum.frequencies().into_iter().zip(spectrum.amplitude.iter().copied()).skip(1);
    lines.take_while(|(frequency, _)| *frequency <= highest).collect()
}

/// Local maxima of values that go round.
fn maxima(values: &[f64]) -> usize {
    let n = values.len();
    (0..n).filter(|&i| values[i] > values[(i + n - 1) % n] && values[i] >= values[(i + 1) % n]).count()
}

/// What was measured, by the name of what it belongs to (`sun_planet` for `sun-planet`), as expressions know it.
pub(super) fn by_name(facts: impl IntoIterator<Item = (String, Value)>) -> Map<String, Value> {
    facts.into_iter().map(|(name, fact)| (name.replace(['-', ' '], "_"), fact)).collect()
}

/// A number of a scene.
///
/// # Errors
/// [`StudyError`] if the scene has no number there.
pub(super) fn number(scene: &Scene, pointer: &str) -> Result<f64, StudyError> {
    let number = scene.resolved().pointer(pointer).and_then(Value::as_f64);
    number.ok_or_else(|| StudyError::missing(scene.name(), format!("it has no number {pointer}")))
}
