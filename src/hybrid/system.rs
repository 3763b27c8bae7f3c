use super::{Clock, GuardId, GuardSet, Instant, JetField, Lane, Mode, VectorField};

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
    #[error("no impulses satisfy the restitution of {elements} at once")]
    ImpactUnsolvable {
        /// The contacts that struck together.
        elements: String,
    },
}

/// What a jump leaves behind, apart from the state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jump {
    /// The mode after.
    pub mode: Mode,
    /// Guards that are exactly zero after the jump, by construction.
    pub pinned: GuardSet,
    /// Guards whose rate is exactly zero too.
    pub still: GuardSet,
    /// Guards at zero that took an impulse, whether or not they fired.
    pub struck: GuardSet,
    /// Largest displacement by which the state was moved onto the guards, in units of the guards.
    pub projected: f64,
}

/// How fast the elements of a mode move by themselves, 1/s: an indication, not a bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Fastest decay of an element with at least half the critical damping.
    pub damped: f64,
    /// Fastest angular frequency of the others.
    pub oscillating: f64,
}

/// A hybrid automaton: smooth flows, guards that end them, jumps between them.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait HybridSystem {
    /// Length of the state, latched quantities included.
    fn dim(&self) -> usize;
    /// The forcing clock.
    fn clock(&self) -> &Clock;
    /// The smooth motion of `mode`, compiled, where it knows its own Taylor series; one arc reads it and nothing else.
    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        None
    }
    /// A lane for motions that nobody looks at, where the system has one.
    fn lane<'a>(&'a self) -> Option<Box<dyn Lane + 'a>> {
        None
    }
    /// The smooth motion of all modes, to be evaluated (the mode is handed to each call).
    fn field(&self) -> &dyn VectorField;
    /// The guards watched in `mode`, into `out`, in rising order of id.
    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>);
    /// The value of a guard, positive inside the mode.
    fn guard(&self, mode: &Mode, id: GuardId, at: Instant, x: &[f64]) -> f64;
    /// The values of several guards at one place, handed to `take` with their places in `ids`.
    fn guard_values(&self, mode: &Mode, ids: &[GuardId], (at, x): (Instant, &[f64]), take: &mut dyn FnMut(usize, f64)) {
        ids.iter().enumerate().for_each(|(i, id)| take(i, self.guard(mode, *id, at, x)));
    }
    /// Resets the state and gives the successor mode. `fired` is the whole batch. `from` holds the mode and the zeros:
    /// the guards of the batch that fell through zero (the others are outside already, taken there by a switch or an
    /// earlier jump), and what the earlier jumps at the instant left, which still stands for contacts that do not fire
    /// again. `low` `[dim]` is what the state is beyond the rounding of `x`; a system that does not keep it leaves it zero.
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
    /// Moves the state `x + low` at `at` along the flow of `mode` onto guard `id`, by one Newton step of at most `most` seconds, and
    /// returns its length, s. Nothing unless the system keeps the low part of its state.
    fn meet(&self, mode: &Mode, id: GuardId, at: Instant, most: f64, x: &mut [f64], low: &mut [f64]) -> f64 {
        0.0
    }
    /// The next known switching time at which the motion of `mode` changes: `at` or before where `mode` has not passed it yet. None
    /// unless the system says otherwise.
    fn next_switch(&self, mode: &Mode, at: Instant) -> Option<Instant> {
        None
    }
    /// The mode right after the known switching time at `at`.
    fn switched(&self, mode: &Mode, at: Instant) -> Mode {
        mode.clone()
    }
    /// The coefficient of restitution of the slowest impacts that guard `id` stands for; `None` if it is no impact.
    fn restitution(&self, id: GuardId) -> Option<f64> {
        None
    }
    /// Approach speed of the impact of guard `id` below which the restitution is that of the slowest one, m/s.
    fn steady_speed(&self, id: GuardId) -> f64 {
        f64::INFINITY
    }
    /// Puts the contacts of `fired` to rest on their boundaries: velocity projected, sustained-contact mode.
    ///
    /// # Errors
    /// As [`jump`](Self::jump).
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError>;
    /// `mode` in words, for messages.
    fn mode_in_words(&self, mode: &Mode) -> String {
        format!("mode {mode}")
    }
    /// Guard `id` in words, for messages.
    fn guard_in_words(&self, id: GuardId) -> String {
        format!("guard {}", id.0)
    }
    /// Whether guard `id` is a function of positions and time alone, so that no jump can take it past zero.
    fn is_continuous(&self, id: GuardId) -> bool {
        false
    }
    /// The fastest rate of the smooth nonlinear elements of `mode` at `x`, 1/s, and into `sizes` `[dim]` the size of each
    /// component's motion that they take part in, in its units and > 0, against which the accuracy of steps longer than
    /// that rate allows is judged. `None` if there are no such elements, or one of them is about to change.
    fn sizes(&self, mode: &Mode, at: Instant, x: &[f64], sizes: &mut [f64]) -> Option<f64> {
        None
    }
    /// The own rates of `mode`, if the system knows them: they tell stiff modes from others.
    fn rates(&self, mode: &Mode) -> Option<Rates> {
        None
    }
}
