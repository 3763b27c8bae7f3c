//! Effects of numbers of a scene on results: one change at a time.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{
    StudyError,
    figures::{Context, Quantity, number},
    threshold::{LossCriterion, ThresholdSearch, locate},
};
use crate::{output::Table, scene::Scene};

/// Effect of a change on the motion of a mesh.
pub struct Effect {
    /// The change.
    pub words: String,
    /// Time without force over the mesh period at each speed.
    pub apart: Vec<f64>,
    /// Load at which separations end; 0 if there are none at any load.
    pub threshold: f64,
    /// Largest force, N.
    pub largest: f64,
}

/// Changes to try, and the mesh that is studied.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Changes {
    title: String,
    note: String,
    /// Mesh: the first whose name starts with this.
    contact: String,
    /// Speed at which threshold and force are determined.
    threshold_at: f64,
    pub changes: Vec<Change>,
}

/// Change in the form of its table: values to set, factors of numbers, and factors of the harmonics of an error. The last factor applies to
/// all further harmonics.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Change {
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

impl Changes {
    /// Returns time without force, threshold (by deflection) and largest force of the mesh under each change, all from cold starts.
    pub fn effects(
        &self,
        context: &Context<'_>,
        scene: &Scene,
        ([load, speed], speeds): (&[Quantity; 2], &[f64]),
        search: &ThresholdSearch,
    ) -> Result<Vec<Effect>, StudyError> {
        let steady = |scene: &Scene, rpm: f64| context.steady(&scene.with(&speed.pointer, json!(rpm))?, None);
        context.each(&self.changes, |change| {
            let changed = change.of(scene)?;
            let apart = speeds
                .iter()
                .map(|rpm| Ok(steady(&changed, *rpm)?.expect(&self.contact, scene)?.report.no_force_fraction));
            let apart = apart.collect::<Result<_, StudyError>>()?;
            let at = changed.with(&speed.pointer, json!(self.threshold_at))?;
            let largest = context.steady(&at, None)?.expect(&self.contact, scene)?.report.force_max.unwrap_or_default();
            let threshold = locate(context, &at, &load.pointer, (&self.contact, LossCriterion::Deflection), search)?;
            Ok(Effect { words: change.words.clone(), apart, threshold: threshold.middle().unwrap_or(0.0), largest })
        })
    }

    /// Returns the effects of the changes as a table.
    pub fn listing(&self, effects: &[Effect], ([load, speed], speeds): (&[Quantity; 2], &[f64])) -> Table {
        let cells = |effect: &Effect| {
            let apart = effect.apart.iter().map(|apart| format!("{apart:.3}"));
            let rest = [format!("{:.2}", effect.threshold), format!("{:.1}", effect.largest)];
            std::iter::once(effect.words.clone()).chain(apart).chain(rest).collect()
        };
        let speeds = speeds.iter().map(|rpm| format!("Without force at {rpm} {}, T", speed.axis.unit));
        let head = std::iter::once("Change".to_owned()).chain(speeds);
        let head = head.chain([format!("Threshold, {}", load.axis.unit), "Largest force, N".to_owned()]);
        Table::new(head).with(effects.iter().map(cells)).titled(&self.title, &self.note)
    }
}
