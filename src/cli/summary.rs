//! What is left of a run: `summary.json`.

use flank::{
    analysis::{Balance, ContactReport},
    engine::{Counters, EngineError, Outcome, State},
    scene::Duration,
    verify::Verification,
};
use serde::Serialize;

use super::{progress, session::Session};

/// Everything measured in a run, and what it came from. No wall time: the same input gives the same bytes.
#[derive(Debug, Serialize)]
pub struct Summary {
    pub flank: &'static str,
    pub scene: Provenance,
    pub train: Train,
    pub integrator: Integrator,
    pub outcome: Ending,
    /// Time the measures cover.
    pub measured_time: f64,
    pub contacts: Vec<ContactReport>,
    pub energy: Balance,
    pub work: Work,
    /// What was verified, where it was asked for.
    pub verification: Option<Verification>,
    pub warnings: Vec<String>,
}

impl Summary {
    /// The first measure that is not a finite number, if any.
    pub fn overflow(&self) -> Option<String> {
        let energy = [("the energy at the start", self.energy.start), ("the energy ledger", self.energy.residual)];
        let forces =
            self.contacts.iter().flat_map(|c| [c.force_mean, c.force_abs_max, c.energy_lost].map(|v| (&*c.name, v)));
        let first = energy.into_iter().chain(forces).find(|(_, value)| !value.is_finite());
        first.map(|(name, _)| format!("a measure of the run ({name})"))
    }
}

/// The scene.
#[derive(Debug, Serialize)]
pub struct Provenance {
    pub name: String,
    /// Of the scene with all defaults, name and note left out.
    pub sha256: String,
}

/// The train.
#[derive(Debug, Serialize)]
pub struct Train {
    pub kind: String,
    pub freedoms: Vec<String>,
    pub dimensionless: bool,
    pub cycle: Option<f64>,
}

/// What integrated the smooth motion.
#[derive(Debug, Serialize)]
pub struct Integrator {
    pub asked: &'static str,
    pub tolerance: f64,
    pub why: String,
    /// States of the contacts, and the integrator of that mode, where it was chosen mode by mode.
    pub modes: Vec<(String, &'static str)>,
}

/// How the run ended.
#[derive(Clone, Debug, Serialize)]
pub struct Ending {
    /// `reached-end`, `interrupted`, `stopped`, `event-budget-spent` or `failed`.
    pub kind: &'static str,
    /// What failed.
    pub reason: Option<String>,
    /// Where the run stands, to 32 digits.
    pub t: String,
    pub seconds: f64,
    pub cycle: i64,
    pub phase: f64,
    /// Contact states there.
    pub mode: String,
    /// State there.
    pub q: Vec<f64>,
    pub v: Vec<f64>,
}

/// Work done; see [`Counters`].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Work {
    pub steps: u64,
    pub arcs: u64,
    pub events: u64,
    pub guards_fired: u64,
    pub switches: u64,
    pub grazes: u64,
    pub accumulations: u64,
    pub splits: u64,
}

impl From<Counters> for Work {
    fn from(c: Counters) -> Self {
        Self {
            steps: c.steps,
            arcs: c.arcs,
            events: c.events,
            guards_fired: c.fired,
            switches: c.switches,
            grazes: c.grazes,
            accumulations: c.accumulations,
            splits: c.splits,
        }
    }
}

impl Provenance {
    pub fn of(session: &Session) -> Self {
        Self { name: session.scene.name().to_owned(), sha256: session.scene.hash() }
    }
}

impl Train {
    pub fn of(session: &Session) -> Self {
        Self {
            kind: session.scene.resolved()["train"]["kind"].as_str().unwrap_or_default().to_owned(),
            freedoms: session.case.structure.spec().freedoms.clone(),
            dimensionless: session.case.built.dimensionless,
            cycle: session.case.built.run.period,
        }
    }
}

impl Ending {
    pub fn of(session: &Session, result: &Result<Outcome, EngineError>, state: &State) -> Self {
        let kind = match result {
            Ok(Outcome::ReachedEnd) => "reached-end",
            Ok(Outcome::StoppedByObserver) if progress::interrupted() => "interrupted",
            Ok(Outcome::StoppedByObserver) => "stopped",
            Ok(Outcome::EventBudgetSpent) => "event-budget-spent",
            Err(_) => "failed",
        };
        let (structure, t) = (&session.case.structure, session.case.structure.clock().time(state.at));
        let n = structure.freedoms();
        Self {
            kind,
            reason: result.as_ref().err().map(ToString::to_string),
            t: t.decimal(32),
            seconds: t.value(),
            cycle: state.at.cycle,
            phase: state.at.phase.value(),
            mode: session.mode_in_words(state.jump.mode),
            q: state.x[..n].to_vec(),
            v: state.x[n..2 * n].to_vec(),
        }
    }
}

/// How long the run was to be, in words.
pub fn asked_for(session: &Session) -> String {
    match session.case.built.run.duration {
        Duration::Cycles(n) => format!("{n} cycles"),
        Duration::Until(end) => format!("until t = {end}"),
    }
}
