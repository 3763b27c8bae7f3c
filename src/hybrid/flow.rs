use super::{GuardId, GuardSet, Instant, Mode, StepRows, Wide};

/// Distance to its bound, relative to its span, below which a step has reached the bound. The root of the series of a clock is known to a
/// few units in the last place.
pub(crate) const ARRIVED: f64 = 8.0 * f64::EPSILON;

/// Truncation at full precision, relative to the size of the rates: half a unit in the last place.
pub const FULL_PRECISION: f64 = 1e-16;
/// Factor on a bound by which two values may differ that are known in two ways: each is off by the bound, and both gather rounding over an
/// arc.
pub const AGREED: f64 = 10.0;
/// Factor on the rounding of one value that both values may have gathered.
pub const GATHERED: f64 = 2.0;
/// Maximum number of modes whose motions a run keeps: some kilobytes each, and more modes than most trains visit again.
pub const MOST_MODES: usize = 1024;

/// Truncation of step number `count` of an arc that may leave out `tolerance`. An error of velocity displaces the bodies until the end of
/// the arc. The squares keep the sum below 1.7 tolerances for any number of steps.
#[must_use]
pub fn share_of(tolerance: f64, count: u32) -> f64 {
    let count = f64::from(count.max(1));
    FULL_PRECISION.max(tolerance / (count * count))
}

/// Start, span and accuracy of the step that a [`JetField`] expands.
#[derive(Clone, Copy, Debug)]
pub struct JetRequest<'a> {
    /// Instant of the start.
    pub at: Instant,
    /// State at the start, `[dim]`.
    pub x: &'a [f64],
    /// Part of the state below the rounding of `x`, `[dim]`; empty for zero.
    pub low: &'a [f64],
    /// Guards known to be exactly zero at `at`.
    pub pinned: &'a GuardSet,
    /// Guards whose rate is known to be exactly zero as well.
    pub still: &'a GuardSet,
    /// Values that [`JetField::carry`] kept from the step before, also across arcs; empty if none.
    pub carried: &'a [f64],
    /// Desired span of the step, s: the field may return a shorter one.
    pub span: f64,
    /// Desired truncation, relative to the size of each component: [`FULL_PRECISION`], or more on request.
    pub tolerance: f64,
    /// Truncation of the earlier steps of the arc, as in [`Jet::left_out`].
    pub left_out: [f64; 2],
}

/// Counts of a run at the request of a leap from a [`JetField`].
#[derive(Clone, Copy, Debug, Default)]
pub struct LeapCounts {
    /// Number of leaps of the arc.
    pub leaps: u32,
    /// Number of arcs of the run: tables that take long to form are worth their time after some hundred.
    pub arcs: u64,
    /// Number of arcs of the run in the mode.
    pub here: u64,
    /// True if series continue the arc, as they do for an observer of steps.
    pub by_series: bool,
}

/// Smooth motion in one mode with a known Taylor series.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait JetField {
    /// Expands the solution through `request.x`: fills `out` with the coefficients of state, clock and guards in the clock `θ` of the step.
    /// The result includes the largest `θ` up to which the series hold to tolerance.
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet);

    /// Advances to the next event in one leap: to the one guard that falls, to the end of `request.span`, or as far as the field can.
    /// Returns `false` if it cannot, or if several guards may fall: the series decide then.
    ///
    /// `made` counts the work of the run. With `shown` an observer looks at steps, and a leap by series gains nothing.
    fn leap(&self, request: &JetRequest<'_>, made: LeapCounts, shown: bool, leap: &mut Leap) -> bool {
        false
    }

    /// Removes rounding from the state at the end of a step where the mode holds it fixed: contacts at rest.
    fn restore(&self, at: Instant, x: &mut [f64]) {}

    /// Returns the sizes of the terms of value, rate and acceleration of guard `id` at the start of `step`. The components of the state
    /// have the sizes in `x`.
    fn term_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        [0.0; 3]
    }

    /// Keeps values at `theta` on a step that the state alone holds less precisely. An example is a penetration or gap that is a small
    /// difference of displacements. A jump that moves it sets an exact zero. The arc `ends` there, or continues.
    fn carry(&self, step: &Jet, theta: f64, ends: bool, carried: &mut Vec<f64>) {
        carried.clear();
    }

    /// Writes a quantity on `step` as a series in θ into `series`, empty for zero. Returns `false` if the field does not know it.
    fn show(&self, step: &Jet, what: StepQuantity, series: &mut Vec<f64>) -> bool {
        false
    }

    /// Writes a power on `step` at the places `thetas`. Returns `false` if the field does not know it.
    fn sample(&self, step: &Jet, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        false
    }
}

/// Value and error of a guard, in its units, with the size of the terms that are summed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardValue {
    /// Guard.
    pub guard: GuardId,
    /// Value of the guard.
    pub value: f64,
    /// Bound on its error.
    pub error: f64,
    /// Size of the terms.
    pub terms: f64,
    /// First three time derivatives; only at the start of a leap.
    pub derivatives: [f64; 3],
}

/// Fall of a guard through zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Guard that falls.
    pub guard: GuardId,
    /// Value of the guard at the computed root.
    pub residual: f64,
    /// Time derivative of the guard there, below zero.
    pub slope: f64,
    /// Bound on the error of the value.
    pub error: f64,
    /// Size of the second time derivative there, if the slope may be small beside it; else zero.
    pub curvature: f64,
    /// Number of the leading derivatives, from the value on, that are exactly zero at the start of the leap. No earlier rounding affects
    /// them.
    pub zeros: usize,
}

/// Result of [`JetField::leap`].
#[derive(Clone, Debug, Default)]
pub struct Leap {
    /// Duration of the leap, s.
    pub time: f64,
    /// State at the end, `[dim]`.
    pub x: Vec<f64>,
    /// Largest size of each component during the leap, `[dim]`: an estimate.
    pub sizes: Vec<f64>,
    /// Values kept as by [`JetField::carry`].
    pub carried: Vec<f64>,
    /// Guards at the start.
    pub starts: Vec<GuardValue>,
    /// Guards at the end, if none falls there.
    pub ends: Vec<GuardValue>,
    /// The guard that falls at the end, if any. No other guard comes near zero during the leap.
    pub passage: Option<Passage>,
    /// Guards that equal the falling guard during the whole leap, and fall with it.
    pub twins: GuardSet,
    /// True if the leap ends at the end of `request.span`.
    pub is_bound: bool,
    /// True if the leap equals the step at its start, bit for bit.
    pub is_series: bool,
    /// Number of subdivisions spent on the guards.
    pub splits: u64,
    /// Series from which the leap was read, if any.
    pub jet: Jet,
}

/// A quantity that measures read from a step as a polynomial. Contacts are given by number; units and signs are those of
/// [`ContactView`](super::ContactView) and [`Powers`](super::Powers).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepQuantity {
    /// Elapsed time since the step's start, s.
    Time,
    /// A component of the state: a coordinate, m, or a velocity, m/s.
    State(usize),
    /// Deflection δ, m.
    Deflection(usize),
    /// Dynamic transmission error `gᵀq = δ + e` of a contact, m.
    Transmission(usize),
    /// Contact force, N.
    Force(usize),
    /// Derivative of the force along g with respect to the deflection, times the rate of the clock `dt/dθ`, N s/m.
    ByDeflection(usize),
    /// The same with respect to the rate of the deflection, kg.
    ByRate(usize),
    /// The same with respect to the latched speed, kg.
    ByLatch(usize),
}

/// A power that measures read from a step, W. It is a product of series, and only its integral is needed: it is evaluated at the places of
/// a quadrature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Power lost in one contact.
    Loss(usize),
    /// Power of the loads.
    Load,
    /// Power of the transmission errors.
    Error,
    /// Power of time-varying stiffnesses.
    Parametric,
    /// Power lost in the dampers of the structure.
    Damping,
    /// Power lost in all contacts.
    Contacts,
}

/// Number of places of a quadrature on a step. Gauss's rule of this size is exact to degree 31. Series of order 24 hold to rounding, and
/// the terms of a product of three beyond degree 31 are below its square.
pub const SAMPLES: usize = 16;

/// Values at these places.
pub type Samples = [f64; SAMPLES];

/// Returns whether all numbers are finite. A finite number times zero is zero; NaN and the infinities are not.
#[inline(always)]
pub(crate) fn are_finite(numbers: &[f64]) -> bool {
    let (eights, rest) = numbers.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        sums.iter_mut().zip(eight).for_each(|(sum, c)| *sum += c * 0.0);
    }
    sums.iter().chain(rest).fold(0.0, |sum, c| sum + c * 0.0) == 0.0
}

/// Makes each `x` the double nearest to `x + low`.
pub fn normalise(x: &mut [f64], low: &mut [f64]) {
    for (x, low) in x.iter_mut().zip(low) {
        let sum = Wide::sum(*x, *low);
        (*x, *low) = (sum.hi, sum.lo);
    }
}

/// A vector field `ẋ = f(t, x)` with its Jacobian.
pub trait VectorField {
    /// `dx = f(t, x)` in `mode`, `dx` `[dim]`. `t` is measured from `base`, s.
    fn eval(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]);
    /// `jv = (∂f/∂x) v` in `mode`, `v` and `jv` `[dim]`.
    fn jac_mul(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]);
}

/// Taylor coefficients of one step.
///
/// State and clock are series in the variable `s` of the field, `x = Σ x_k sᵏ`, and hold for `0 ≤ s ≤ reach`. The clock of the step is `θ =
/// s/reach ∈ [0, 1]`; the guards are series in θ. All series have `order + 1` coefficients. The buffers belong to the integrator and are
/// reused.
#[derive(Clone, Debug, Default)]
pub struct Jet {
    /// Highest power kept.
    pub order: usize,
    /// Length of the state.
    pub dim: usize,
    /// State coefficients, row `k` at `[k·dim, (k+1)·dim)`.
    pub state: Vec<f64>,
    /// Parts of the coefficients of the lowest orders below the rounding of `state`, in the same rows; empty if not kept.
    pub low: Vec<f64>,
    /// Elapsed time `t(s) − t0`, s, `[order + 1]`; empty when time is the clock and `t = s · span`.
    pub time: Vec<f64>,
    /// Span of `s ∈ [0, 1]`, s, when time is the clock.
    pub span: f64,
    /// Largest `s` at which the series hold to tolerance; not finite if they could not be formed.
    pub reach: f64,
    /// The guards of the mode, in the order of their rows in `guard_series`.
    pub guards: Vec<GuardId>,
    /// Guard coefficients in θ, row `i` at `[i·(order + 1), (i + 1)·(order + 1))`.
    pub guard_series: Vec<f64>,
    /// Bound on the truncated tail of each guard on `[0, 1]`.
    pub remainder: Vec<f64>,
    /// Rounding error of the value of each guard if it is computed from scratch.
    pub rounding: Vec<f64>,
    /// Rounding error of the value of each guard if nothing is carried on from the step before.
    pub afresh: Vec<f64>,
    /// For a clock other than time: rate of each guard in time as a series in θ, rows as in `guard_series`.
    pub guard_rates: Vec<f64>,
    /// For a clock other than time: error of the value of each guard in its physical units; negative if there is no such row.
    pub guard_errors: Vec<f64>,
    /// Truncation of the arc up to the end of this step, of displacements and velocities over `1/√M_ii`; zero at full precision, where it
    /// is below rounding.
    pub left_out: [f64; 2],
    /// True if the errors of the guards are estimates, not proven bounds.
    pub is_estimate: bool,
    /// Other series of the step.
    pub rows: StepRows,
}

impl Jet {
    /// Returns the series of guard `i` in θ, `[order + 1]`.
    #[must_use]
    pub fn guard(&self, i: usize) -> &[f64] {
        let row = self.order + 1;
        &self.guard_series[i * row..(i + 1) * row]
    }

    /// Returns the rate in time of guard `i` at `θ` and the error of its value, in its physical units, if the field gives them.
    #[must_use]
    pub fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        let error = *self.guard_errors.get(i).filter(|e| **e >= 0.0)?;
        let row = self.order + 1;
        let rate = self.guard_rates[i * row..(i + 1) * row].iter().rev().fold(0.0, |s, c| s * theta + c);
        Some((rate, error))
    }

    /// Returns the first three time derivatives of guard `i` at the start, from its series of rates; `None` if it has none.
    ///
    /// With `t = t_m s^m + …` the rate is `r = ġ + g̈ t + g⃛ t²/2 + …`, so `r_m = g̈ t_m` and
    /// `r_2m = g̈ t_2m + g⃛ t_m²/2`. A force that starts with the clock enters r only beyond t, as `t^(n+1)`.
    #[must_use]
    pub fn guard_derivatives_in_time(&self, i: usize) -> Option<[f64; 3]> {
        self.guard_errors.get(i).filter(|e| **e >= 0.0)?;
        let m = self.time.iter().position(|t| *t != 0.0).filter(|m| 2 * m <= self.order)?;
        let rates = &self.guard_rates[i * (self.order + 1)..];
        // The rows of rates are series in θ, those of the time in s = θ reach.
        let power = self.reach.powi(m as i32);
        let (first, second) = (self.time[m] * power, self.time[2 * m] * power * power);
        let curvature = rates[m] / first;
        Some([rates[0], curvature, 2.0 * (rates[2 * m] - curvature * second) / (first * first)])
    }

    /// Evaluates the state at `θ`, by Horner's rule, into `x` `[dim]`.
    pub fn state_at(&self, theta: f64, x: &mut [f64]) {
        let (d, s) = (self.dim, theta * self.reach);
        // Four components side by side.
        let (fours, rest) = x.as_chunks_mut::<4>();
        let singles = 4 * fours.len();
        for (i, four) in fours.iter_mut().enumerate() {
            let mut sums = [0.0; 4];
            for row in self.state[..(self.order + 1) * d].chunks_exact(d).rev() {
                if let Some(row) = row[4 * i..].first_chunk::<4>() {
                    (0..4).for_each(|l| sums[l] = sums[l] * s + row[l]);
                }
            }
            *four = sums;
        }
        for (i, x) in rest.iter_mut().enumerate() {
            let column = self.state[..(self.order + 1) * d].iter().skip(singles + i).step_by(d);
            *x = column.rev().fold(0.0, |sum, c| sum * s + c);
        }
    }

    /// Evaluates the state at `θ` as `x + low`, each `[dim]`: Horner's rule, with all roundings kept for the orders in `low`.
    pub fn state_in_two(&self, theta: f64, x: &mut [f64], low: &mut [f64]) {
        low.fill(0.0);
        if self.low.is_empty() {
            return self.state_at(theta, x);
        }
        let (d, s) = (self.dim, theta * self.reach);
        x.fill(0.0);
        for row in self.state[self.low.len()..(self.order + 1) * d].chunks_exact(d).rev() {
            x.iter_mut().zip(row).for_each(|(x, c)| *x = *x * s + c);
        }
        for (row, lows) in self.state.chunks_exact(d).zip(self.low.chunks_exact(d)).rev() {
            for ((x, low), (c, l)) in x.iter_mut().zip(&mut *low).zip(row.iter().zip(lows)) {
                let product = Wide::product(*x, s);
                let sum = Wide::sum(product.hi, *c);
                (*x, *low) = (sum.hi, *low * s + (product.lo + sum.lo + l));
            }
        }
        normalise(x, low);
    }

    /// Returns whether all coefficients of the guards are finite.
    #[must_use]
    pub fn has_finite_guards(&self) -> bool {
        are_finite(&self.guard_series[..(self.order + 1) * self.guards.len()])
    }

    /// Returns the elapsed time at `θ`, s.
    #[must_use]
    pub fn time_at(&self, theta: f64) -> f64 {
        let s = theta * self.reach;
        if self.time.is_empty() {
            s * self.span
        } else {
            self.time[..=self.order].iter().rev().fold(0.0, |t, c| t * s + c)
        }
    }

    /// Returns the elapsed time at `θ`, s, at which [`state_in_two`](Self::state_in_two) holds.
    #[must_use]
    pub fn time_in_two(&self, theta: f64) -> Wide {
        if self.low.is_empty() { self.time_at(theta).into() } else { Wide::product(theta * self.reach, self.span) }
    }

    /// Returns the rate of the clock, `dt/dθ`, s.
    #[must_use]
    pub fn rate_at(&self, theta: f64) -> f64 {
        if self.time.is_empty() {
            return self.span * self.reach;
        }
        let s = theta * self.reach;
        self.reach * (1..=self.order).rev().fold(0.0, |r, k| r * s + k as f64 * self.time[k])
    }
}
