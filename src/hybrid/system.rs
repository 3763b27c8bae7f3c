use super::{Clock, Flow, Guard, GuardId, GuardSet, Instant, Mode};

/// Why a model could not carry out what the engine asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A jump was asked for that the automaton has no edge for.
    #[error("guard {guard} of {element} fired in mode {mode}, which has no such edge")]
    NoEdge {
        /// Which guard.
        guard: &'static str,
        /// Which contact.
        element: String,
        /// In which contact mode.
        mode: String,
    },
    /// The simultaneous impacts have no solution.
    #[error("the simultaneous impacts of {elements} have no solution after {iterations} pivots")]
    ImpactUnsolvable {
        /// The contacts that struck together.
        elements: String,
        /// Pivots tried.
        iterations: usize,
    },
}

/// What a jump leaves behind, apart from the state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jump {
    /// The mode after.
    pub mode: Mode,
    /// Guards that are exactly zero after the jump, by construction.
    pub pinned: GuardSet,
    /// Largest displacement by which the state was moved onto the guards, in units of the guards.
    pub projected: f64,
}

/// An impact sequence that accumulates: what is needed to sum it.
///
/// After an impact the gap opens at `rate` u, m/s, and falls back with acceleration `−accel`, m/s²,
/// which changes at `jerk`, m/s³. Each impact returns the fraction `restitution` of the approach speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chatter {
    /// Opening speed u after the impact, m/s, ≥ 0.
    pub rate: f64,
    /// Deceleration A of the gap, m/s²; positive when the gap closes again.
    pub accel: f64,
    /// Rate of change J of the gap's acceleration, m/s³.
    pub jerk: f64,
    /// Coefficient of restitution, `[0, 1)`.
    pub restitution: f64,
}

/// A hybrid automaton: smooth flows, guards that end them, jumps between them.
pub trait HybridSystem {
    /// Length of the state, latched quantities included.
    fn dim(&self) -> usize;
    /// The forcing clock.
    fn clock(&self) -> &Clock;
    /// The smooth flow of all modes (the mode is handed to each call).
    fn flow(&self) -> Flow<'_>;
    /// The guards watched in `mode`, into `out`, in rising order of id.
    fn guards(&self, mode: Mode, out: &mut Vec<Guard>);
    /// The value of a guard, positive inside the mode.
    fn guard(&self, mode: Mode, id: GuardId, at: Instant, x: &[f64]) -> f64;
    /// A length that a guard's rounding error is measured against, in the guard's units.
    fn guard_scale(&self, id: GuardId) -> f64;
    /// Resets the state and gives the successor mode. `fired` is the whole batch of one instant.
    ///
    /// # Errors
    /// [`ModelError`] if the automaton has no such edge or the impacts cannot be solved.
    fn jump(&self, mode: Mode, fired: GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError>;
    /// Time until the next known switching time strictly after `at`, s; infinite if none.
    fn next_switch(&self, at: Instant) -> f64;
    /// The mode right after the known switching time at `at`.
    fn switched(&self, mode: Mode, at: Instant) -> Mode;
    /// After a jump: the impact sequence of guard `id`, if it is one of a contact without dwell.
    fn chatter(&self, mode: Mode, id: GuardId, at: Instant, x: &[f64]) -> Option<Chatter>;
    /// Puts the contacts of `fired` to rest on their boundaries: velocity projected, sustained-contact mode.
    ///
    /// # Errors
    /// As [`jump`](Self::jump).
    fn settle(&self, mode: Mode, fired: GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError>;
}
