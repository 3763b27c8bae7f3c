//! Simplifications of a scene, from the most faithful model down.

use serde::Serialize;
use serde_json::{Value, json};

use super::{
    model::{FREEDOMS, Model, Step},
    simplify::{self, order},
};
use crate::{
    scene::Scene,
    simulation::{Simulation, SimulationError},
    study::{StudyError, figures},
    train::Quantity,
};

/// Kind of simplification of a ladder. Each rung includes the steps of those before it; ladders start from the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ladder {
    /// Fewer degrees of freedom.
    Freedoms,
    /// Simpler contact laws.
    Law,
    /// Fewer harmonics of errors and harmonic loads, the highest first.
    Excitation,
    /// Simpler stiffness in time.
    Stiffness,
    /// No forces of the turning frame.
    Frame,
    /// No damping in the gap.
    Gap,
}

impl Ladder {
    /// All ladders, in the order of a report.
    pub const ALL: [Self; 6] = [Self::Freedoms, Self::Law, Self::Excitation, Self::Stiffness, Self::Frame, Self::Gap];
}

/// A simpler model that can be tried.
#[derive(Clone, Debug)]
pub(super) struct PlannedRung {
    /// Ladder of the rung; none for the scene itself.
    pub ladder: Option<Ladder>,
    pub words: String,
    pub steps: Vec<Step>,
}

/// Model or figure that could not be made or measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Omission {
    /// Name of the missing model or figure.
    pub words: String,
    /// Reason for which it is missing.
    pub why: String,
}

/// Rungs of a scene, ladder by ladder, and the ladders without rungs.
pub(super) struct Rungs {
    pub planned: Vec<PlannedRung>,
    pub left: Vec<Omission>,
    simulation: Simulation,
    period: f64,
}

impl Rungs {
    /// Finds the rungs; fails for a scene without a forcing period or contacts.
    pub fn new(scene: &Scene) -> Result<Self, StudyError> {
        let simulation = Simulation::from_scene(scene)?;
        let period = simulation.period()?;
        if simulation.structure.contacts().is_empty() {
            return Err(simulation.missing("it has no contacts, so that nothing separates; add one").into());
        }
        let mut rungs = Self { planned: Vec::new(), left: Vec::new(), simulation, period };
        match figures::kind(scene) {
            "planetary" => rungs.planetary(scene),
            kind => rungs.others(kind),
        }
        rungs.law();
        rungs.excitation();
        rungs.stiffness();
        let train = &scene.resolved()["train"];
        let flag = |key: &str| train[key] == json!(true);
        if flag("gyroscopic") {
            let off = vec![Step::Set("/train/gyroscopic", json!(false))];
            rungs.add(Ladder::Frame, "no gyroscopic terms", off);
        }
        if flag("damping_in_gap") && train["damping_ratio"].as_f64().unwrap_or(0.0) > 0.0 {
            let off = vec![Step::Set("/train/damping_in_gap", json!(false))];
            rungs.add(Ladder::Gap, "no damping in the gap", off);
        }
        Ok(rungs)
    }

    fn add(&mut self, ladder: Ladder, words: impl Into<String>, steps: Vec<Step>) {
        self.planned.push(PlannedRung { ladder: Some(ladder), words: words.into(), steps });
    }

    fn leave(&mut self, words: &str, why: impl Into<String>) {
        self.left.push(Omission { words: words.to_owned(), why: why.into() });
    }

    fn planetary(&mut self, scene: &Scene) {
        let now = &scene.resolved()["train"]["freedoms"];
        let own = self.simulation.structure.spec().freedoms.clone();
        if *now == "full-carrier" {
            self.add(Ladder::Freedoms, "carrier centre held", vec![Step::Set(FREEDOMS, json!("full"))]);
        }
        let mut in_phase = *now == "in-phase";
        let mut steps = Vec::new();
        if *now == "full" || *now == "full-carrier" {
            let step = vec![Step::Set(FREEDOMS, json!("in-phase"))];
            match Model::new(scene, &step) {
                Ok(_) => {
                    (in_phase, steps) = (true, step);
                    self.add(Ladder::Freedoms, "planets in phase", steps.clone());
                }
                Err(StudyError::Simulation(SimulationError::Scene(error))) => {
                    let why: Vec<&str> = error.faults.iter().map(|fault| fault.found.as_str()).collect();
                    self.leave("planets in phase", why.join("; "));
                }
                Err(error) => self.leave("planets in phase", error.to_string()),
            }
        }
        let rotations: Vec<&String> = own.iter().filter(|name| name.starts_with('u')).collect();
        let turned = steps.len();
        if in_phase {
            steps.push(Step::Carried(["xi", "eta"].map(String::from).to_vec()));
        } else if rotations.len() < own.len() && !rotations.is_empty() {
            steps.push(Step::Set(FREEDOMS, Value::from(rotations.into_iter().cloned().collect::<Vec<_>>())));
        }
        if steps.len() > turned {
            self.add(Ladder::Freedoms, "rotations only", steps.clone());
        }
        steps.push(Step::Alone);
        self.add(Ladder::Freedoms, "each mesh on its own", steps);
    }

    fn others(&mut self, kind: &str) {
        let spec = self.simulation.structure.spec();
        let mut steps = Vec::new();
        let translations: Vec<String> = spec.freedoms.iter().filter(|name| !name.starts_with('u')).cloned().collect();
        if spec.freedoms.len() == 1 {
            return self.leave("fewer freedoms", "it has one: there is nothing to drop");
        }
        let single = spec.contacts.len() == 1;
        if kind == "gear-pair" && !translations.is_empty() {
            steps.push(Step::Set(FREEDOMS, json!("torsional")));
            self.add(Ladder::Freedoms, "rotations only", steps.clone());
        }
        let words = if single { "one freedom, the deflection" } else { "each contact on its own" };
        steps.push(Step::Alone);
        self.add(Ladder::Freedoms, words, steps);
    }

    fn law(&mut self) {
        let spec = self.simulation.structure.spec();
        if spec.contacts.iter().any(|contact| contact.law.power().is_some()) {
            match simplify::linear_laws(&self.simulation.structure) {
                Ok(laws) => self.add(Ladder::Law, "linear law", vec![Step::Linear(laws)]),
                Err(error) => self.leave("linear law", error.to_string()),
            }
        }
        if self.simulation.structure.spec().has(Quantity::Damping) {
            // A separate rung: damping removed from the law of the scene.
            self.add(Ladder::Law, "no damping in the contacts", vec![Step::Undamped]);
        }
    }

    fn excitation(&mut self) {
        let spec = self.simulation.structure.spec();
        let found = simplify::excitations(spec);
        let moves_without = simplify::varies(spec);
        for (i, &omega) in found.iter().enumerate() {
            let words = match found.get(i + 1) {
                Some(next) => format!("excitation up to order {}", order(*next, self.period)),
                None if moves_without => "no excitation but the stiffness".to_owned(),
                None => {
                    let words = format!("no excitation of order {}", order(omega, self.period));
                    return self.leave(&words, "nothing else moves the train");
                }
            };
            self.add(Ladder::Excitation, words, vec![Step::ExcitationBelow(omega)]);
        }
    }

    fn stiffness(&mut self) {
        let spec = self.simulation.structure.spec().clone();
        if simplify::has_ramps(&spec) {
            self.add(Ladder::Stiffness, "stiffness in steps", vec![Step::Stepped]);
        }
        let harmonics = simplify::stiffness_harmonics(&spec);
        for pair in harmonics.windows(2) {
            let words = format!("stiffness up to order {}", order(pair[1], self.period));
            self.add(Ladder::Stiffness, words, vec![Step::StiffnessBelow(pair[0])]);
        }
        if simplify::varies(&spec) {
            if simplify::excitations(&spec).is_empty() {
                self.leave("mean stiffness", "nothing else moves the train");
            } else {
                self.add(Ladder::Stiffness, "mean stiffness", vec![Step::MeanStiffness]);
            }
        }
    }
}
