use super::{Guard, GuardSet, Instant, Mode};

/// The smooth motion inside one mode.
#[derive(Clone, Copy)]
pub enum Flow<'a> {
    /// The field knows the Taylor coefficients of its own solution (and can be evaluated too).
    Jet(&'a dyn JetField, &'a dyn VectorField),
    /// The field can only be evaluated.
    Smooth(&'a dyn VectorField),
}

/// What a [`JetField`] is asked for.
#[derive(Clone, Copy, Debug)]
pub struct JetRequest<'a> {
    /// The mode whose smooth flow is expanded.
    pub mode: Mode,
    /// Where.
    pub at: Instant,
    /// State there, `[dim]`.
    pub x: &'a [f64],
    /// Guards known to be exactly zero at `at`.
    pub pinned: GuardSet,
    /// Guards whose rate is known to be exactly zero as well.
    pub still: GuardSet,
    /// Wanted span of the step, s: the field may return a shorter one.
    pub span: f64,
    /// Truncation wanted, relative to the size of each component.
    pub tolerance: f64,
}

/// A flow that knows its own Taylor series.
pub trait JetField {
    /// Length of the state.
    fn dim(&self) -> usize;

    /// Expands the solution through `request.x`: fills `out` with the coefficients of state, clock and
    /// guards in the step's own clock `θ`, and the largest `θ` up to which they hold to tolerance.
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet);
}

/// A vector field `ẋ = f(t, x)` with its Jacobian.
pub trait VectorField {
    /// Length of the state.
    fn dim(&self) -> usize;
    /// `dx = f(t, x)` in `mode`, `dx` `[dim]`. `t` is measured from `base`, s.
    fn eval(&self, mode: Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]);
    /// `jv = (∂f/∂x) v` in `mode`, `v` and `jv` `[dim]`.
    fn jac_mul(&self, mode: Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]);
}

/// Taylor coefficients of one step, in a normalised clock `θ`: `x(θ) = Σ x_k θᵏ` for `0 ≤ θ ≤ reach`.
///
/// All series have `order + 1` coefficients. The buffers belong to the integrator and are reused.
#[derive(Clone, Debug, Default)]
pub struct Jet {
    /// Highest power kept.
    pub order: usize,
    /// Length of the state.
    pub dim: usize,
    /// State coefficients, row `k` at `[k·dim, (k+1)·dim)`.
    pub state: Vec<f64>,
    /// Elapsed time `t(θ) − t0`, s, `[order + 1]`; empty when time is the clock and `t = θ · span`.
    pub time: Vec<f64>,
    /// Span of `θ ∈ [0, 1]`, s, when time is the clock.
    pub span: f64,
    /// The guards of the mode, in the order of their rows in `guard_series`.
    pub guards: Vec<Guard>,
    /// Guard coefficients, row `i` at `[i·stride, i·stride + order + 1)`.
    pub guard_series: Vec<f64>,
    /// Row length of `guard_series`.
    pub stride: usize,
    /// For each guard, a bound on what the truncated tail adds on `[0, reach]`.
    pub remainder: Vec<f64>,
    /// For each guard, the rounding error of its value where it is computed from scratch.
    pub rounding: Vec<f64>,
    /// Largest `θ` at which the series holds to tolerance.
    pub reach: f64,
    /// Working space of the field.
    pub work: Vec<f64>,
}

impl Jet {
    /// The series of guard `i`, `[order + 1]`.
    #[must_use]
    pub fn guard(&self, i: usize) -> &[f64] {
        &self.guard_series[i * self.stride..=i * self.stride + self.order]
    }

    /// The state at `θ`, by Horner's rule, into `x` `[dim]`.
    pub fn state_at(&self, theta: f64, x: &mut [f64]) {
        let d = self.dim;
        x.copy_from_slice(&self.state[self.order * d..(self.order + 1) * d]);
        for row in self.state[..self.order * d].chunks_exact(d).rev() {
            for (xi, c) in x.iter_mut().zip(row) {
                *xi = *xi * theta + c;
            }
        }
    }

    /// Elapsed time at `θ`, s.
    #[must_use]
    pub fn time_at(&self, theta: f64) -> f64 {
        if self.time.is_empty() {
            theta * self.span
        } else {
            self.time[..=self.order].iter().rev().fold(0.0, |s, c| s * theta + c)
        }
    }

    /// Rate of the clock, `dt/dθ`, s.
    #[must_use]
    pub fn rate_at(&self, theta: f64) -> f64 {
        if self.time.is_empty() {
            return self.span;
        }
        (1..=self.order).rev().fold(0.0, |s, k| s * theta + k as f64 * self.time[k])
    }
}
