//! The record of a run: `summary.json`.

use serde::Serialize;

use super::{Simulation, SimulationError};
use crate::{
    analysis::{Balance, BearingReport, ContactReport, TransmissionReport},
    engine::{Counters, EngineError, Outcome, State},
    verify::Verification,
};

/// Everything measured in a run, and what it came from. No wall time: the same input gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Version of Flank.
    pub flank: &'static str,
    /// Where the train came from.
    pub scene: Provenance,
    /// The train.
    pub train: TrainUsed,
    /// Periods of the forcing clock, such as mesh periods, after which all forcing repeats; null where there is no such number.
    pub common_cycle: Option<u64>,
    /// What integrated the smooth motion.
    pub integrator: IntegratorUsed,
    /// How the run ended.
    pub outcome: RunEnd,
    /// Time the measures cover, s.
    pub measured_time: f64,
    /// Measures of each contact.
    pub contacts: Vec<ContactReport>,
    /// The dynamic transmission error of each contact, with eight harmonics of the forcing.
    pub transmission: Vec<TransmissionReport>,
    /// Forces of the bearings.
    pub bearings: Vec<BearingReport>,
    /// The energy ledger.
    pub energy: Balance,
    /// Work done.
    pub work: Counters,
    /// What was verified, where it was asked for.
    pub verification: Option<Verification>,
    /// Warnings of the scene.
    pub warnings: Vec<String>,
}

impl Summary {
    /// Names the first measure that is not a finite number, if any.
    pub(super) fn overflow(&self) -> Option<String> {
        let energy = [("the energy at the start", self.energy.start), ("the energy ledger", self.energy.residual)];
        let forces =
            self.contacts.iter().flat_map(|c| [c.force_mean, c.force_abs_max, c.energy_lost].map(|v| (&*c.name, v)));
        let transmission = self.transmission.iter().flat_map(|t| [t.mean, t.rms].map(|v| (&*t.name, v)));
        let first = energy.into_iter().chain(forces).chain(transmission).find(|(_, value)| !value.is_finite());
        first.map(|(name, _)| format!("a measure of the run ({name})"))
    }
}

/// Where a train came from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// Name of the simulation.
    pub name: String,
    /// Hash of the scene with all defaults, name and note left out; null for a train built in Rust.
    pub sha256: Option<String>,
}

/// A train in a summary.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrainUsed {
    /// Its kind in a scene; `spec` for a train built in Rust.
    pub kind: String,
    /// Names of its degrees of freedom.
    pub freedoms: Vec<String>,
    /// Whether its numbers carry no units.
    pub dimensionless: bool,
    /// Length of a cycle, s.
    pub cycle: Option<f64>,
}

/// The integrator of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IntegratorUsed {
    /// Method that was asked for.
    pub asked: &'static str,
    /// Local error, relative to the scale of the motion.
    pub tolerance: f64,
    /// Error of an event's time that an arc may add, of the cycle, as it is aimed at; 0 is full precision.
    pub event_tolerance: f64,
    /// Vector instructions that the series were summed by.
    pub instructions: &'static str,
    /// Reason for the choice.
    pub why: String,
    /// States of the contacts, and the integrator of that mode, where it was chosen mode by mode.
    pub modes: Vec<(String, &'static str)>,
}

/// Kind of end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// At its end.
    ReachedEnd,
    /// By its [`Task`](crate::Task).
    Interrupted,
    /// By an observer, or a file that cannot be written.
    Stopped,
    /// By the most events allowed.
    EventBudgetSpent,
    /// By an error.
    Failed,
}

/// How a run ended, and the state there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunEnd {
    /// How.
    pub kind: Ended,
    /// What failed.
    pub reason: Option<String>,
    /// Time, s, to 32 digits.
    pub t: String,
    /// Time rounded to a double, s.
    pub seconds: f64,
    /// Forcing cycle.
    pub cycle: i64,
    /// Time since the start of the cycle, s.
    pub phase: f64,
    /// States of the contacts.
    pub mode: String,
    /// Coordinates, `[n]`.
    pub q: Vec<f64>,
    /// Velocities, `[n]`.
    pub v: Vec<f64>,
}

impl RunEnd {
    pub(super) fn new(
        simulation: &Simulation,
        result: &Result<Outcome, EngineError>,
        is_cancelled: bool,
        state: &State,
    ) -> Self {
        let kind = match result {
            Ok(Outcome::ReachedEnd) => Ended::ReachedEnd,
            Ok(Outcome::StoppedByObserver) if is_cancelled => Ended::Interrupted,
            Ok(Outcome::StoppedByObserver) => Ended::Stopped,
            Ok(Outcome::EventBudgetSpent) => Ended::EventBudgetSpent,
            Err(_) => Ended::Failed,
        };
        let (t, n) = (simulation.clock().time(state.at), simulation.structure.freedoms());
        Self {
            kind,
            reason: result.as_ref().err().map(ToString::to_string),
            t: t.decimal(32),
            seconds: t.value(),
            cycle: state.at.cycle,
            phase: state.at.phase.value(),
            mode: simulation.mode_name(&state.jump.mode),
            q: state.x[..n].to_vec(),
            v: state.x[n..2 * n].to_vec(),
        }
    }

    /// A run whose numbers contradict each other has failed, wherever it ended.
    pub(super) fn fail(&mut self, failure: &SimulationError) {
        self.kind = Ended::Failed;
        self.reason.get_or_insert_with(|| failure.to_string());
    }
}
