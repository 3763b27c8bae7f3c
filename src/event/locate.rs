//! When the first guard fires on a dense step.

use super::Conditioning;
use crate::{
    hybrid::{GuardId, GuardSet},
    integrate::DenseStep,
    poly::{self, Deflated, FirstRoot},
};

/// The first event on a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Where, in the step's clock.
    pub theta: f64,
    /// All guards that fire there.
    pub fired: GuardSet,
    /// Those of them that are zero there: all that fell through zero, but none that is outside from the start of an arc on.
    pub zero: GuardSet,
    /// Those that do not fire, but cannot be told from zero there.
    pub near: GuardSet,
    /// How well it is determined.
    pub conditioning: Conditioning,
}

/// Finds first events. Holds only counters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Locator {
    /// Subdivisions spent where the coefficients alone did not decide.
    pub splits: u64,
}

/// The lowest point of `p` near a touch at `x`: Newton's method for the slope. `None` if it is not in `(0, end]`: the step before or
/// after has it, or there is none.
fn lowest(p: &[f64], x: f64, end: f64) -> Option<f64> {
    let lowest = (0..NEWTON).try_fold(x, |x, _| {
        let [_, slope, curvature] = poly::eval_with_derivatives(p, x);
        (slope == 0.0 || curvature > 0.0).then(|| if slope == 0.0 { x } else { x - slope / curvature })
    })?;
    (lowest > 0.0 && lowest <= end).then_some(lowest)
}

/// A guard that comes within its error of zero, and does not cross.
pub struct Touch {
    /// Where it is lowest, in θ.
    pub theta: f64,
    /// Which.
    pub guard: GuardId,
    /// How well its time is known.
    pub conditioning: Conditioning,
}

impl Touch {
    fn new(step: &dyn DenseStep, i: usize, theta: f64) -> Self {
        let ((tail, rounding), rate) = (step.guard_error(i), step.rate(theta).abs());
        let [residual, slope, curvature] = poly::eval_with_derivatives(step.guard(i), theta);
        let width = (2.0 * (tail + rounding) / curvature.abs()).sqrt().min(1.0);
        let conditioning = Conditioning {
            residual,
            slope: if rate > 0.0 { slope / rate } else { 0.0 },
            time: f64::EPSILON * step.time(theta) + width * rate,
            estimated: step.is_estimate(),
        };
        Self { theta, guard: step.guards()[i], conditioning }
    }
}

/// Iterations that find a lowest point from within the uncertainty of zero: two suffice, more serve touches of high order.
const NEWTON: usize = 8;

/// What a state resolves of a guard's value, relative to the rounding that the value may have gathered.
const RESOLVED: f64 = 1.0 / 32.0;

/// Guard `i` of a step.
fn deflated(step: &dyn DenseStep, i: usize) -> Deflated<'_> {
    let (tail, rounding) = step.guard_error(i);
    Deflated::new(step.guard(i), tail, rounding)
}

/// A root clock this much slower than its mean over the step stands still, to the accuracy of a touch: the root of
/// the relative error of a guard, 1e-12 at worst, and some.
const STANDSTILL: f64 = 1e-3;

/// Whether the step's clock stands still at `theta`, against its mean rate up to `end`.
fn stands_still(step: &dyn DenseStep, theta: f64, end: f64) -> bool {
    step.plain_span().is_none() && step.rate(theta) * end <= STANDSTILL * step.time(end)
}

/// Whether a touch of guard `i` at `theta` is tangential in time. In a root clock a contact that ends together with
/// the clock's owner touches zero at full speed, where time stands still: that is its end, not a graze.
fn is_tangent(step: &dyn DenseStep, i: usize, theta: f64, end: f64) -> bool {
    match step.guard_in_time(i, theta) {
        Some((slope, _)) => {
            let fastest = [0.0, 0.5 * end, end].map(|t| step.guard_in_time(i, t).map_or(0.0, |(s, _)| s.abs()));
            slope.abs() <= STANDSTILL * fastest.into_iter().fold(0.0, f64::max)
        }
        None => !stands_still(step, theta, end),
    }
}

impl Locator {
    /// The first event on the step, and the first touch before it, if any.
    ///
    /// `starts` says that the step is the first of its arc: a row that stays within twice its error up to the touch has just
    /// left its flank, and is no graze. `closed_end` makes an event exactly at the end of the step belong to it (the end of a run).
    pub fn first(&mut self, step: &dyn DenseStep, starts: bool, closed_end: bool) -> (Option<Located>, Option<Touch>) {
        let mut first: Option<(f64, usize)> = None;
        let mut touch: Option<(f64, usize)> = None;
        // Rows that are not clearly positive.
        let mut doubtful = GuardSet::default();
        let (mut limit, mut lead) = (1.0, None::<Deflated<'_>>);
        for i in 0..step.guards().len() {
            let series = deflated(step, i);
            if lead.as_ref().is_some_and(|lead| lead.is_twin(&series)) {
                doubtful.insert(step.guards()[i]);
                continue;
            }
            let mut found = poly::first_root(series.p, limit, series.error);
            self.splits += u64::from(found.splits);
            if found.touch.is_some() && step.left_out(i) > 0.0 {
                // What is left out on request makes a dip uncertain, and does not make it a touch.
                let dip = poly::first_root(series.p, limit, series.error - step.left_out(i));
                found = if dip.touch.is_none() && dip.root != FirstRoot::None { dip } else { found };
            }
            // A row that starts at an exact zero may be clear of it and near it all the same.
            if !found.is_clear || series.order > 0 {
                doubtful.insert(step.guards()[i]);
            }
            if found.is_clear {
                continue;
            }
            if let FirstRoot::At(theta) = found.root {
                if first.is_none_or(|(t, _)| theta < t) {
                    first = Some((theta, i));
                    limit = theta;
                    lead = Some(series);
                }
            } else if closed_end && first.is_none() {
                let (value, slope) = poly::eval_with_slope(series.p, 1.0);
                if value <= series.error - step.left_out(i) && slope < 0.0 {
                    first = Some((1.0, i));
                }
            }
            if let Some(theta) = found.touch
                && touch.is_none_or(|(t, _)| theta < t)
                && !(starts && series.largest(theta) <= 2.0 * series.error)
            {
                touch = Some((theta, i));
            }
        }
        let end = first.map_or(1.0, |(theta, _)| theta);
        let touch = touch.filter(|(t, i)| *t < end && is_tangent(step, *i, *t, end));
        let touch = touch.and_then(|(t, i)| Some(Touch::new(step, i, lowest(step.guard(i), t, end)?)));
        (first.map(|(theta, lead)| self.batch(step, starts, theta, lead, doubtful)), touch)
    }

    /// All guards that fire at `theta` together with guard `lead`: some of `doubtful`.
    fn batch(&self, step: &dyn DenseStep, starts: bool, theta: f64, lead: usize, doubtful: GuardSet) -> Located {
        let series = deflated(step, lead);
        let [value, deflated_slope, curvature] = poly::eval_with_derivatives(series.p, theta);
        let (residual, slope) = match series.order as i32 {
            0 => (value, deflated_slope),
            m => (value * theta.powi(m), theta.powi(m - 1) * (f64::from(m) * value + theta * deflated_slope)),
        };
        let (curvature, own_error) = (curvature.abs(), series.error_at(theta));
        // To first order the error over the slope; where the slope vanishes, the curvature takes over.
        let width = |gathered: f64| {
            let error = own_error + gathered / theta.powi(series.order as i32);
            // A guard that is exactly zero at the start and leaves, or that a switch or an impact has taken outside, fires at once.
            if theta == 0.0 && (series.order > 0 || value < -error) {
                return 0.0;
            }
            (error / deflated_slope.abs()).min((2.0 * error / curvature).sqrt()).min(1.0)
        };
        let reach = if theta == 0.0 { 0.0 } else { width(0.0) };
        let standstill = stands_still(step, theta, theta);
        let (mut fired, mut zero, mut near) = (GuardSet::default(), GuardSet::default(), GuardSet::default());
        for (i, guard) in step.guards().iter().enumerate().filter(|(_, guard)| doubtful.contains(**guard)) {
            let (tail, rounding) = step.guard_error(i);
            let series = Deflated::new(step.guard(i), tail - step.left_out(i), rounding);
            let fires = if i == lead {
                true
            } else if theta == 0.0 {
                // At the start of an arc: outside already, or on the surface and going out.
                poly::first_root(series.p, 1.0, series.error).root == FirstRoot::At(0.0)
            } else {
                let (value, slope) = poly::eval_with_slope(series.p, theta);
                // Where the lead comes slowly its time says little: the other must be within the rounding of its own state too.
                let falls = slope < 0.0 && value <= series.error + (slope.abs() * reach).min(step.guard_rounding(i));
                // Where a root clock stands still slopes mean nothing, and nothing but an end can be at zero.
                falls || standstill && value.abs() <= series.error
            };
            if fires {
                fired.insert(*guard);
                // At the start of a later step it fell through zero in between.
                if theta > 0.0 || series.order > 0 || !starts {
                    zero.insert(*guard);
                }
            } else {
                // From an exact zero on a value may be known better than the state can hold it. Then it is near where the lead passes it in
                // no time.
                let held = (RESOLVED * step.guard_rounding(i)).min(f64::EPSILON * slope.abs());
                if series.value(theta).abs() <= held.max(series.error * theta.powi(series.order as i32)) {
                    near.insert(*guard);
                }
            }
        }
        // All of it in time and in the guard's own units; at the end of a contact a root clock stands still.
        let rate = step.rate(theta).abs();
        let gathered = step.gathered(lead, theta, series.order);
        // The place of the root is a double.
        let place = f64::EPSILON * step.time(theta);
        let estimated = step.is_estimate();
        let conditioning = match step.guard_in_time(lead, theta) {
            Some((in_time, error)) => Conditioning {
                residual: if slope == 0.0 { 0.0 } else { residual / slope * rate * in_time },
                slope: in_time,
                time: place + if in_time == 0.0 { width(0.0) * rate } else { (error + gathered) / in_time.abs() },
                estimated,
            },
            None => Conditioning {
                residual,
                slope: if rate > 0.0 { slope / rate } else { 0.0 },
                time: place + width(gathered) * rate,
                estimated,
            },
        };
        Located { theta, fired, zero, near, conditioning }
    }
}
