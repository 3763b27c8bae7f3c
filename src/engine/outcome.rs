use crate::{hybrid::ModelError, integrate::IntegrateError};

/// How a run ended. All of these are results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The end was reached.
    ReachedEnd,
    /// An observer broke off.
    StoppedByObserver,
    /// The event budget was spent.
    EventBudgetSpent,
}

/// Why a run failed. What was logged until then stands.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The integrator failed.
    #[error("with {mode}: {source}")]
    Integrate {
        /// In which mode, in the system's words.
        mode: String,
        /// Why.
        source: IntegrateError,
    },
    /// The automaton could not jump.
    #[error("at t = {t} s: {source}")]
    Model {
        /// When, s.
        t: f64,
        /// Why.
        source: ModelError,
    },
    /// Two numbers that must agree do not.
    #[error(
        "at t = {t} s {what}: {guard}, by {amount:e} where {limit:e} is allowed; the events up to there stand, please report the scene"
    )]
    Alarm {
        /// When, s.
        t: f64,
        /// Which guard, in the system's words.
        guard: String,
        /// What is tested.
        what: &'static str,
        /// By how much they differ, in the guard's units.
        amount: f64,
        /// By how much they may.
        limit: f64,
    },
    /// The clock does not tell the ends of many arcs from their starts.
    #[error(
        "at t = {t} s time stands still: {arcs} arcs in a row are shorter than the clock resolves; the events up to there stand"
    )]
    Still {
        /// When, s.
        t: f64,
        /// Arcs in a row.
        arcs: u32,
    },
    /// The motion takes more steps than the run is allowed.
    #[error(
        "at t = {t} s the step budget of {steps} is spent; the events up to there stand; \
         raise run.step_budget, run shorter, or check the units of stiffness, inertia and speed"
    )]
    Steps {
        /// When, s.
        t: f64,
        /// The budget.
        steps: u64,
    },
    /// Jumps at one instant that lead to each other without end.
    #[error("at t = {t} s the jumps do not come to rest after {rounds} rounds; they go round through: {}", cycle.join("; "))]
    Cycle {
        /// When, s.
        t: f64,
        /// Jumps made.
        rounds: usize,
        /// The modes they go through, in the system's words: from the last one back to where it was met before, or all.
        cycle: Vec<String>,
    },
}
