use crate::{
    hybrid::{Mode, ModelError},
    integrate::IntegrateError,
};

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
    #[error("in mode {mode:?}: {source}")]
    Integrate {
        /// In which mode.
        mode: Mode,
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
    /// Jumps at one instant that lead to each other without end.
    #[error("at t = {t} s the jumps do not come to rest after {} rounds; the last modes were {modes:?}", modes.len())]
    Cycle {
        /// When, s.
        t: f64,
        /// The modes visited.
        modes: Vec<Mode>,
    },
}
