use crate::{hybrid::ModelError, integrate::IntegrateError};

/// Regular end of a run. All of these are results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The end was reached.
    ReachedEnd,
    /// An observer stopped the run.
    StoppedByObserver,
    /// The event budget was spent.
    EventBudgetSpent,
}

/// Failure of a run. Everything logged before it remains valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The integrator failed.
    #[error("with {mode}: {source}")]
    Integrate {
        /// Mode, in the words of the system.
        mode: String,
        /// Cause.
        source: IntegrateError,
    },
    /// The automaton could not jump.
    #[error("at t = {t} s: {source}")]
    Model {
        /// Time, s.
        t: f64,
        /// Cause.
        source: ModelError,
    },
    /// Two numbers that must agree do not.
    #[error(
        "at t = {t} s {what}: {guard}, by {amount:e} where {limit:e} is allowed; the events up to there stand, please report the scene"
    )]
    Alarm {
        /// Time, s.
        t: f64,
        /// Guard, in the words of the system.
        guard: String,
        /// Description of the failed test.
        what: &'static str,
        /// Difference of the two numbers, in units of the guard.
        amount: f64,
        /// Largest permitted difference, in units of the guard.
        limit: f64,
    },
    /// The clock cannot distinguish the ends of many arcs from their starts.
    #[error(
        "at t = {t} s time stands still: {arcs} arcs in a row are shorter than the clock resolves; the events up to there stand"
    )]
    Still {
        /// Time, s.
        t: f64,
        /// Number of such arcs in a row.
        arcs: u32,
    },
    /// The motion takes more steps than the run is allowed.
    #[error(
        "at t = {t} s the step budget of {steps} is spent; the events up to there stand; \
         raise run.step_budget, run shorter, or check the units of stiffness, inertia and speed"
    )]
    Steps {
        /// Time, s.
        t: f64,
        /// Budget of steps.
        steps: u64,
    },
    /// Jumps at one instant that lead to each other without end.
    #[error("at t = {t} s the jumps do not come to rest after {rounds} rounds; they go round through: {}", cycle.join("; "))]
    Cycle {
        /// Time, s.
        t: f64,
        /// Number of jumps made.
        rounds: usize,
        /// Modes of the cycle, in the words of the system: since the previous occurrence of the last one, or all.
        cycle: Vec<String>,
    },
}
