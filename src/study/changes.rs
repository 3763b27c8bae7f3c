//! Which number of the reference set controls which result: one change at a time.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    figures::{Context, number},
    published::table,
    threshold::{By, Search, locate},
};
use crate::{output::Table, scene::Scene};

/// What a change did to the motion of the last mesh family.
pub struct Effect {
    /// The change.
    pub words: String,
    /// Time without force over the mesh period at each speed.
    pub apart: Vec<f64>,
    /// The load at which separations end, N m; 0 if there are none at any load.
    pub threshold: f64,
    /// Largest force, N.
    pub largest: f64,
}

/// Speeds at which the time apart is compared, rev/min; threshold and force belong to the second.
const SPEEDS: [f64; 3] = [50.0, 500.0, 2000.0];

/// A change as its table holds it: values to set, factors of numbers, and factors of the harmonics of an error, the last of
/// which goes for all that follow.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    words: String,
    #[serde(default)]
    set: Map<String, Value>,
    #[serde(default)]
    times: BTreeMap<String, f64>,
    #[serde(default)]
    harmonics: BTreeMap<String, Vec<f64>>,
}

impl Change {
    fn of(&self, scene: &Scene) -> Result<Scene, StudyError> {
        let mut times = Vec::with_capacity(self.times.len());
        for (at, factor) in &self.times {
            times.push((at.as_str(), json!(factor * number(scene, at)?)));
        }
        let harmonics = self.harmonics.iter().map(|(at, factors)| (at.as_str(), scaled(scene, at, factors)));
        let set = self.set.iter().map(|(at, value)| (at.as_str(), value.clone()));
        Ok(scene.with_all(times.into_iter().chain(harmonics).chain(set))?)
    }
}

fn scaled(scene: &Scene, pointer: &str, factors: &[f64]) -> Value {
    let mut harmonics = scene.resolved().pointer(pointer).cloned().unwrap_or_default();
    for (i, harmonic) in harmonics.as_array_mut().into_iter().flatten().enumerate() {
        let factor = factors.get(i).or(factors.last()).copied().unwrap_or(1.0);
        harmonic["amplitude_m"] = json!(harmonic["amplitude_m"].as_f64().unwrap_or(0.0) * factor);
    }
    harmonics
}

/// The changes of the reference set under light load.
pub fn changes() -> Result<Vec<Change>, StudyError> {
    table(include_str!("published/changes.json"))
}

/// Time without force, threshold (by deflection) and largest force of the meshes `stem` under each change, all from cold starts.
pub fn effects(
    context: &Context<'_>,
    scene: &Scene,
    stem: &str,
    changes: &[Change],
    search: &Search,
) -> Result<Vec<Effect>, StudyError> {
    context.each(changes, |change| {
        let changed = change.of(scene)?;
        let mut apart = Vec::new();
        let mut largest = 0.0;
        for rpm in SPEEDS {
            let steady = context.steady(&changed.with("/train/speed_rpm", json!(rpm))?, None)?;
            let contact = steady.expect(stem, scene)?;
            apart.push(contact.report.no_force_fraction);
            if rpm == SPEEDS[1] {
                largest = contact.report.force_max.unwrap_or_default();
            }
        }
        let at = changed.with("/train/speed_rpm", json!(SPEEDS[1]))?;
        let threshold = locate(context, &at, "/train/load/output_torque_nm", (stem, By::Deflection), search)?;
        Ok(Effect { words: change.words.clone(), apart, threshold: threshold.middle().unwrap_or(0.0), largest })
    })
}

/// What controls what, as a table.
pub fn listing(effects: &[Effect]) -> Table {
    let cells = |effect: &Effect| {
        let apart = effect.apart.iter().map(|apart| format!("{apart:.3}"));
        let rest = [format!("{:.2}", effect.threshold), format!("{:.1}", effect.largest)];
        std::iter::once(effect.words.clone()).chain(apart).chain(rest).collect()
    };
    let speeds = SPEEDS.map(|rpm| format!("Without force at {rpm} rev/min, T"));
    let head = std::iter::once("Change".to_owned()).chain(speeds);
    let note = "Ring meshes without load, one change at a time, every motion from a cold start; threshold (by deflection) and force at \
                500 rev/min. At 2000 rev/min small changes also change the last impact of the sun meshes, and with it the \
                damping: read that column with care.";
    let head = head.chain(["Threshold, N m", "Largest force, N"].map(String::from));
    Table::new(head).with(effects.iter().map(cells)).titled("What controls what", note)
}
