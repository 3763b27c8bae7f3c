//! Integrators: they offer dense steps along one smooth arc and know nothing of events or gears.
//!
//! One arc is one call. Nothing of a solver can survive a jump, because the call does not.

mod choice;
mod dense;
#[cfg(feature = "diffsol")]
mod diffsol;
mod radau;
mod relay;
mod taylor;

use std::ops::ControlFlow;

use crate::hybrid::{GuardId, GuardSet, HybridSystem, Instant, JetField, Mode, Power, Samples, Shown, Wide};

#[cfg(feature = "diffsol")]
pub use self::diffsol::{Diffsol, Method};
pub use choice::{Choice, PerMode, build};
#[doc(hidden)]
pub use radau::Tableau;
use relay::Relay;
pub use taylor::Taylor;
pub(crate) use taylor::{advances, gathered, is_over};

/// One accepted step with its dense output, in the step's own clock `θ ∈ [0, 1]`.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait DenseStep {
    /// When the step starts.
    fn start(&self) -> Instant;
    /// Elapsed time `t(θ) − t(0)`, s; monotone up to the first event.
    fn time(&self, theta: f64) -> f64;
    /// Rate of the clock `dt/dθ`, s.
    fn rate(&self, theta: f64) -> f64;
    /// State at `θ` into `x` `[dim]`.
    fn state(&self, theta: f64, x: &mut [f64]);
    /// State at `θ` as `x + low`, each `[dim]`.
    fn state_in_two(&self, theta: f64, x: &mut [f64], low: &mut [f64]) {
        self.state(theta, x);
        low.fill(0.0);
    }
    /// Elapsed time at which [`state_in_two`](Self::state_in_two) holds, s.
    fn time_in_two(&self, theta: f64) -> Wide {
        self.time(theta).into()
    }
    /// The guards of the mode.
    fn guards(&self) -> &[GuardId];
    /// Guard `i` as a polynomial in θ, coefficients in rising powers.
    fn guard(&self, i: usize) -> &[f64];
    /// Bounds on the error of guard `i`: of its polynomial on `[0, 1]`, and of rounding where a value is
    /// computed from scratch.
    fn guard_error(&self, i: usize) -> (f64, f64);
    /// The part of the first of these bounds that has been left out on request. Equal contacts leave out the same: it makes no two
    /// events one.
    fn left_out(&self, i: usize) -> f64 {
        0.0
    }
    /// What its arc has made before the step.
    fn before(&self) -> Before<'_> {
        Before::default()
    }
    /// Rounding of guard `i` where its value is formed from the state alone.
    fn guard_rounding(&self, i: usize) -> f64 {
        self.guard_error(i).1
    }
    /// Rounding that guard `i` may have gathered by `theta` since the arc, or the part of it that one method integrates, began,
    /// in its physical units: an estimate from the sizes of its terms; zero where the step does not know. The
    /// first `zeros` derivatives of it are exactly zero at the step's start, its value the zeroth.
    fn gathered(&self, i: usize, theta: f64, zeros: usize) -> f64 {
        0.0
    }
    /// Keeps what the state at `theta` alone holds with less precision, for the next [`Arc`]; nothing unless the step knows it.
    fn carry(&self, theta: f64, carried: &mut Vec<f64>) {
        carried.clear();
    }
    /// A quantity as a polynomial in θ, coefficients in rising powers, into `row`, empty for zero; `false` where the step does not
    /// know it, and it has to be interpolated.
    fn show(&self, what: Shown, row: &mut Vec<f64>) -> bool {
        false
    }
    /// A power at the places `thetas`; `false` where the step does not know it, and it has to be formed from the state.
    fn sample(&self, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        false
    }
    /// `Some(h)` if the clock is plain time, `t = h θ`.
    fn plain_span(&self) -> Option<f64>;
    /// Whether the errors of the guards are estimates; they are proven bounds otherwise.
    fn is_estimate(&self) -> bool {
        true
    }
    /// In a clock of its own: rate of guard `i` in time at `θ`, and the error of its value, both in the guard's
    /// physical units (its polynomial may be that of a root). `None` where the polynomial says it all.
    fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        None
    }
    /// First three derivatives in time of guard `i` at the step's start, in the guard's physical units over s, s² and s³.
    /// `None` where the step's series do not tell them.
    fn guard_derivatives_in_time(&self, i: usize) -> Option<[f64; 3]> {
        in_plain_time(self.guard(i), self.plain_span()?)
    }
}

/// Three derivatives at the start of a series in `t/h`.
fn in_plain_time(series: &[f64], h: f64) -> Option<[f64; 3]> {
    let [_, first, second, third, ..] = *series else { return None };
    Some([first / h, 2.0 * second / (h * h), 6.0 * third / (h * h * h)])
}

/// A smooth arc to integrate.
#[derive(Clone, Copy)]
pub struct Arc<'a> {
    /// The mode it runs in.
    pub mode: &'a Mode,
    /// Its motion, where that knows its own Taylor series.
    pub motion: Option<&'a dyn JetField>,
    /// Where it starts.
    pub at: Instant,
    /// State there, `[dim]`.
    pub x: &'a [f64],
    /// What the state is beyond the rounding of `x`, `[dim]`; empty: nothing.
    pub low: &'a [f64],
    /// What the step before it kept; empty if nothing.
    pub carried: &'a [f64],
    /// Guards that are exactly zero there.
    pub pinned: &'a GuardSet,
    /// Guards whose rate is exactly zero there.
    pub still: &'a GuardSet,
    /// Where it ends unless the visitor stops it.
    pub bound: Instant,
    /// Truncation of a step, relative to the size of each component: [`FULL_PRECISION`](crate::hybrid::FULL_PRECISION), or more on
    /// request.
    pub tolerance: f64,
    /// What the same arc has made before.
    pub before: Before<'a>,
}

/// The steps that an arc has made before the part at hand.
#[derive(Clone, Copy, Debug, Default)]
pub struct Before<'a> {
    /// Their number.
    pub steps: u32,
    /// The largest size of each component at their starts; empty without any.
    pub extent: &'a [f64],
    /// What they have left out, as [`Jet::left_out`](crate::hybrid::Jet::left_out) tells it.
    pub left_out: [f64; 2],
}

/// Why an arc could not be integrated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// The state or its series is not finite.
    #[error("the solution stops being finite at t = {t} s")]
    NotFinite {
        /// When, s.
        t: f64,
    },
    /// No progress: the step fell below the resolution of time.
    #[error("the step at t = {t} s falls below {step:e} s")]
    StepTooSmall {
        /// When, s.
        t: f64,
        /// The step, s.
        step: f64,
    },
    /// The method needs Taylor coefficients and the flow has none.
    #[error("the flow does not know its Taylor series: use an integrator that only evaluates it")]
    NoJet,
    /// The method is not part of this build.
    #[error("{method} is not part of this build: it needs the cargo feature `diffsol`")]
    NotBuilt {
        /// Which method.
        method: &'static str,
    },
    /// The solver behind the method gave up.
    #[error("{method} fails at t = {t} s: {reason}")]
    Solver {
        /// Which method.
        method: &'static str,
        /// When, s.
        t: f64,
        /// What it said.
        reason: String,
    },
}

/// Integrates smooth arcs.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait Integrator {
    /// Name for logs.
    fn name(&self) -> &'static str;
    /// Integrates one arc, handing every step to `visit`, until the bound or until the visitor breaks off.
    /// On return at the bound, `end + low` is the state there, each `[dim]`; an empty `low` asks for no low part.
    ///
    /// # Errors
    /// [`IntegrateError`]; what was visited until then stands.
    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError>;
    /// Whether `mode` is left to the series of its motion, to rounding: the motion may then tell its way to the next event at once.
    /// `arc` is how long the arc at hand is at most, s.
    fn is_exact(&mut self, system: &dyn HybridSystem, mode: &Mode, arc: f64) -> bool {
        false
    }
    /// The integrator each mode met so far got, where the choice is made mode by mode; empty elsewhere.
    fn chosen(&self) -> Vec<(Mode, &'static str)> {
        Vec::new()
    }
}
