//! Location of the first event on a dense step.

use super::Conditioning;
use crate::{
    hybrid::{GuardId, GuardSet},
    integrate::DenseStep,
    poly::{self, Deflated, FirstRoot},
};

/// First event on a step.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Located {
    /// Place of the event, in the clock θ of the step.
    pub theta: f64,
    /// All guards that fire at the event.
    pub fired: GuardSet,
    /// Fired guards that are zero at the event. They fell through zero; guards outside from the start of an arc are not among them.
    pub zero: GuardSet,
    /// Guards that do not fire, but are zero within their error at the event.
    pub near: GuardSet,
    /// Residual, slope and uncertainty of the event.
    pub conditioning: Conditioning,
}

/// Finder of first events, with counters only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Locator {
    /// Number of subdivisions where the coefficients alone did not decide.
    pub splits: u64,
}

/// Returns the lowest point of `p` near a touch at `x`, by Newton's method for the slope. `None` if it is not in `(0, end]`: the step
/// before or after has it, or there is none.
fn lowest(p: &[f64], x: f64, end: f64) -> Option<f64> {
    let lowest = (0..NEWTON).try_fold(x, |x, _| {
        let [_, slope, curvature] = poly::eval_with_derivatives(p, x);
        (slope == 0.0 || curvature > 0.0).then(|| if slope == 0.0 { x } else { x - slope / curvature })
    })?;
    (lowest > 0.0 && lowest <= end).then_some(lowest)
}

/// A guard that comes within its error of zero without crossing.
#[non_exhaustive]
pub struct Touch {
    /// Place of the lowest value, in θ.
    pub theta: f64,
    /// Guard.
    pub guard: GuardId,
    /// Residual, slope and uncertainty of the touch.
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

/// Number of iterations to a lowest point from within the uncertainty of zero: two suffice, more serve touches of high order.
const NEWTON: usize = 8;

/// Resolution of the value of a guard by a state, relative to the rounding that the value may have gathered.
const RESOLVED: f64 = 1.0 / 32.0;

/// Returns guard `i` of a step, deflated.
fn deflated(step: &dyn DenseStep, i: usize) -> Deflated<'_> {
    let (tail, rounding) = step.guard_error(i);
    Deflated::new(step.guard(i), tail, rounding)
}

/// Rate of a root clock, relative to its mean over the step, below which the clock stands still to the accuracy of a touch. It is above the
/// root of the relative error of a guard, 1e-12 at worst.
const STANDSTILL: f64 = 1e-3;

/// Returns whether the clock of the step stands still at `theta`, relative to its mean rate up to `end`.
fn stands_still(step: &dyn DenseStep, theta: f64, end: f64) -> bool {
    step.plain_span().is_none() && step.rate(theta) * end <= STANDSTILL * step.time(end)
}

/// Returns whether a touch of guard `i` at `theta` is tangential in time. In a root clock, another contact that ends with the contact of
/// the clock touches zero at full speed, where time stands still: this is an end, not a graze.
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
    /// Returns the first event on the step, and the first touch before it, if any.
    ///
    /// `starts` marks the first step of an arc: a row that stays within twice its error up to the touch has just left its flank, and is no
    /// graze. `closed_end` includes an event exactly at the end of the step (the end of a run).
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
                // Truncation on request makes a dip uncertain, but not a touch.
                let dip = poly::first_root(series.p, limit, series.error - step.left_out(i));
                found = if dip.touch.is_none() && dip.root != FirstRoot::None { dip } else { found };
            }
            // A row that starts at an exact zero may be clear of it and still be near it.
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

    /// Returns the event of all guards that fire at `theta` together with guard `lead`, chosen from `doubtful`.
    fn batch(&self, step: &dyn DenseStep, starts: bool, theta: f64, lead: usize, doubtful: GuardSet) -> Located {
        let series = deflated(step, lead);
        let [value, deflated_slope, curvature] = poly::eval_with_derivatives(series.p, theta);
        let (residual, slope) = match series.order as i32 {
            0 => (value, deflated_slope),
            m => (value * theta.powi(m), theta.powi(m - 1) * (f64::from(m) * value + theta * deflated_slope)),
        };
        let (curvature, own_error) = (curvature.abs(), series.error_at(theta));
        // The width is to first order the error over the slope; where the slope vanishes, the curvature replaces it.
        let width = |gathered: f64| {
            let error = own_error + gathered / theta.powi(series.order as i32);
            // A guard fires at once if it leaves an exact zero at the start, or if a switch or an impact has taken it outside.
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
                // The start of an arc: the guard is outside already, or on the surface and going out.
                poly::first_root(series.p, 1.0, series.error).root == FirstRoot::At(0.0)
            } else {
                let (value, slope) = poly::eval_with_slope(series.p, theta);
                // A slow lead has an uncertain time: the other guard must also be within the rounding of its value from the state.
                let falls = slope < 0.0 && value <= series.error + (slope.abs() * reach).min(step.guard_rounding(i));
                // Where a root clock stands still, slopes have no meaning, and only the end of a contact can be at zero.
                falls || standstill && value.abs() <= series.error
            };
            if fires {
                fired.insert(*guard);
                // At the start of a later step, the guard fell through zero in between.
                if theta > 0.0 || series.order > 0 || !starts {
                    zero.insert(*guard);
                }
            } else {
                // After an exact zero a value may be known better than the state holds it. The guard is then near if it moves that little
                // while the lead passes.
                let held = (RESOLVED * step.guard_rounding(i)).min(f64::EPSILON * slope.abs());
                if series.value(theta).abs() <= held.max(series.error * theta.powi(series.order as i32)) {
                    near.insert(*guard);
                }
            }
        }
        // Convert to time and to the units of the guard; at the end of a contact a root clock stands still.
        let rate = step.rate(theta).abs();
        let gathered = step.gathered(lead, theta, series.order);
        // The place of the root is rounded to a double.
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
