//! Orbits in the form of files.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{
    Orbit,
    words::{is_gained, normal, parts, text},
};
use crate::{simulation::Simulation, system::ContactMode};

/// Returns the names of the components of the state.
#[must_use]
pub fn components(simulation: &Simulation) -> Vec<String> {
    let spec = simulation.structure.spec();
    let of = |kind: &str| spec.freedoms.iter().map(move |name| format!("{kind} {name}")).collect::<Vec<_>>();
    let latched = simulation.structure.latched().map(|(j, side)| {
        let flank = if side < 0.0 { " back flank" } else { "" };
        format!("latched {}{flank}", spec.contacts[j].name)
    });
    of("q").into_iter().chain(of("v")).chain(latched).collect()
}

/// Orbit in the form of a file.
#[derive(Serialize)]
struct OrbitEntry {
    period_cycles: u64,
    word: String,
    /// Contacts gained and impacts, per period of the forcing: p/q.
    impacts_per_period: String,
    x: Vec<f64>,
    multipliers: Vec<[f64; 2]>,
    stable: bool,
    /// True if a multiplier is so near to the unit circle that rounding may decide on `stable`.
    marginal: bool,
    residual: f64,
    condition: f64,
    contacts: Vec<&'static str>,
    piecewise: bool,
    /// Place at which the derivative is that of one order of impacts.
    #[serde(skip_serializing_if = "Option::is_none")]
    corner: Option<Value>,
    /// True if an event lies on phase 0: its part of word and multipliers may be missing, or counted twice.
    event_at_phase_0: bool,
    symmetric: bool,
    /// Index in the list of the orbit that a symmetry of the train maps to this one.
    #[serde(skip_serializing_if = "Option::is_none")]
    partner: Option<usize>,
    initial: Value,
}

impl Orbit {
    /// Returns the word of the orbit, in normal form.
    #[must_use]
    pub fn word(&self) -> String {
        text(&normal(&self.image.word))
    }

    /// Returns the count of contacts gained and impacts in the period.
    #[must_use]
    pub fn impacts(&self) -> usize {
        self.image.word.iter().flat_map(|token| parts(token)).filter(|token| is_gained(token)).count()
    }

    /// Returns a block of a scene that starts there.
    fn initial(&self, simulation: &Simulation) -> Value {
        let structure = &simulation.structure;
        let (n, x) = (structure.freedoms(), &self.section.x);
        let mut initial = json!({ "q": x[..n], "v": x[n..2 * n] });
        let mut latched = Map::new();
        let mut detached = Vec::new();
        for (j, (c, state)) in structure.contacts().iter().zip(&self.section.contacts).enumerate() {
            let latch = structure.latch_on(j, state.side());
            if let Some(latch) = latch.filter(|_| *state != ContactMode::Separated) {
                latched.insert(c.spec.name.clone(), json!(x[latch]));
            }
            if matches!(state, ContactMode::DriveDetached | ContactMode::BackDetached) {
                detached.push(c.spec.name.clone());
            }
        }
        if !latched.is_empty() {
            initial["latched"] = latched.into();
        }
        if !detached.is_empty() {
            initial["detached"] = json!(detached);
        }
        initial
    }

    pub(super) fn report(&self, simulation: &Simulation) -> Value {
        let (x, structure) = (&self.section.x, &simulation.structure);
        let row = OrbitEntry {
            period_cycles: self.period,
            word: self.word(),
            impacts_per_period: format!("{}/{}", self.impacts(), self.period),
            x: x.clone(),
            multipliers: self.multipliers.iter().map(|m| [m.re, m.im]).collect(),
            stable: self.is_stable,
            marginal: self.is_marginal,
            residual: self.residual,
            condition: self.condition,
            contacts: self.section.contacts.iter().map(|contact| contact.name()).collect(),
            piecewise: self.image.corner.is_some(),
            corner: self.image.corner.as_ref().map(|corner| {
                let name = |j: &usize| structure.contacts()[*j].spec.name.clone();
                let period = simulation.clock().period().map_or(f64::NAN, |period| period.value());
                json!({ "phase": corner.phase / period, "contacts": corner.contacts.iter().map(name).collect::<Vec<_>>() })
            }),
            event_at_phase_0: self.image.has_event_at_section,
            symmetric: self.is_symmetric,
            partner: self.partner,
            initial: self.initial(simulation),
        };
        json!(row)
    }
}
