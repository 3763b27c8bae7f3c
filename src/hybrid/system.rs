use super::{Clock, GuardId, GuardSet, Instant, JetField, Lane, Mode, VectorField};

/// Failure of a model at a request of the engine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The automaton has no edge for a requested jump.
    #[error("guard {guard} of {element} fired in mode {mode}, which has no such edge")]
    NoEdge {
        /// Guard, in words.
        guard: &'static str,
        /// Name of the contact.
        element: String,
        /// State of the contact, in words.
        mode: String,
    },
    /// The simultaneous impacts have no solution.
    #[error("no impulses satisfy the restitution of {elements} at once")]
    ImpactUnsolvable {
        /// Names of the contacts that struck together.
        elements: String,
    },
}

/// Result of a jump, apart from the state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jump {
    /// Mode after the jump.
    pub mode: Mode,
    /// Pinned guards: exactly zero after the jump, by construction.
    pub pinned: GuardSet,
    /// Still guards: their rate is exactly zero too.
    pub still: GuardSet,
    /// Guards at zero that received an impulse, whether or not they fired.
    pub struck: GuardSet,
    /// Largest displacement by which the state was moved onto the guards, in units of the guards.
    pub projected: f64,
}

/// Rates of the elements of a mode, 1/s: an indication, not a bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Fastest decay rate of an element with at least half the critical damping.
    pub damped: f64,
    /// Fastest angular frequency of the other elements.
    pub oscillating: f64,
}

/// A hybrid automaton: smooth flows, guards that end them, jumps between them.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait HybridSystem {
    /// Returns the length of the state, latched quantities included.
    fn dim(&self) -> usize;
    /// Returns the forcing clock.
    fn clock(&self) -> &Clock;
    /// Returns the smooth motion of `mode`, compiled, if its Taylor series is known; one arc reads it and nothing else.
    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        None
    }
    /// Returns whether the Taylor series of its modes are known.
    fn has_series(&self) -> bool {
        self.motion(&Mode::default()).is_some()
    }
    /// Returns a lane for motions without calls to an observer, if the system has one.
    fn lane<'a>(&'a self) -> Option<Box<dyn Lane + 'a>> {
        None
    }
    /// Returns the vector field of all modes (each call names the mode).
    fn field(&self) -> &dyn VectorField;
    /// Writes the guards watched in `mode` into `out`, in rising order of id.
    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>);
    /// Returns the value of a guard, positive inside the mode.
    fn guard(&self, mode: &Mode, id: GuardId, at: Instant, x: &[f64]) -> f64;
    /// Passes the values of several guards at one state to `take`, with their indices in `ids`.
    fn guard_values(&self, mode: &Mode, ids: &[GuardId], (at, x): (Instant, &[f64]), take: &mut dyn FnMut(usize, f64)) {
        ids.iter().enumerate().for_each(|(i, id)| take(i, self.guard(mode, *id, at, x)));
    }
    /// Resets the state and returns the successor mode. `fired` is the whole batch. `from` holds the mode and the zeros: first the guards
    /// of the batch that fell through zero; a switch or an earlier jump took the others outside. Zeros from earlier jumps at the instant
    /// remain valid for contacts that do not fire again. `low` `[dim]` is the part of the state below the rounding of `x`; a system that
    /// does not keep it leaves it zero.
    ///
    /// # Errors
    /// [`ModelError`] if the automaton has no such edge or the impacts cannot be solved.
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        at: Instant,
        x: &mut [f64],
        low: &mut [f64],
    ) -> Result<Jump, ModelError>;
    /// Moves the state `x + low` at `at` along the flow of `mode` onto guard `id`. It makes one Newton step of at most `most` seconds, and
    /// returns its length, s. Does nothing unless the system keeps the low part of its state.
    fn meet(&self, mode: &Mode, id: GuardId, at: Instant, most: f64, x: &mut [f64], low: &mut [f64]) -> f64 {
        0.0
    }
    /// Returns the next known switching time at which the motion of `mode` changes: `at` or before if `mode` has not passed it yet. The
    /// default is `None`.
    fn next_switch(&self, mode: &Mode, at: Instant) -> Option<Instant> {
        None
    }
    /// Returns the mode right after the known switching time at `at`.
    fn switched(&self, mode: &Mode, at: Instant) -> Mode {
        mode.clone()
    }
    /// Returns the restitution of the slowest impacts of guard `id`; `None` if its fall is no impact.
    fn restitution(&self, id: GuardId) -> Option<f64> {
        None
    }
    /// Returns the approach speed of guard `id` below which the restitution is that of the slowest impact, m/s.
    fn steady_speed(&self, id: GuardId) -> f64 {
        f64::INFINITY
    }
    /// Brings the contacts of `fired` to rest on their boundaries: velocity projected, sustained-contact mode.
    ///
    /// # Errors
    /// As [`jump`](Self::jump).
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError>;
    /// Returns `mode` in words, for messages.
    fn mode_in_words(&self, mode: &Mode) -> String {
        format!("mode {mode}")
    }
    /// Returns guard `id` in words, for messages.
    fn guard_in_words(&self, id: GuardId) -> String {
        format!("guard {}", id.0)
    }
    /// Returns whether guard `id` is a function of positions and time alone, so that no jump can take it past zero.
    fn is_continuous(&self, id: GuardId) -> bool {
        false
    }
    /// Returns the fastest rate of the smooth nonlinear elements of `mode` at `x`, 1/s. Writes into `sizes` `[dim]` the size of the motion
    /// of each component involved, in its units and > 0. Steps longer than that rate allows are judged against these sizes. `None` if there
    /// are no such elements, or if one of them is about to change.
    fn sizes(&self, mode: &Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        None
    }
    /// Returns the natural rates of `mode`, if known: they distinguish stiff modes.
    fn rates(&self, mode: &Mode) -> Option<Rates> {
        None
    }
}
