//! Adapter to diffsol: implicit and explicit steps of fields without series, and of stiff modes.
//!
//! Each arc has its own solver, built at its start and dropped at its end; diffsol's root finder and resets are not used. Time is measured
//! from the start of the arc in units of the first step, so that no absolute size of time reaches the solver.

use std::ops::ControlFlow;

use diffsol::{
    DiffsolError, NalgebraContext, NalgebraLU, NalgebraMat, NalgebraVec, OdeBuilder, OdeEquations, OdeSolverMethod,
    OdeSolverStopReason, Vector, error::OdeSolverError,
};

use super::{
    Arc, DenseStep, IntegrateError, Integrator,
    dense::{self, Pieces, StepPosition},
};
use crate::hybrid::{HybridSystem, VectorField};

type M = NalgebraMat<f64>;
type V = NalgebraVec<f64>;
type LS = NalgebraLU<f64>;

/// Method of diffsol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Backward differences of order 1 to 5: strongly damped fast modes.
    Bdf,
    /// ESDIRK 3(4), A-stable: lightly damped fast modes that need not be resolved.
    Sdirk,
    /// Tsitouras 5(4): fields that are not stiff.
    Explicit,
}

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Bdf => "bdf",
            Self::Sdirk => "sdirk",
            Self::Explicit => "explicit",
        }
    }

    /// Returns the order of the first step; backward differences have a start-up of order 3.
    fn first_order(self) -> f64 {
        if self == Self::Explicit { 5.0 } else { 3.0 }
    }
}

/// Steps by diffsol, with dense output and guards from polynomials of its interpolant.
///
/// Each component is held to `rtol` times its size, and near zero to a tenth of `rtol` times its scale on the arc. The scale is the largest
/// of `|x|`, `τ|ẋ|` and `τ²|ẍ|/2` at the start of the arc. The time τ is the least of the fastest time of the system, the 1/ω of the
/// forcing, and the span of the arc. If the system names no time, the shortest time in which a component changes by its own size replaces
/// it.
///
/// After every start of an arc, backward differences are preceded by a few ESDIRK steps: their own first steps
/// are of order 1.
#[derive(Debug)]
pub struct Diffsol {
    method: Method,
    rtol: f64,
    pieces: Pieces,
}

impl Diffsol {
    /// Tightest tolerance of the solvers.
    pub const TIGHTEST: f64 = 1e-13;

    /// Returns a method with a relative tolerance, clamped to `[1e-13, 0.1]`.
    #[must_use]
    pub fn new(method: Method, rtol: f64) -> Self {
        Self { method, rtol: rtol.clamp(Self::TIGHTEST, 0.1), pieces: Pieces::default() }
    }
}

/// Converts an error of a solver to seconds.
fn fault(method: Method, t: f64, unit: f64, error: &DiffsolError) -> IntegrateError {
    let reason = match error {
        DiffsolError::OdeSolverError(OdeSolverError::StepSizeTooSmall { .. }) => {
            return IntegrateError::StepTooSmall { t, step: SMALLEST * unit };
        }
        DiffsolError::OdeSolverError(OdeSolverError::TooManyErrorTestFailures { num_failures, .. }) => {
            format!("{num_failures} steps in a row miss the tolerance")
        }
        other => other.to_string(),
    };
    IntegrateError::Solver { method: method.name(), t, reason }
}

fn when(system: &dyn HybridSystem, arc: &Arc<'_>, elapsed: f64) -> f64 {
    system.clock().time(system.clock().advance(arc.at, elapsed)).value()
}

/// Sizes at the start of an arc.
struct Start {
    /// Absolute tolerances, `[dim]`.
    absolute: Vec<f64>,
    /// Initial step of a method of the requested order, s.
    step: f64,
    /// Ratio of the initial step of a method of order 1 to that step.
    first_order: f64,
}

/// Floor of a component as a share of its scale.
const FLOOR: f64 = 0.1;
/// Share of the largest scale to which a component with zero scale is held, unless its rounding is larger.
const NO_SCALE: f64 = 1e-9;

impl Start {
    /// Returns scales from the state and two derivatives; the first step as in Hairer, Nørsett & Wanner (1993), II.4, with τ as the unit of
    /// time.
    fn new(
        field: &dyn VectorField,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        span: f64,
        rtol: f64,
        order: f64,
    ) -> Self {
        let dim = arc.x.len();
        let (mut f, mut f1, mut x1) = (vec![0.0; dim], vec![0.0; dim], vec![0.0; dim]);
        field.eval(arc.mode, arc.at, 0.0, arc.x, &mut f);
        field.jac_mul(arc.mode, arc.at, 0.0, arc.x, &f, &mut f1);
        let own = system.rates(arc.mode).map_or_else(
            || {
                // Relative rate of change of the components: too short a time costs steps, too long a one digits.
                let parts = arc.x.iter().zip(f.iter().zip(&f1)).filter(|(x, _)| **x != 0.0);
                parts.fold(0.0, |w: f64, (x, (f, f1))| w.max((f / x).abs()).max((f1 / x).abs().sqrt()))
            },
            |r| r.damped.max(r.oscillating),
        );
        let tau = [own, system.clock().omega()].iter().filter(|w| **w > 0.0).fold(span, |t, w| t.min(1.0 / w));
        let mut scale: Vec<f64> = arc.x.iter().map(|x| x.abs()).collect();
        for (s, (f, f1)) in scale.iter_mut().zip(f.iter().zip(&f1)) {
            *s = s.max(tau * f.abs()).max(0.5 * tau * tau * f1.abs());
        }
        // Forcing that is zero at this instant appears a little later.
        field.eval(arc.mode, arc.at, 0.5 * tau, arc.x, &mut f1);
        scale.iter_mut().zip(&f1).for_each(|(s, f)| *s = s.max(tau * f.abs()));
        let largest = scale.iter().copied().fold(0.0, f64::max);
        let least = if largest > 0.0 { (NO_SCALE * rtol).max(f64::EPSILON) * largest } else { rtol };
        let absolute: Vec<f64> = scale.iter().map(|s| (FLOOR * rtol * s).max(least)).collect();
        let size = |v: &[f64]| {
            let parts = v.iter().zip(arc.x).zip(&absolute).map(|((v, x), a)| v.abs() / (a + rtol * x.abs()));
            parts.fold(0.0, f64::max)
        };
        let (d0, d1) = (size(arc.x), size(&f));
        let trial = if d0 > 0.0 && d1 > 0.0 { (0.01 * d0 / d1).min(span) } else { 1e-6 * tau };
        x1.iter_mut().zip(arc.x.iter().zip(&f)).for_each(|(y, (x, f))| *y = x + trial * f);
        field.eval(arc.mode, arc.at, trial, &x1, &mut f1);
        f1.iter_mut().zip(&f).for_each(|(a, b)| *a -= b);
        let d2 = size(&f1) / trial;
        let harshness = (d1 * tau).max(d2 * tau * tau);
        let step = |order: f64| {
            let reach = tau * libm::pow(0.01 / harshness, 1.0 / (order + 1.0));
            let step = reach.min(100.0 * trial).min(span);
            if step.is_finite() && step > 0.0 { step } else { 1e-6 * span }
        };
        Self { absolute, step: step(order), first_order: (step(1.0) / step(order)).min(1.0) }
    }
}

impl Integrator for Diffsol {
    fn name(&self) -> &'static str {
        self.method.name()
    }

    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError> {
        low.fill(0.0);
        let field = system.field();
        let span = system.clock().between(arc.at, arc.bound);
        if span <= 0.0 {
            end.copy_from_slice(arc.x);
            return Ok(());
        }
        // The solvers' norm is a mean over the components: one active contact among many must not be diluted.
        let rtol = self.rtol / (arc.x.len() as f64).sqrt();
        let start = Start::new(field, system, arc, span, rtol, self.method.first_order());
        let unit = start.step;
        let mut problem = OdeBuilder::<M>::new()
            .rtol(rtol)
            .atol(start.absolute)
            .rhs_implicit(
                |x, _p, t, dx| {
                    field.eval(arc.mode, arc.at, t * unit, x, dx);
                    dx.iter_mut().for_each(|d| *d *= unit);
                },
                |x, _p, t, v, jv| {
                    field.jac_mul(arc.mode, arc.at, t * unit, x, v, jv);
                    jv.iter_mut().for_each(|d| *d *= unit);
                },
            )
            .init(|_p, _t, x| x.copy_from_slice(arc.x), arc.x.len())
            .build()
            .map_err(|e| fault(self.method, when(system, arc, 0.0), unit, &e))?;
        let options = &mut problem.ode_options;
        // diffsol counts this over the lifetime of a solver, and it indicates no error.
        options.max_nonlinear_solver_failures = usize::MAX;
        options.max_error_test_failures = 1000;
        options.min_timestep = SMALLEST;
        let pieces = &mut self.pieces;
        let mut run = Run { system, arc, field, span, unit, method: self.method, pieces, rtol: self.rtol, from: 0.0 };
        run.begin(end);
        let outcome = match self.method {
            // Backward differences start at order 1. The positions and velocities agree to the tolerance only: too coarse to decide the
            // side of a guard at the start of an arc, and for flights lower than the tolerance.
            Method::Bdf => problem.esdirk34::<LS>().and_then(|first| {
                let until = START_UP.max(100.0 * START_UP * start.first_order);
                let under_way = run.drive(first, |_| 3, 1.0, until, end, visit);
                if !matches!(under_way, Ok(true)) {
                    return Ok(under_way);
                }
                problem.bdf::<LS>().map(|s| run.drive(s, |s| s.order(), start.first_order, f64::INFINITY, end, visit))
            }),
            Method::Sdirk => problem.esdirk34::<LS>().map(|s| run.drive(s, |_| 3, 1.0, f64::INFINITY, end, visit)),
            Method::Explicit => problem.tsit45().map(|s| run.drive(s, |_| 4, 1.0, f64::INFINITY, end, visit)),
        };
        outcome.map_err(|e| fault(self.method, when(system, arc, 0.0), unit, &e))?.map(|_| ())
    }
}

/// Span of the one-step start-up of backward differences, in units of its first step. It is at least a hundred times the step of order 1.
/// The error of such a step, a h²/2 with a the acceleration, is about the tolerance; a flight that lasts beyond the start-up is a thousand
/// times higher.
const START_UP: f64 = 10.0;
/// Shortest step, in units of the first one.
const SMALLEST: f64 = 1e-12;

/// State of the integration of one arc.
struct Run<'a> {
    system: &'a dyn HybridSystem,
    arc: &'a Arc<'a>,
    field: &'a dyn VectorField,
    span: f64,
    /// Unit of time of the solver, s.
    unit: f64,
    method: Method,
    pieces: &'a mut Pieces,
    rtol: f64,
    /// Progress on the arc, in units of time of the solver.
    from: f64,
}

impl<'a> Run<'a> {
    fn place(&self) -> StepPosition<'a> {
        StepPosition {
            system: self.system,
            arc: self.arc,
            rtol: self.rtol,
            from: self.from * self.unit,
            to: None,
            unsure: &[],
        }
    }

    fn begin(&mut self, end: &mut [f64]) {
        end.copy_from_slice(self.arc.x);
        self.pieces.begin(&self.place());
    }

    /// Steps `solver` from the state in `end`, with `step` units as first step, until `limit` units are reached. `degree` is that of its
    /// interpolant on the last step. Returns `true` if the arc continues.
    #[allow(clippy::too_many_arguments)]
    fn drive<'p, E, S>(
        &mut self,
        mut solver: S,
        degree: impl Fn(&S) -> usize,
        step: f64,
        limit: f64,
        end: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<bool, IntegrateError>
    where
        E: OdeEquations<T = f64, V = V> + 'p,
        S: OdeSolverMethod<'p, E>,
    {
        let (system, arc, unit, method) = (self.system, self.arc, self.unit, self.method);
        let t = |units: f64| when(system, arc, units * unit);
        let fault = |from: f64, e: &DiffsolError| fault(method, t(from), unit, e);
        let state = solver.state_mut();
        *state.h = step.min(self.span / unit - self.from);
        if self.from > 0.0 {
            *state.t = self.from;
            state.y.batch_as_mut_slice(0).copy_from_slice(end);
            let dy = state.dy.batch_as_mut_slice(0);
            self.field.eval(arc.mode, arc.at, self.from * unit, end, dy);
            dy.iter_mut().for_each(|d| *d *= unit);
        }
        solver.set_stop_time(self.span / unit).map_err(|e| fault(self.from, &e))?;
        let mut inside = V::zeros(arc.x.len(), NalgebraContext::default());
        while self.from < limit {
            let from = self.from;
            let arrived = matches!(solver.step().map_err(|e| fault(from, &e))?, OdeSolverStopReason::TstopReached);
            let to = solver.state().t;
            let y = solver.state().y.batch_as_slice(0);
            if !to.is_finite() || y.iter().any(|v| !v.is_finite()) {
                return Err(IntegrateError::NotFinite { t: t(from) });
            }
            if to <= from {
                return Err(IntegrateError::StepTooSmall { t: t(from), step: unit * (to - from) });
            }
            // `end` still holds the state at the start of the step.
            let degree = degree(&solver).clamp(1, dense::STATE_DEGREE);
            let samples = &mut self.pieces.step;
            samples.clear();
            samples.extend_from_slice(end);
            for theta in dense::state_points(degree).skip(1).take(degree - 1) {
                solver.interpolate_inplace(from + theta * (to - from), &mut inside).map_err(|e| fault(from, &e))?;
                samples.extend_from_slice(inside.batch_as_slice(0));
            }
            samples.extend_from_slice(y);
            end.copy_from_slice(y);
            dense::to_powers(samples, arc.x.len());
            let place = StepPosition { to: (!arrived).then_some(to * unit), ..self.place() };
            if !self.pieces.visit(&place, |step| visit(step).is_continue()) || arrived {
                return Ok(false);
            }
            self.from = to;
        }
        Ok(true)
    }
}
