//! Summary of a run: `summary.json`.

use serde::Serialize;

use super::{Simulation, SimulationError};
use crate::{
    analysis::{Balance, BearingReport, ContactReport, TransmissionReport},
    engine::{Counters, EngineError, Outcome, State},
    verify::Verification,
};

/// All measures of a run, with their origin. It contains no wall time: the same input gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Version of Flank.
    pub flank: &'static str,
    /// Origin of the train.
    pub scene: Provenance,
    /// The train.
    pub train: TrainUsed,
    /// Periods of the forcing clock, such as mesh periods, after which all forcing repeats; null without such a number.
    pub common_cycle: Option<u64>,
    /// Integrator of the smooth motion.
    pub integrator: IntegratorUsed,
    /// End of the run.
    pub outcome: RunEnd,
    /// Time of the measures, s.
    pub measured_time: f64,
    /// Measures of each contact.
    pub contacts: Vec<ContactReport>,
    /// Dynamic transmission error of each contact, with eight harmonics of the forcing.
    pub transmission: Vec<TransmissionReport>,
    /// Forces of the bearings.
    pub bearings: Vec<BearingReport>,
    /// The energy ledger.
    pub energy: Balance,
    /// Work done.
    pub work: Counters,
    /// Result of the verification, if requested.
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

/// Origin of a train.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Provenance {
    /// Name of the simulation.
    pub name: String,
    /// SHA-256 of the scene with all defaults, without name and note; null for a train built in Rust.
    pub sha256: Option<String>,
}

/// Train in a summary.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TrainUsed {
    /// Kind in a scene; `spec` for a train built in Rust.
    pub kind: String,
    /// Names of its degrees of freedom.
    pub freedoms: Vec<String>,
    /// True if its numbers have no units.
    pub dimensionless: bool,
    /// Length of a cycle, s.
    pub cycle: Option<f64>,
}

/// Integrator of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct IntegratorUsed {
    /// Requested method.
    pub asked: &'static str,
    /// Local error, relative to the scale of the motion.
    pub tolerance: f64,
    /// Target for the error of an event's time that an arc may add, as a share of the cycle; 0 is full precision.
    pub event_tolerance: f64,
    /// Vector instructions of the sums of series.
    pub instructions: &'static str,
    /// Reason for the choice.
    pub why: String,
    /// States of the contacts, with the integrator of that mode, if it was chosen mode by mode.
    pub modes: Vec<(String, &'static str)>,
}

/// Kind of end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum EndKind {
    /// The run reached its planned end.
    ReachedEnd,
    /// Its [`Task`](crate::Task) was cancelled.
    Interrupted,
    /// An observer stopped it, or a file that cannot be written.
    Stopped,
    /// The limit on events was reached.
    EventBudgetSpent,
    /// The run failed with an error.
    Failed,
}

/// End of a run, with the state there.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RunEnd {
    /// Kind of the end.
    pub kind: EndKind,
    /// Failure, in words.
    pub reason: Option<String>,
    /// Time, s, in 32 digits.
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
            Ok(Outcome::ReachedEnd) => EndKind::ReachedEnd,
            Ok(Outcome::StoppedByObserver) if is_cancelled => EndKind::Interrupted,
            Ok(Outcome::StoppedByObserver) => EndKind::Stopped,
            Ok(Outcome::EventBudgetSpent) => EndKind::EventBudgetSpent,
            Err(_) => EndKind::Failed,
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

    /// Marks a run as failed, for numbers that contradict each other, wherever it ended.
    pub(super) fn fail(&mut self, failure: &SimulationError) {
        self.kind = EndKind::Failed;
        self.reason.get_or_insert_with(|| failure.to_string());
    }
}
