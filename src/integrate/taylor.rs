//! The Taylor method: each step is the series of the solution, to round-off.

use std::ops::ControlFlow;

use super::{Arc, DenseStep, EarlierSteps, IntegrateError, Integrator, in_plain_time};
use crate::hybrid::{
    ARRIVED, FULL_PRECISION, GuardId, GuardSet, HybridSystem, Instant, Jet, JetField, JetRequest, Mode, Power, Samples,
    StepQuantity, Wide, share_of,
};

/// Taylor steps of a [`JetField`].
///
/// A step requests the whole remaining arc; the series itself determines its range. There is no step-size memory, and a restart costs
/// nothing.
#[derive(Debug, Default)]
pub struct Taylor {
    jet: Jet,
    x: Vec<f64>,
    carried: Vec<f64>,
    /// Largest size of each component at the starts of the steps of the arc so far.
    extent: Vec<f64>,
    varied: bool,
    /// Truncation of the arc so far, as in [`Jet::left_out`](crate::hybrid::Jet::left_out).
    pub(super) left_out: [f64; 2],
    /// Uncertainties of guards from before the current part of the arc.
    pub(super) blur: Vec<(GuardId, f64)>,
}

impl Taylor {
    /// Returns the same method with other step boundaries, a lower order, and an independent rule for the range of a series: for checks of
    /// the usual method.
    #[must_use]
    pub fn varied() -> Self {
        Self { varied: true, ..Self::default() }
    }
}

/// Order of the varied method: odd while the usual one is even. A motion whose even (or odd) terms are zero cannot deceive both.
const VARIED_ORDER: usize = 19;
/// Fraction to which every other step of the varied method is cut: no multiple of it coincides with an end of the usual steps.
const VARIED_CUT: f64 = 0.61;

/// Returns the largest part of the step over which every term from the varied order on is below the truncation of its component.
fn holds(jet: &Jet) -> f64 {
    let mut part: f64 = 1.0;
    for i in 0..jet.dim {
        let term = |k: usize| jet.state[k * jet.dim + i].abs() * jet.reach.powi(k as i32);
        let size = (0..4).map(term).fold(0.0, f64::max);
        for k in (VARIED_ORDER..=jet.order).filter(|_| size > 0.0) {
            if term(k) > FULL_PRECISION * size {
                part = part.min(libm::pow(FULL_PRECISION * size / term(k), 1.0 / k as f64));
            }
        }
    }
    part
}

/// Cuts a step to a part of itself and drops the terms above the varied order; the dropped terms count as its error.
fn vary(jet: &mut Jet, part: f64) {
    let row = jet.order + 1;
    jet.reach *= part;
    for series in [&mut jet.guard_series, &mut jet.guard_rates] {
        for series in series.chunks_exact_mut(row) {
            let mut power = 1.0;
            series.iter_mut().for_each(|c| {
                *c *= power;
                power *= part;
            });
        }
    }
    for i in 0..jet.guards.len() {
        let dropped = &mut jet.guard_series[i * row + VARIED_ORDER + 1..(i + 1) * row];
        jet.remainder[i] += dropped.iter().fold(0.0, |sum, c| sum + c.abs());
        dropped.fill(0.0);
    }
    jet.state[(VARIED_ORDER + 1) * jet.dim..row * jet.dim].fill(0.0);
}

/// Rounding of a sum relative to its terms: a few units for each. Over the steps of an arc it grows like their root.
const ARC_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Weights of value, rate and acceleration. The terms of the value are summed at every step and again at the event, the others at every
/// step. Each term of an acceleration is a product.
const WEIGHTS: [f64; 3] = [4.0, 2.0, 2.0];

/// Returns the rounding that a guard may have gathered at the time `t` of step number `count` of an arc: see [`DenseStep::gathered`]. The
/// `sizes` are those of the terms of its value, rate and acceleration.
pub(crate) fn gathered([value, rate, acceleration]: [f64; 3], count: u32, t: f64, zeros: usize) -> f64 {
    let terms = [WEIGHTS[0] * value, WEIGHTS[1] * rate * t, WEIGHTS[2] * 0.5 * acceleration * t * t];
    // The third derivative is never known exactly: the time at which an acceleration is zero is rounded.
    let known = if count == 1 { zeros.min(2) } else { 0 };
    ARC_ROUNDING * f64::from(count).sqrt() * terms.iter().skip(known).sum::<f64>()
}

struct Step<'a> {
    start: Instant,
    jet: &'a Jet,
    blur: &'a [(GuardId, f64)],
    extent: &'a [f64],
    /// Number of steps of the arc up to this one.
    count: u32,
    /// Truncation of the steps before.
    before: [f64; 2],
    field: &'a dyn JetField,
}

impl Step<'_> {
    fn blur(&self, i: usize) -> f64 {
        let id = self.jet.guards[i];
        self.blur.iter().find(|(guard, _)| *guard == id).map_or(0.0, |(_, blur)| *blur)
    }
}

impl DenseStep for Step<'_> {
    fn start(&self) -> Instant {
        self.start
    }
    fn time(&self, theta: f64) -> f64 {
        self.jet.time_at(theta)
    }
    fn rate(&self, theta: f64) -> f64 {
        self.jet.rate_at(theta)
    }
    fn state(&self, theta: f64, x: &mut [f64]) {
        self.jet.state_at(theta, x);
    }
    fn state_in_two(&self, theta: f64, x: &mut [f64], low: &mut [f64]) {
        self.jet.state_in_two(theta, x, low);
    }
    fn time_in_two(&self, theta: f64) -> Wide {
        self.jet.time_in_two(theta)
    }
    fn guards(&self) -> &[GuardId] {
        &self.jet.guards
    }
    fn guard(&self, i: usize) -> &[f64] {
        self.jet.guard(i)
    }
    fn guard_error(&self, i: usize) -> (f64, f64) {
        // For a clock other than time a guard may be a root, and its uncertainty in time contains all errors.
        let blur = if self.jet.time.is_empty() { self.blur(i) } else { 0.0 };
        (self.jet.remainder[i] + blur, self.jet.rounding[i])
    }
    fn left_out(&self, i: usize) -> f64 {
        if self.jet.left_out == [0.0; 2] { 0.0 } else { self.jet.remainder[i] }
    }
    fn before(&self) -> EarlierSteps<'_> {
        EarlierSteps { steps: self.count - 1, extent: self.extent, left_out: self.before }
    }
    fn guard_in_time(&self, i: usize, theta: f64) -> Option<(f64, f64)> {
        self.jet.guard_in_time(i, theta).map(|(rate, error)| (rate, error + self.blur(i)))
    }
    fn guard_derivatives_in_time(&self, i: usize) -> Option<[f64; 3]> {
        match self.plain_span() {
            Some(h) => in_plain_time(self.guard(i), h),
            None => self.jet.guard_derivatives_in_time(i),
        }
    }
    fn gathered(&self, i: usize, theta: f64, zeros: usize) -> f64 {
        let sizes = self.field.term_sizes(self.jet.guards[i], self.jet, self.extent);
        // At the start of a root clock, time is a power of it: that many zeros are one zero in time.
        let power = self.jet.time.iter().position(|t| *t != 0.0).unwrap_or(1).max(1);
        gathered(sizes, self.count, self.time(theta), zeros.div_ceil(power))
    }
    fn carry(&self, theta: f64, carried: &mut Vec<f64>) {
        self.field.carry(self.jet, theta, true, carried);
    }
    fn guard_rounding(&self, i: usize) -> f64 {
        self.jet.afresh.get(i).copied().unwrap_or(self.jet.rounding[i])
    }
    fn is_estimate(&self) -> bool {
        self.jet.is_estimate
    }
    fn show(&self, what: StepQuantity, row: &mut Vec<f64>) -> bool {
        self.field.show(self.jet, what, row)
    }
    fn sample(&self, what: Power, thetas: &Samples, values: &mut Samples) -> bool {
        self.field.sample(self.jet, what, thetas, values)
    }
    fn plain_span(&self) -> Option<f64> {
        self.jet.time.is_empty().then_some(self.jet.span * self.jet.reach)
    }
}

impl Integrator for Taylor {
    fn name(&self) -> &'static str {
        "taylor"
    }

    fn is_exact(&mut self, _: &dyn HybridSystem, _: &Mode, _: f64) -> bool {
        !self.varied
    }

    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError> {
        let field = arc.motion.ok_or(IntegrateError::NoJet)?;
        let clock = system.clock();
        let Self { jet, x, carried, extent, blur, varied, left_out } = self;
        let mut cuts = *varied;
        // The oscillators of another system may have been formed at this instant.
        jet.rows.oscillators_at = None;
        carried.clear();
        carried.extend_from_slice(arc.carried);
        x.clear();
        x.extend_from_slice(arc.x);
        low.fill(0.0);
        low[..arc.low.len()].copy_from_slice(arc.low);
        let (mut at, mut pinned, mut still) = (arc.at, arc.pinned, arc.still);
        let mut count = arc.before.steps;
        *left_out = arc.before.left_out;
        extent.clear();
        extent.extend_from_slice(arc.before.extent);
        extent.resize(x.len(), 0.0);
        loop {
            let span = clock.between(at, arc.bound);
            if clock.is_no_time(at, span) {
                end.copy_from_slice(x);
                return Ok(());
            }
            let (before, tolerance) = (*left_out, share_of(arc.tolerance, count + 1));
            let request = JetRequest { at, x, low, pinned, still, carried, span, tolerance, left_out: before };
            field.jet(&request, jet);
            *left_out = jet.left_out;
            if !jet.reach.is_finite() || !jet.has_finite_guards() {
                return Err(IntegrateError::NotFinite { t: clock.time(at).value() });
            }
            if *varied {
                vary(jet, holds(jet).min(if cuts { VARIED_CUT } else { 1.0 }));
                cuts = !cuts;
            }
            let elapsed = jet.time_at(1.0);
            extent.iter_mut().zip(&*x).for_each(|(e, x)| *e = e.max(x.abs()));
            jet.state_in_two(1.0, x, low);
            // One coefficient that is not finite makes the sum not finite.
            if x.iter().any(|v| !v.is_finite()) {
                return Err(IntegrateError::NotFinite { t: clock.time(at).value() });
            }
            count += 1;
            if visit(&Step { start: at, jet, blur, extent, count, before, field }).is_break() {
                return Ok(());
            }
            // The test comes after the visit: a step beyond the end of a contact in the root clock is cut by its event.
            if !clock.is_progress(at, elapsed, span) {
                return Err(IntegrateError::StepTooSmall { t: clock.time(at).value(), step: elapsed });
            }
            field.carry(jet, 1.0, false, carried);
            let arrived = elapsed >= span * (1.0 - ARRIVED);
            at = if arrived { arc.bound } else { clock.advance(at, jet.time_in_two(1.0)) };
            field.restore(at, x);
            (pinned, still) = (GuardSet::none(), GuardSet::none());
        }
    }
}
