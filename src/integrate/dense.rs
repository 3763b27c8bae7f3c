//! Dense output of a step whose solver offers an interpolant: plain polynomials in `θ ∈ [0, 1]`.
//!
//! The state on a step is a polynomial of the degree of the interpolant. A guard (with forcing that is no polynomial) is interpolated at
//! Chebyshev points. The decay of its Chebyshev coefficients and two more samples estimate the error. Without resolution, the step is
//! output in several pieces.

use crate::{
    hybrid::{GuardId, HybridSystem, Instant, Mode},
    integrate::{Arc, DenseStep},
    poly::{CHEBYSHEV, Chebyshev, DEGREE},
};

/// Degree tried first.
const FIRST: usize = 8;
/// Number of coefficients of the polynomial of one guard.
const ROW: usize = DEGREE + 1;
/// Highest degree of an interpolant of the state.
#[cfg(feature = "diffsol")]
pub(super) const STATE_DEGREE: usize = 5;
/// Maximum number of halvings of a step: motion that is not resolved on 1/64 of a step is not smooth.
const HALVINGS: i32 = 6;
/// The share of the integration error that interpolation may add to a guard.
const SHARE: f64 = 1e-2;
/// Places at which the interpolation is checked: between the Chebyshev points.
const CHECKS: [f64; 2] = [0.381_966, 0.888_889];

/// Returns the points at which an interpolant of the given degree is to be sampled, ends included.
#[cfg(feature = "diffsol")]
pub(super) fn state_points(degree: usize) -> impl Iterator<Item = f64> {
    (0..=degree).map(move |i| i as f64 / degree as f64)
}

/// Converts `samples` at the [`state_points`] to coefficients of powers, by divided differences, component by component in place. The rows
/// of `samples` are states, `[(degree + 1) · dim]`.
#[cfg(feature = "diffsol")]
pub(super) fn to_powers(samples: &mut [f64], dim: usize) {
    let degree = samples.len() / dim - 1;
    let point = |i: usize| i as f64 / degree as f64;
    for level in 1..=degree {
        for i in (level..=degree).rev() {
            let width = point(i) - point(i - level);
            let (low, high) = samples.split_at_mut(i * dim);
            for (a, b) in high[..dim].iter_mut().zip(&low[(i - 1) * dim..]) {
                *a = (*a - b) / width;
            }
        }
    }
    // Newton's form to powers: multiply out the factors (θ − θ_i), the innermost first.
    for level in (0..degree).rev() {
        for i in level..degree {
            let (low, high) = samples.split_at_mut((i + 1) * dim);
            for (a, b) in low[i * dim..].iter_mut().zip(&high[..dim]) {
                *a -= point(level) * b;
            }
        }
    }
}

/// A piece of a step of the solver, as passed to the visitor.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    dim: usize,
    /// State on the whole step; row `k` has the coefficients of `θᵏ`.
    pub step: Vec<f64>,
    /// State on the piece.
    state: Vec<f64>,
    start: Instant,
    span: f64,
    guards: Vec<GuardId>,
    series: Vec<f64>,
    error: Vec<(f64, f64)>,
    /// States at the Chebyshev points of the piece and, behind them, at the check points.
    samples: Vec<f64>,
    scratch: Vec<f64>,
}

impl DenseStep for Pieces {
    fn start(&self) -> Instant {
        self.start
    }
    fn rate(&self, _theta: f64) -> f64 {
        self.span
    }
    fn time(&self, theta: f64) -> f64 {
        theta * self.span
    }
    fn state(&self, theta: f64, x: &mut [f64]) {
        horner(&self.state, self.dim, theta, x);
    }
    fn guards(&self) -> &[GuardId] {
        &self.guards
    }
    fn guard(&self, i: usize) -> &[f64] {
        &self.series[i * ROW..(i + 1) * ROW]
    }
    fn guard_error(&self, i: usize) -> (f64, f64) {
        self.error[i]
    }
    fn plain_span(&self) -> Option<f64> {
        Some(self.span)
    }
}

fn horner(rows: &[f64], dim: usize, theta: f64, x: &mut [f64]) {
    let mut rows = rows.chunks_exact(dim).rev();
    if let Some(last) = rows.next() {
        x.copy_from_slice(last);
    }
    for row in rows {
        x.iter_mut().zip(row).for_each(|(x, c)| *x = *x * theta + c);
    }
}

/// Returns the sum of the effects of the uncertainty of each component on guard `id`, to first order.
fn blur(system: &dyn HybridSystem, mode: &Mode, id: GuardId, at: Instant, x: &[f64], unsure: &[f64]) -> f64 {
    /// Factor on an uncertainty near rounding, so that its effect is visible.
    const LARGER: f64 = 1e6;
    if unsure.is_empty() {
        return 0.0;
    }
    let (mut y, g) = (x.to_vec(), system.guard(mode, id, at, x));
    let part = |(i, u): (usize, &f64)| {
        y[i] = x[i] + LARGER * u;
        let moved = (system.guard(mode, id, at, &y) - g).abs();
        y[i] = x[i];
        moved / LARGER
    };
    unsure.iter().enumerate().map(part).sum()
}

/// Position of a step in its arc, with tolerance and uncertainty.
#[derive(Clone, Copy)]
pub(super) struct StepPosition<'a> {
    pub system: &'a dyn HybridSystem,
    pub arc: &'a Arc<'a>,
    /// Relative tolerance of the integration.
    pub rtol: f64,
    /// Start of the solver's step, s after the start of the arc.
    pub from: f64,
    /// End of the solver's step; `None` for the end of the arc.
    pub to: Option<f64>,
    /// Uncertainty of each component beyond the error of the polynomial; empty for none.
    pub unsure: &'a [f64],
}

impl Pieces {
    /// Returns the effect of the uncertainties `unsure` of the state on each guard.
    pub fn blurs(
        &self,
        system: &dyn HybridSystem,
        mode: &Mode,
        at: Instant,
        x: &[f64],
        unsure: &[f64],
    ) -> Vec<(GuardId, f64)> {
        self.guards.iter().map(|g| (*g, blur(system, mode, *g, at, x, unsure))).collect()
    }

    /// Prepares for an arc.
    pub fn begin(&mut self, place: &StepPosition<'_>) {
        self.dim = place.system.dim();
        place.system.guards(place.arc.mode, &mut self.guards);
        self.series.clear();
        self.series.resize(self.guards.len() * ROW, 0.0);
        self.error.clear();
        self.error.resize(self.guards.len(), (0.0, 0.0));
        self.samples.resize((ROW + CHECKS.len()) * self.dim, 0.0);
        self.scratch.resize(self.dim, 0.0);
    }

    /// Passes the step to the visitor, whole if every guard is resolved on it, otherwise in pieces. Returns `false` if the visitor stops.
    pub fn visit(&mut self, place: &StepPosition<'_>, mut visitor: impl FnMut(&dyn DenseStep) -> bool) -> bool {
        let smallest = 0.5f64.powi(HALVINGS);
        let (mut low, mut width) = (0.0, 1.0);
        while low < 1.0 {
            if !self.cut(place, low, width) && width > smallest {
                width *= 0.5;
                continue;
            }
            if !visitor(self) {
                return false;
            }
            low += width;
        }
        true
    }

    /// Selects the piece `[low, low + width]` of the step; returns `false` if a guard is not resolved on it.
    fn cut(&mut self, place: &StepPosition<'_>, low: f64, width: f64) -> bool {
        let clock = place.system.clock();
        let at = |theta: f64| match place.to {
            Some(to) => clock.advance(place.arc.at, place.from + theta * (to - place.from)),
            None if theta == 1.0 => place.arc.bound,
            None => {
                let whole = clock.between(place.arc.at, place.arc.bound) - place.from;
                clock.advance(place.arc.at, place.from + theta * whole)
            }
        };
        self.start = if low == 0.0 && place.from == 0.0 { place.arc.at } else { at(low) };
        self.span = clock.between(self.start, at(low + width));
        self.shift(low, width);
        for i in (0..=DEGREE).step_by(DEGREE / FIRST) {
            self.sample(i, Chebyshev::point(i, DEGREE));
        }
        for (i, theta) in CHECKS.into_iter().enumerate() {
            self.sample(ROW + i, theta);
        }
        let first = low == 0.0 && place.from == 0.0;
        let mut dense = false;
        (0..self.guards.len()).all(|i| self.interpolate(place, i, first, &mut dense))
    }

    /// Computes the coefficients of the state on `[low, low + width]`, by repeated synthetic division.
    fn shift(&mut self, low: f64, width: f64) {
        let (dim, state) = (self.dim, &mut self.state);
        state.clone_from(&self.step);
        let degree = state.len() / dim - 1;
        if low != 0.0 {
            for level in 0..degree {
                for k in (level..degree).rev() {
                    let (below, above) = state.split_at_mut((k + 1) * dim);
                    below[k * dim..].iter_mut().zip(&above[..dim]).for_each(|(a, b)| *a += low * b);
                }
            }
        }
        let mut power = 1.0;
        for row in state.chunks_exact_mut(dim) {
            row.iter_mut().for_each(|c| *c *= power);
            power *= width;
        }
    }

    fn sample(&mut self, i: usize, theta: f64) {
        horner(&self.state, self.dim, theta, &mut self.samples[i * self.dim..(i + 1) * self.dim]);
    }

    /// Interpolates guard `i` on the piece; returns `false` if it is not resolved.
    fn interpolate(&mut self, place: &StepPosition<'_>, i: usize, first: bool, dense: &mut bool) -> bool {
        let id = self.guards[i];
        let pinned = first && place.arc.pinned.contains(id);
        let (rounding, sensitivity) = self.rounding(place, i);
        let mut values = [0.0; ROW];
        let mut c = [0.0; ROW];
        let mut n = FIRST;
        let (mut tolerance, mut tail, mut resolved);
        loop {
            if n == DEGREE && !*dense {
                *dense = true;
                for j in (1..DEGREE).step_by(2) {
                    self.sample(j, Chebyshev::point(j, DEGREE));
                }
            }
            for (j, v) in values[..=n].iter_mut().enumerate() {
                let k = j * DEGREE / n;
                *v = self.value(place, i, Chebyshev::point(j, n), k);
            }
            if pinned {
                values[0] = 0.0;
            }
            CHEBYSHEV.coefficients(&values[..=n], &mut c);
            let range: f64 = c[1..=n].iter().map(|c| c.abs()).sum();
            // At an exact zero the leading coefficients decide, however small: the tolerance has no share of the integration error.
            let share = if pinned { 0.0 } else { SHARE * place.rtol };
            tolerance = share * range.min(sensitivity.max(f64::MIN_POSITIVE)) + rounding;
            tail = c[n].abs() + c[n - 1].abs();
            // Trailing coefficients below the tolerance only add noise to the powers.
            let mut top = n;
            while top > 1 && tail + c[top].abs() <= tolerance {
                tail += c[top].abs();
                c[top] = 0.0;
                top -= 1;
            }
            CHEBYSHEV.to_powers(&c[..=top], &mut self.series[i * ROW..(i + 1) * ROW]);
            for (j, theta) in CHECKS.into_iter().enumerate() {
                let gap = crate::poly::eval(self.guard(i), theta) - self.value(place, i, theta, ROW + j);
                tail = tail.max(2.0 * gap.abs());
            }
            resolved = tail <= 4.0 * tolerance;
            if resolved || n == DEGREE {
                break;
            }
            n = DEGREE;
        }
        // Cancellation between the powers: Σ |c_k| T_k(3) bounds the sum of their sizes.
        let (mut before, mut now, mut cancelled) = (1.0, 3.0, c[0].abs());
        for c in &c[1..=n] {
            cancelled += c.abs() * now;
            (before, now) = (now, 6.0 * now - before);
        }
        let cancelled = f64::EPSILON * cancelled;
        let blur = blur(place.system, place.arc.mode, id, self.start, &self.samples[..self.dim], place.unsure);
        self.error[i] = (tail + cancelled + blur, rounding);
        if pinned {
            self.pin(i, first && place.arc.still.contains(id), place.rtol * sensitivity);
        }
        resolved && cancelled <= 4.0 * tolerance
    }

    fn value(&self, place: &StepPosition<'_>, i: usize, theta: f64, sample: usize) -> f64 {
        let at = place.system.clock().advance(self.start, theta * self.span);
        let x = &self.samples[sample * self.dim..(sample + 1) * self.dim];
        place.system.guard(place.arc.mode, self.guards[i], at, x)
    }

    /// Sets the coefficients that are exactly zero at the start of the arc to zero.
    ///
    /// A guard that is still and whose second derivative vanishes too (a contact released from rest) starts with its cubic term. A square
    /// term of the opposite sign whose dip stays within `noise` is dropped.
    fn pin(&mut self, i: usize, still: bool, noise: f64) {
        let series = &mut self.series[i * ROW..(i + 1) * ROW];
        series[0] = 0.0;
        if !still {
            return;
        }
        self.error[i].0 += series[1].abs();
        series[1] = 0.0;
        let (square, cube) = (series[2], series[3]);
        let error = self.error[i].0 + self.error[i].1 + noise;
        // The lowest point of s θ² + c θ³ with s < 0 < c is −(4/27) |s|³/c².
        if square < 0.0 && cube > 0.0 && 4.0 / 27.0 * square.abs().powi(3) <= error * cube * cube {
            self.error[i].0 += square.abs();
            series[2] = 0.0;
        }
    }

    /// Returns the rounding error of the value of a guard, and its sensitivity to relative errors of the state. The components of the state
    /// are changed by one part in 10⁶, with two patterns of signs.
    fn rounding(&mut self, place: &StepPosition<'_>, i: usize) -> (f64, f64) {
        const PART: f64 = 1e-6;
        let at = self.start;
        let id = self.guards[i];
        let g = place.system.guard(place.arc.mode, id, at, &self.samples[..self.dim]);
        let mut moved: f64 = 0.0;
        for pattern in 0..2 {
            for (j, (s, x)) in self.scratch.iter_mut().zip(&self.samples[DEGREE * self.dim..]).enumerate() {
                let sign = if pattern == 1 && j % 2 == 1 { -PART } else { PART };
                let size = x.abs().max(self.samples[j].abs());
                *s = self.samples[j] + sign * size;
            }
            moved = moved.max((place.system.guard(place.arc.mode, id, at, &self.scratch) - g).abs());
        }
        let sensitivity = moved / PART;
        (4.0 * f64::EPSILON * (g.abs() + sensitivity), g.abs() + sensitivity)
    }
}
