use super::{GuardId, GuardSet, Instant, Mode, Wide};

/// A step that ends this near to its bound, relative to its span, has reached it: the root of a clock's series is known to a few units in
/// the last place.
pub(crate) const ARRIVED: f64 = 8.0 * f64::EPSILON;

/// Truncation at full precision, relative to the size of the rates: half a unit in the last place.
pub const FULL_PRECISION: f64 = 1e-16;

/// Truncation of step number `count` of an arc that may leave out `tolerance`. Errors of velocities move the bodies for as long as an arc
/// lasts; the squares keep their sum below 1.7 tolerances, however many steps there are.
#[must_use]
pub fn share_of(tolerance: f64, count: u32) -> f64 {
    let count = f64::from(count.max(1));
    FULL_PRECISION.max(tolerance / (count * count))
}

/// What a [`JetField`] is asked for.
#[derive(Clone, Copy, Debug)]
pub struct JetRequest<'a> {
    /// Where.
    pub at: Instant,
    /// State there, `[dim]`.
    pub x: &'a [f64],
    /// What the state is beyond the rounding of `x`, `[dim]`; empty: nothing.
    pub low: &'a [f64],
    /// Guards known to be exactly zero at `at`.
    pub pinned: &'a GuardSet,
    /// Guards whose rate is known to be exactly zero as well.
    pub still: &'a GuardSet,
    /// What [`JetField::carry`] kept from the step before, of the arc before too; empty if nothing.
    pub carried: &'a [f64],
    /// Wanted span of the step, s: the field may return a shorter one.
    pub span: f64,
    /// Truncation wanted, relative to the size of each component: [`FULL_PRECISION`], or more on request.
    pub tolerance: f64,
    /// What the steps of the arc before have left out, as [`Jet::left_out`] tells it.
    pub left_out: [f64; 2],
}

/// What a run has made where a [`JetField`] is asked for a leap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Made {
    /// Leaps of the arc.
    pub leaps: u32,
    /// Arcs of the run: what takes long to form is worth its time after some hundred.
    pub arcs: u64,
    /// Arcs of the run in the mode.
    pub here: u64,
    /// Series lead the arc from here on, as they do for an observer of steps.
    pub by_series: bool,
}

/// The smooth motion in one mode, which knows its own Taylor series.
#[allow(unused_variables, reason = "defaults that do nothing")]
pub trait JetField {
    /// Expands the solution through `request.x`: fills `out` with the coefficients of state, clock and
    /// guards in the step's own clock `θ`, and the largest `θ` up to which they hold to tolerance.
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet);

    /// The way to the next event at once, into `leap`: to the one guard that falls, to the end of `request.span`, or as far as the field
    /// knows it. `false` where it does not know, or where more than one guard may have to do with it: the series decide then.
    ///
    /// `made` is what the run has made so far. Where `shown`, the steps are looked at, and nothing is won by leaping as they do.
    fn leap(&self, request: &JetRequest<'_>, made: Made, shown: bool, leap: &mut Leap) -> bool {
        false
    }

    /// Puts the state at the end of a step back onto what the mode holds fixed, where rounding has moved it: contacts at rest.
    fn restore(&self, at: Instant, x: &mut [f64]) {}

    /// Sizes of the terms whose sums are the value, the rate and the acceleration of guard `id` at the start of `step`, for a
    /// state with components of the sizes in `x`.
    fn term_sizes(&self, id: GuardId, step: &Jet, x: &[f64]) -> [f64; 3] {
        [0.0; 3]
    }

    /// Keeps from `theta` on a step what the state alone holds with less precision, such as a penetration or a gap that is a
    /// small difference of displacements. A jump that moves it says so by an exact zero. The arc `ends` there, or goes on.
    fn carry(&self, step: &Jet, theta: f64, ends: bool, carried: &mut Vec<f64>) {
        carried.clear();
    }

    /// A quantity on `step` as a series in θ, into `series`, empty for zero. `false` where the field does not know it.
    fn show(&self, step: &Jet, what: Shown, series: &mut Vec<f64>) -> bool {
        false
    }

    /// A power on `step` at the places `thetas`. `false` where the field does not know it.
    fn sample(&self, step: &Jet, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        false
    }
}

/// A guard's value and its error, in the guard's units, and the size of the terms it is the sum of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Which.
    pub guard: GuardId,
    /// Its value.
    pub value: f64,
    /// Bound on its error.
    pub error: f64,
    /// Size of the terms.
    pub terms: f64,
    /// At the start, its first three derivatives in time.
    pub derivatives: [f64; 3],
}

/// A guard falls through zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Which.
    pub guard: GuardId,
    /// Its value at the place found.
    pub residual: f64,
    /// Its rate in time there, below zero.
    pub slope: f64,
    /// Bound on the error of its value.
    pub error: f64,
    /// The size of its second derivative in time there, where the slope may be small beside it; else zero.
    pub curvature: f64,
    /// How many of its first derivatives are exactly zero at the start of the leap, its value the zeroth, and nothing that has gathered
    /// before counts.
    pub zeros: usize,
}

/// What [`JetField::leap`] tells.
#[derive(Clone, Debug, Default)]
pub struct Leap {
    /// How far, s.
    pub time: f64,
    /// The state there, `[dim]`.
    pub x: Vec<f64>,
    /// The largest size of each component on the way, `[dim]`: an estimate.
    pub sizes: Vec<f64>,
    /// As of [`JetField::carry`].
    pub carried: Vec<f64>,
    /// The guards at the start.
    pub starts: Vec<Known>,
    /// The guards at the end, where none falls there.
    pub ends: Vec<Known>,
    /// The guard that falls at the end, if one does. No other is near zero on the way.
    pub passage: Option<Passage>,
    /// Guards that are equal to it all the way, and fall with it.
    pub twins: GuardSet,
    /// The end is that of `request.span`.
    pub is_bound: bool,
    /// It leads where the step at its start does, bit for bit.
    pub is_series: bool,
    /// Subdivisions spent on the guards.
    pub splits: u64,
    /// The series that it was read from, if it was.
    pub jet: Jet,
}

/// A quantity that measures ask of a step as a polynomial. Contacts by their number; units and signs as in
/// [`ContactView`](super::ContactView) and [`Powers`](super::Powers).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// Elapsed time since the step's start, s.
    Time,
    /// A component of the state: a coordinate, m, or a velocity, m/s.
    State(usize),
    /// Deflection δ, m.
    Deflection(usize),
    /// `gᵀq = δ + e`, m: of a mesh the dynamic transmission error.
    Transmission(usize),
    /// The force carried, N.
    Force(usize),
    /// Change of the force along g with the deflection, times the rate of the clock `dt/dθ`, N s/m.
    ByDeflection(usize),
    /// The same with the rate of the deflection, kg.
    ByRate(usize),
    /// The same with the latched speed, kg.
    ByLatch(usize),
}

/// A power that measures ask of a step, W. It is a product of series, and only its integral counts: so it is asked for at the places of a
/// quadrature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Lost in one contact.
    Loss(usize),
    /// Of the loads.
    Load,
    /// Of the transmission errors.
    Error,
    /// Of stiffnesses that vary.
    Parametric,
    /// Lost in the structure's dampers.
    Damping,
    /// Lost in all contacts.
    Contacts,
}

/// Places of a quadrature on a step. Gauss's rule with so many is exact to degree 31: where a series of order 24 holds to rounding, the terms
/// of a product of three of them beyond that are below its square.
pub const SAMPLES: usize = 16;

/// Values there.
pub type Samples = [f64; SAMPLES];

/// Whether all are finite. A finite number times zero is zero; NaN and the infinities are not.
fn are_finite(numbers: &[f64]) -> bool {
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
/// State and clock are series in the field's own variable `s`, `x = Σ x_k sᵏ`, and hold for `0 ≤ s ≤ reach`.
/// The step's clock is `θ = s/reach ∈ [0, 1]`; the guards are series in θ. All series have `order + 1`
/// coefficients. The buffers belong to the integrator and are reused.
#[derive(Clone, Debug, Default)]
pub struct Jet {
    /// Highest power kept.
    pub order: usize,
    /// Length of the state.
    pub dim: usize,
    /// State coefficients, row `k` at `[k·dim, (k+1)·dim)`.
    pub state: Vec<f64>,
    /// What the coefficients of the lowest orders are beyond the rounding of `state`, rows as there; empty where it is not kept.
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
    /// For each guard, a bound on what the truncated tail adds on `[0, 1]`.
    pub remainder: Vec<f64>,
    /// For each guard, the rounding error of its value where it is computed from scratch.
    pub rounding: Vec<f64>,
    /// And where nothing is carried on from the step before.
    pub afresh: Vec<f64>,
    /// In a clock of its own: for each guard its rate in time as a series in θ, rows as in `guard_series`.
    pub guard_rates: Vec<f64>,
    /// And the error of its value in its physical units; negative where there is no such row.
    pub guard_errors: Vec<f64>,
    /// What the arc's steps have left out by the end of this one, of displacements and velocities over `1/√M_ii`; zero at full
    /// precision, where it is less than rounding.
    pub left_out: [f64; 2],
    /// The errors of the guards are estimates, no proven bounds.
    pub is_estimate: bool,
    /// Working space of the field.
    pub work: Vec<f64>,
}

impl Jet {
    /// The series of guard `i` in θ, `[order + 1]`.
    #[must_use]
    pub fn guard(&self, i: usize) -> &[f64] {
        let row = self.order + 1;
        &self.guard_series[i * row..(i + 1) * row]
    }

    /// Rate in time of guard `i` at `θ` and the error of its value, in its physical units, if the field gives them.
    #[must_use]
    pub fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        let error = *self.guard_errors.get(i).filter(|e| **e >= 0.0)?;
        let row = self.order + 1;
        let rate = self.guard_rates[i * row..(i + 1) * row].iter().rev().fold(0.0, |s, c| s * theta + c);
        Some((rate, error))
    }

    /// First three derivatives in time of guard `i` at the start, from its series of rates; `None` if it has none.
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

    /// The state at `θ`, by Horner's rule, into `x` `[dim]`.
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

    /// The state at `θ` as `x + low`, each `[dim]`: the orders in `low` by Horner's rule with the rounding of every operation kept.
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

    /// Whether all coefficients of the guards are finite.
    #[must_use]
    pub fn has_finite_guards(&self) -> bool {
        are_finite(&self.guard_series[..(self.order + 1) * self.guards.len()])
    }

    /// Elapsed time at `θ`, s.
    #[must_use]
    pub fn time_at(&self, theta: f64) -> f64 {
        let s = theta * self.reach;
        if self.time.is_empty() {
            s * self.span
        } else {
            self.time[..=self.order].iter().rev().fold(0.0, |t, c| t * s + c)
        }
    }

    /// Elapsed time at `θ`, s: that at which [`state_in_two`](Self::state_in_two) holds.
    #[must_use]
    pub fn time_in_two(&self, theta: f64) -> Wide {
        if self.low.is_empty() { self.time_at(theta).into() } else { Wide::product(theta * self.reach, self.span) }
    }

    /// Rate of the clock, `dt/dθ`, s.
    #[must_use]
    pub fn rate_at(&self, theta: f64) -> f64 {
        if self.time.is_empty() {
            return self.span * self.reach;
        }
        let s = theta * self.reach;
        self.reach * (1..=self.order).rev().fold(0.0, |r, k| r * s + k as f64 * self.time[k])
    }
}
