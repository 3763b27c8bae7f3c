//! The figures of a study.
//!
//! Each function takes scenes and numbers to vary, runs the scenes, and returns a figure with its measures.

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
use crate::{
    analysis::Spectrum, hybrid::ContactView, orbit::Motion, plot::Axis, scene::Scene, simulation::Simulation,
    task::Task,
};

/// Rule and task of all figures.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Rule for the end of a transient.
    pub rule: Rule,
    /// Task that cancels the work and counts the scenes that were run.
    pub task: Task<'a>,
}

impl Context<'_> {
    /// Returns the steady motion of `scene`.
    pub(super) fn steady(&self, scene: &Scene, seed: Option<&Seed>) -> Result<Steady, StudyError> {
        // A figure needs only to know if the motion is periodic.
        let steady = steady(scene, seed, &Rule { decides: false, ..self.rule }, self.task);
        self.task.advance();
        steady
    }

    /// Records the settled motion over `cycles(period)` cycles, with `per_cycle` samples of each; returns its kind too, if `decides`.
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

    /// Applies `work` to every item, on all cores, with results in order; the first error in that order counts.
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

    /// Returns the steady motions along `values` of the number at `pointer`, each from the start of the scene.
    fn cold(&self, scene: &Scene, pointer: &str, values: &[f64]) -> Result<Vec<Steady>, StudyError> {
        self.each(values, |value| self.steady(&scene.with(pointer, json!(value))?, None))
    }

    /// Returns the steady motions along `values`, each started from the motion before it.
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

/// Number of a scene that a study varies.
pub(super) struct Quantity {
    /// Pointer to the number.
    pub pointer: String,
    /// Name and unit.
    pub axis: Axis,
}

/// Returns the number at `pointer` of a scene, or else the `usual` one.
pub(super) fn quantity(
    scene: &Scene,
    pointer: Option<&str>,
    usual: fn(&Scene) -> Option<Quantity>,
) -> Option<Quantity> {
    let at = |pointer: &str| Quantity {
        pointer: pointer.to_owned(),
        axis: Axis::of_number(pointer, scene.built().dimensionless),
    };
    pointer.map(at).or_else(|| usual(scene))
}

/// Returns the speed of a train: of its sun, its driving gear, or the shaft whose speed a gearbox gives.
pub(super) fn speed(scene: &Scene) -> Option<Quantity> {
    let (pointer, label) = match kind(scene) {
        "planetary" => ("/train/speed_rpm".to_owned(), "speed of the sun".to_owned()),
        "gear-pair" => ("/train/speed_rpm".to_owned(), "speed".to_owned()),
        "gearbox" => part(scene, "shafts", |shaft| shaft["speed_rpm"].is_number(), "speed_rpm", "speed of")?,
        _ => return None,
    };
    Some(Quantity { pointer, axis: Axis::new(label, "rev/min") })
}

/// Returns the load of a train: its output torque, the torque of a gear pair, the first torque of a shaft in a gearbox. If no shaft has
/// one, the drag of a loose gear.
pub(super) fn load(scene: &Scene) -> Option<Quantity> {
    let is_loaded = |shaft: &Value| shaft["torque_nm"].as_f64().is_some_and(|torque| torque != 0.0);
    let (pointer, label) = match kind(scene) {
        "planetary" => ("/train/load/output_torque_nm".to_owned(), "torque at the output".to_owned()),
        "gear-pair" => ("/train/torque_nm".to_owned(), "torque".to_owned()),
        "gearbox" => part(scene, "shafts", is_loaded, "torque_nm", "torque of").or_else(|| drag(scene))?,
        _ => return None,
    };
    Some(Quantity { pointer, axis: Axis::new(label, "N m") })
}

/// Returns the pointer to `key` of the first part of a gearbox of which `has` is true, and words for it.
fn part(scene: &Scene, list: &str, has: impl Fn(&Value) -> bool, key: &str, words: &str) -> Option<(String, String)> {
    let parts = scene.resolved()["train"][list].as_array()?;
    let i = parts.iter().position(has)?;
    Some((format!("/train/{list}/{i}/{key}"), format!("{words} {}", parts[i]["name"].as_str().unwrap_or_default())))
}

/// Returns the pointer to the drag torque of the first loose gear that has one, and words for it.
fn drag(scene: &Scene) -> Option<(String, String)> {
    let shafts = scene.resolved()["train"]["shafts"].as_array()?;
    shafts.iter().enumerate().find_map(|(i, shaft)| {
        let gears = shaft["gears"].as_array()?;
        let k = gears.iter().position(|gear| gear["drag"]["torque_nm"].as_f64().is_some_and(|drag| drag != 0.0))?;
        let name = gears[k]["name"].as_str().unwrap_or_default();
        Some((format!("/train/shafts/{i}/gears/{k}/drag/torque_nm"), format!("drag torque of {name}")))
    })
}

/// Returns the kind of a scene's train.
pub(super) fn kind(scene: &Scene) -> &str {
    scene.resolved()["train"]["kind"].as_str().unwrap_or_default()
}

/// Units of shown motions, and the factors that convert to them.
pub(super) struct Units {
    /// Time, ms.
    pub time: (f64, &'static str),
    /// Length, µm.
    pub length: (f64, &'static str),
    /// Force, N.
    pub force: &'static str,
    /// Frequency, Hz.
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

    /// Returns units that suit times up to `time`, s, and lengths up to `length`, m.
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

/// Returns a contact's name without its number: `ring-planet 2` is one of the `ring-planet` meshes. Contacts without given names, `contact
/// 2`, are no family, nor are meshes of numbered gears, `z23-z34`.
pub(super) fn family(name: &str) -> &str {
    match name.rsplit_once(' ') {
        Some((stem, number)) if stem != "contact" && number.bytes().all(|byte| byte.is_ascii_digit()) => stem,
        _ => name,
    }
}

/// Returns the first contact of each family of a case, in order: `(number, family)`.
pub(super) fn representatives(simulation: &Simulation) -> Vec<(usize, String)> {
    firsts((0..simulation.structure.contact_count()).map(|j| family(simulation.structure.contact_name(j))))
}

/// Returns the first contact of each family of a steady motion.
pub(super) fn families(steady: &Steady) -> Vec<(usize, String)> {
    firsts(steady.contacts.iter().map(|contact| family(&contact.report.name)))
}

/// Returns the first item of each family.
pub(super) fn firsts<'n>(families: impl Iterator<Item = &'n str>) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    for (j, family) in families.enumerate() {
        if found.iter().all(|(_, known)| known != family) {
            found.push((j, family.to_owned()));
        }
    }
    found
}

/// Returns the mesh frequency of a contact, Hz: from its teeth if the scene gives them, else that of the cycle.
pub(super) fn mesh_frequency(simulation: &Simulation, contact: usize) -> Result<f64, StudyError> {
    let name = family(simulation.structure.contact_name(contact));
    let own = simulation.meshes.iter().find(|mesh| family(&mesh.name) == name && mesh.frequency > 0.0);
    Ok(own.map_or(1.0 / simulation.period()?, |mesh| mesh.frequency))
}

/// Returns frequencies and amplitudes of a spectrum up to `highest`, without its mean.
pub(super) fn lines(spectrum: &Spectrum, highest: f64) -> Vec<(f64, f64)> {
    let lines = spectrum.frequencies().into_iter().zip(spectrum.amplitude.iter().copied()).skip(1);
    lines.take_while(|(frequency, _)| *frequency <= highest).collect()
}

/// Returns the number of local maxima of cyclic values.
fn maxima(values: &[f64]) -> usize {
    let n = values.len();
    (0..n).filter(|&i| values[i] > values[(i + n - 1) % n] && values[i] >= values[(i + 1) % n]).count()
}

/// Returns the facts under names that expressions can use (`sun_planet` for `sun-planet`).
pub(super) fn by_name(facts: impl IntoIterator<Item = (String, Value)>) -> Map<String, Value> {
    facts.into_iter().map(|(name, fact)| (name.replace(['-', ' '], "_"), fact)).collect()
}

/// Returns a number of a scene.
///
/// # Errors
/// [`StudyError`] if the scene has no number there.
pub(super) fn number(scene: &Scene, pointer: &str) -> Result<f64, StudyError> {
    let number = scene.resolved().pointer(pointer).and_then(Value::as_f64);
    number.ok_or_else(|| StudyError::missing(scene.name(), format!("it has no number {pointer}")))
}
