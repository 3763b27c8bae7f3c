//! Integrators of dense steps along one smooth arc, independent of events and gears.
//!
//! One arc is one call, so no state of a solver can survive a jump.

mod choice;
mod dense;
#[cfg(feature = "diffsol")]
mod diffsol;
mod radau;
mod relay;
mod taylor;

use std::ops::ControlFlow;

use crate::hybrid::{GuardId, GuardSet, HybridSystem, Instant, JetField, Mode, Power, Samples, StepQuantity, Wide};

#[cfg(feature = "diffsol")]
pub use self::diffsol::{Diffsol, Method};
pub use choice::{Choice, PerMode, build, reason};
#[doc(hidden)]
pub use radau::Tableau;
use relay::Relay;
pub use taylor::Taylor;
pub(crate) use taylor::gathered;

/// One accepted step with its dense output, in its clock `θ ∈ [0, 1]`.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait DenseStep {
    /// Returns the instant at the start of the step.
    fn start(&self) -> Instant;
    /// Returns the elapsed time `t(θ) − t(0)`, s; monotone up to the first event.
    fn time(&self, theta: f64) -> f64;
    /// Returns the rate of the clock `dt/dθ`, s.
    fn rate(&self, theta: f64) -> f64;
    /// Writes the state at `θ` into `x` `[dim]`.
    fn state(&self, theta: f64, x: &mut [f64]);
    /// Writes the state at `θ` as `x + low`, each `[dim]`.
    fn state_in_two(&self, theta: f64, x: &mut [f64], low: &mut [f64]) {
        self.state(theta, x);
        low.fill(0.0);
    }
    /// Returns the elapsed time at which [`state_in_two`](Self::state_in_two) holds, s.
    fn time_in_two(&self, theta: f64) -> Wide {
        self.time(theta).into()
    }
    /// Returns the guards of the mode.
    fn guards(&self) -> &[GuardId];
    /// Returns guard `i` as a polynomial in θ, coefficients in rising powers.
    fn guard(&self, i: usize) -> &[f64];
    /// Returns bounds on the error of guard `i`: of its polynomial on `[0, 1]`, and of rounding where a value is computed from scratch.
    fn guard_error(&self, i: usize) -> (f64, f64);
    /// Returns the part of the first of these bounds that is truncation on request. It is the same for equal contacts, so it never merges
    /// two events into one.
    fn left_out(&self, i: usize) -> f64 {
        0.0
    }
    /// Returns the data of the arc before the step.
    fn before(&self) -> EarlierSteps<'_> {
        EarlierSteps::default()
    }
    /// Returns the rounding of guard `i` if its value is formed from the state alone.
    fn guard_rounding(&self, i: usize) -> f64 {
        self.guard_error(i).1
    }
    /// Estimates the rounding that guard `i` may have gathered by `theta`, in its physical units, from the sizes of its terms. It counts
    /// from the start of the arc, or of the part of it that one method integrates. Zero if unknown. The first `zeros` derivatives, from the
    /// value on, are exactly zero at the start of the step.
    fn gathered(&self, i: usize, theta: f64, zeros: usize) -> f64 {
        0.0
    }
    /// Keeps values that the state at `theta` alone holds less precisely, for the next [`Arc`]; by default none.
    fn carry(&self, theta: f64, carried: &mut Vec<f64>) {
        carried.clear();
    }
    /// Writes a quantity as a polynomial in θ, coefficients in rising powers, into `row`, empty for zero. Returns `false` if the step does
    /// not know it; then it has to be interpolated.
    fn show(&self, what: StepQuantity, row: &mut Vec<f64>) -> bool {
        false
    }
    /// Writes a power at the places `thetas`; returns `false` if the step does not know it, and it has to be formed from the state.
    fn sample(&self, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        false
    }
    /// Returns `Some(h)` if the clock is plain time, `t = h θ`.
    fn plain_span(&self) -> Option<f64>;
    /// Returns whether the errors of the guards are estimates and not proven bounds.
    fn is_estimate(&self) -> bool {
        true
    }
    /// Returns, for a clock other than time, the time derivative of guard `i` at `θ` and the error of its value. Both are in physical units
    /// (the polynomial may be that of a root). `None` if the polynomial contains all of this.
    fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        None
    }
    /// Returns the first three time derivatives of guard `i` at the start of the step, in its physical units over s, s² and s³. `None` if
    /// the series of the step do not give them.
    fn guard_derivatives_in_time(&self, i: usize) -> Option<[f64; 3]> {
        in_plain_time(self.guard(i), self.plain_span()?)
    }
}

/// Returns the first three derivatives at the start of a series in `t/h`.
fn in_plain_time(series: &[f64], h: f64) -> Option<[f64; 3]> {
    let [_, first, second, third, ..] = *series else { return None };
    Some([first / h, 2.0 * second / (h * h), 6.0 * third / (h * h * h)])
}

/// A smooth arc to integrate.
#[derive(Clone, Copy)]
pub struct Arc<'a> {
    /// Mode of the arc.
    pub mode: &'a Mode,
    /// Motion of the mode, if its Taylor series is known.
    pub motion: Option<&'a dyn JetField>,
    /// Instant of the start.
    pub at: Instant,
    /// State at the start, `[dim]`.
    pub x: &'a [f64],
    /// Part of the state below the rounding of `x`, `[dim]`; empty for zero.
    pub low: &'a [f64],
    /// Values kept by the step before the arc; empty if none.
    pub carried: &'a [f64],
    /// Guards that are exactly zero at the start.
    pub pinned: &'a GuardSet,
    /// Guards whose rate is exactly zero at the start.
    pub still: &'a GuardSet,
    /// Instant of the end, unless the visitor stops earlier.
    pub bound: Instant,
    /// Truncation of a step, relative to the size of each component: [`FULL_PRECISION`](crate::hybrid::FULL_PRECISION), or more on
    /// request.
    pub tolerance: f64,
    /// Data of the part of the same arc before this one.
    pub before: EarlierSteps<'a>,
}

/// Steps of an arc before the current part.
#[derive(Clone, Copy, Debug, Default)]
pub struct EarlierSteps<'a> {
    /// Number of steps.
    pub steps: u32,
    /// Largest size of each component at the starts of these steps; empty without any.
    pub extent: &'a [f64],
    /// Truncation of these steps, as in [`Jet::left_out`](crate::hybrid::Jet::left_out).
    pub left_out: [f64; 2],
}

/// Failure of the integration of an arc.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// The state or its series is not finite.
    #[error("the solution stops being finite at t = {t} s")]
    NotFinite {
        /// Time, s.
        t: f64,
    },
    /// No progress: the step fell below the resolution of time.
    #[error("the step at t = {t} s falls below {step:e} s")]
    StepTooSmall {
        /// Time, s.
        t: f64,
        /// Step, s.
        step: f64,
    },
    /// The method needs Taylor coefficients and the flow has none.
    #[error("the flow does not know its Taylor series: use an integrator that only evaluates it")]
    NoJet,
    /// The method is not part of this build.
    #[error("{method} is not part of this build: it needs the cargo feature `diffsol`")]
    NotBuilt {
        /// Name of the method.
        method: &'static str,
    },
    /// The solver behind the method gave up.
    #[error("{method} fails at t = {t} s: {reason}")]
    Solver {
        /// Name of the method.
        method: &'static str,
        /// Time, s.
        t: f64,
        /// Message of the solver.
        reason: String,
    },
}

/// Integrates smooth arcs.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait Integrator {
    /// Returns the name for logs.
    fn name(&self) -> &'static str;
    /// Integrates one arc, passing every step to `visit`, until the bound or until the visitor stops. At the bound, `end + low` is the
    /// state there, each `[dim]`; an empty `low` requests no low part.
    ///
    /// # Errors
    /// [`IntegrateError`]; the steps visited before remain valid.
    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError>;
    /// Returns whether `mode` is integrated by the series of its motion, to rounding, so that leaps may replace steps. `arc` is the longest
    /// possible duration of the current arc, s.
    fn is_exact(&mut self, system: &dyn HybridSystem, mode: &Mode, arc: f64) -> bool {
        false
    }
    /// Begins another run: drops the choices of the run before.
    fn restart(&mut self) {}
    /// Returns the integrator of each mode so far, if it is chosen for each mode; otherwise empty.
    fn chosen(&self) -> Vec<(Mode, &'static str)> {
        Vec::new()
    }
}
