//! When the first guard fires on a dense step.

use smallvec::SmallVec;

use super::Conditioning;
use crate::{
    hybrid::{GuardId, GuardSet},
    integrate::DenseStep,
    poly::{self, Deflated, Dip, FirstRoot},
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
    /// How far beyond zero one that fires may be: the depth up to which it could have been a touch.
    pub depth: f64,
    /// How well it is determined.
    pub conditioning: Conditioning,
}

/// The lowest point of `p` near `x`: Newton's method for the slope.
fn lowest(p: &[f64], x: f64) -> Option<f64> {
    (0..NEWTON).try_fold(x, |x, _| {
        let [_, slope, curvature] = poly::eval_with_derivatives(p, x);
        (slope == 0.0 || curvature > 0.0).then(|| if slope == 0.0 { x } else { x - slope / curvature })
    })
}

/// Tells if `p`, at most about zero at the end of its step, falls on below `-depth` right after it.
fn falls_on(p: &[f64], depth: f64) -> bool {
    poly::eval_with_slope(p, 1.0).1 < 0.0 && poly::eval(p, 1.0 + BEYOND) < -LOOSER * depth
}

/// A dip that goes on from step to step: a stretch in which a guard cannot be told from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stage {
    /// It is on record, or it began with the arc.
    is_known: bool,
    /// Its length so far, s.
    length: f64,
}

/// A guard that may come near zero on a step.
struct Near {
    guard: usize,
    stage: Option<Stage>,
    /// Its dips, the last of which may be a crossing.
    dips: SmallVec<[Dip; 2]>,
}

impl Near {
    fn crossing(&self) -> Option<f64> {
        self.dips.last().and_then(|dip| dip.root)
    }
}

/// Finds first events. Holds the dips that go on from one step to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Locator {
    /// Subdivisions spent where the coefficients alone did not decide.
    pub splits: u64,
    /// Steps since the last jump, whatever arcs they are of: they gather rounding.
    steps: u32,
    dips: SmallVec<[(GuardId, Stage); 2]>,
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
    fn new(step: &dyn DenseStep, i: usize, theta: f64, width: f64) -> Self {
        let rate = step.rate(theta).abs();
        let [residual, slope, _] = poly::eval_with_derivatives(step.guard(i), theta);
        let conditioning = Conditioning {
            residual,
            slope: if rate > 0.0 { slope / rate } else { 0.0 },
            time: f64::EPSILON * step.time(theta) + width.min(1.0) * rate,
            estimated: step.is_estimate(),
        };
        Self { theta, guard: step.guards()[i], conditioning }
    }

    /// In a dip: at its lowest point on the step. The touch may be anywhere in it, also in the `length` before the step, s.
    fn of(step: &dyn DenseStep, i: usize, [from, to]: [f64; 2], length: f64) -> Self {
        let middle = 0.5 * (from + to);
        let theta = lowest(step.guard(i), middle).filter(|x| (from..=to).contains(x)).unwrap_or(middle);
        let mut touch = Self::new(step, i, theta, (theta - from).max(to - theta));
        touch.conditioning.time += length;
        touch
    }

    /// Where a step in a root clock is not to be told from zero.
    fn at(step: &dyn DenseStep, i: usize, theta: f64) -> Self {
        let (tail, rounding) = step.guard_error(i);
        let curvature = poly::eval_with_derivatives(step.guard(i), theta)[2];
        Self::new(step, i, theta, (2.0 * (tail + rounding) / curvature.abs()).sqrt())
    }
}

/// Iterations that find a lowest point from within the uncertainty of zero: two suffice, more serve touches of high order.
const NEWTON: usize = 8;

/// Times its uncertainty that a dip has to be deep to be a crossing. Both an exact touch and the bound are known to less than that.
const DEPTH: f64 = 8.0;

/// A guard that stays above this share of where it starts is clear of what rounding gathers in an arc.
const CLEAR: f64 = 1e-4;

/// How far beyond a step its series tells where a guard goes, and how much more it leaves out there: `(17/16)²⁵` and rounding.
const BEYOND: f64 = 1.0 / 16.0;
const LOOSER: f64 = 5.0;

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
    /// Tells if a guard is in a dip that is neither on record nor over: the next step has to decide.
    #[must_use]
    pub fn is_pending(&self) -> bool {
        self.dips.iter().any(|(_, stage)| !stage.is_known)
    }

    /// A jump makes another motion.
    pub fn jumped(&mut self) {
        self.steps = 0;
    }

    /// A leap has been made: all guards are clear of zero.
    pub fn leapt(&mut self) {
        self.steps += 1;
        self.dips.clear();
    }

    /// The first event on the step, and the touches before it, in order.
    ///
    /// `starts` says that the step is the first of its arc: a guard in a dip there has just left its flank, or the dip is on record.
    /// `closed_end` makes an event exactly at the end of the step belong to it (the end of a run). `carried` gives the largest rounding that
    /// a guard has had in the run: it counts where an arc goes on that a known time has cut.
    pub fn first(
        &mut self,
        step: &dyn DenseStep,
        (starts, closed_end): (bool, bool),
        carried: &dyn Fn(GuardId) -> f64,
    ) -> (Option<Located>, SmallVec<[Touch; 1]>) {
        self.steps += 1;
        if starts && !self.dips.is_empty() {
            self.dips.retain(|(guard, _)| step.guards().contains(guard));
        }
        let is_plain = step.plain_span().is_some();
        let (mut first, mut near): (Option<(f64, usize)>, SmallVec<[Near; 1]>) = Default::default();
        let mut touches: SmallVec<[Touch; 1]> = SmallVec::new();
        // Rows that are not clearly positive.
        let mut doubtful = GuardSet::default();
        let (mut limit, mut lead) = (1.0, None::<Deflated<'_>>);
        for (i, guard) in step.guards().iter().enumerate() {
            let series = deflated(step, i);
            if lead.as_ref().is_some_and(|lead| lead.is_twin(&series)) {
                doubtful.insert(*guard);
                continue;
            }
            let stage = self.dips.iter().find(|(id, _)| id == guard).map(|(_, stage)| *stage);
            // A row that starts at an exact zero may be clear of it and near it all the same.
            let is_clear = stage.is_none() && poly::is_above(series.p, series.error + CLEAR * series.p[0].abs());
            if !is_clear || series.order > 0 {
                doubtful.insert(*guard);
            }
            if is_clear {
                continue;
            }
            let root = if is_plain {
                match self.near(step, (i, &series), stage, (starts, closed_end), (limit, carried)) {
                    Ok(found) => {
                        let crossing = found.crossing();
                        near.push(found);
                        crossing
                    }
                    Err(fall) => Some(fall),
                }
            } else {
                self.in_root_clock(step, (i, &series), (starts, closed_end), (limit, first), &mut touches)
            };
            if let Some(theta) = root
                && first.is_none_or(|(t, _)| theta < t)
            {
                first = Some((theta, i));
                limit = theta;
                lead = Some(series);
            }
        }
        let located = first.map(|(theta, lead)| self.batch(step, starts, theta, lead, (doubtful, &near)));
        let end = first.map_or(1.0, |(theta, _)| theta);
        touches.retain(|touch| touch.theta < end);
        for near in near {
            let fires = located.as_ref().is_some_and(|located| located.fired.contains(step.guards()[near.guard]));
            self.pass(step, &near, (end, fires, closed_end && first.is_none()), &mut touches);
        }
        touches.sort_unstable_by(|a, b| a.theta.total_cmp(&b.theta));
        (located, touches)
    }

    /// The dips of guard `i` on a step in plain time, or else the only zero that it has before `limit`.
    fn near(
        &mut self,
        step: &dyn DenseStep,
        (i, series): (usize, &Deflated<'_>),
        stage: Option<Stage>,
        (starts, closed_end): (bool, bool),
        (limit, carried): (f64, &dyn Fn(GuardId) -> f64),
    ) -> Result<Near, f64> {
        let (all, here) = (f64::from(self.steps), f64::from(step.before().steps + 1));
        let before = if all > here { all.sqrt() * carried(step.guards()[i]) } else { 0.0 };
        let cut = (all / here).max(1.0).sqrt();
        // What an arc has gathered counts where no zero at its start is exact. What is left out on request makes a dip uncertain, and does
        // not make it a touch.
        let bounds = |theta: f64| {
            let gathered = if series.order == 0 { before.max(cut * step.gathered(i, theta, 0)) } else { 0.0 };
            let margin = series.error + gathered;
            [margin, DEPTH * (margin - step.left_out(i))]
        };
        let [margin, depth] = bounds(1.0);
        if stage.is_none() {
            match poly::fall_or_clear(series.p, limit, margin.max(depth)) {
                Some(Some(fall)) => return Err(fall),
                Some(None) => return Ok(Near { guard: i, stage, dips: SmallVec::new() }),
                None => {}
            }
        }
        self.splits += 1;
        let begins = stage.is_some() || series.p[0] <= bounds(0.0)[0];
        // A guard that rises has left its flank, or its dip is on record.
        let rises = series.order > 0 || series.p.get(1).is_some_and(|slope| *slope >= 0.0);
        let stage = stage.or(begins.then_some(Stage { is_known: starts || rises, length: 0.0 }));
        let mut dips = poly::dips(series.p, bounds, begins);
        let Some(dip) = dips.last_mut() else { return Ok(Near { guard: i, stage, dips }) };
        // At the end of a step the series goes on: it tells a crossing from a touch. A run that ends there has no other way to know.
        if dip.is_open && dip.root.is_none() {
            let end = poly::eval(series.p, 1.0);
            if (end < 0.0 || closed_end) && falls_on(series.p, depth) {
                dip.root = Some(if end < 0.0 { poly::last_fall(series.p, dip.from, 1.0) } else { 1.0 });
            }
        }
        // The same bits as where a leap finds it.
        if let (Some(root), FirstRoot::At(x)) = (&mut dip.root, poly::first_root(series.p, limit, series.error).root)
            && (dip.from..=dip.to).contains(&x)
        {
            *root = x;
        }
        Ok(Near { guard: i, stage, dips })
    }

    /// The stage of a guard at the end of a step, or at the event at `end` before; its touches up to there.
    fn pass(
        &mut self,
        step: &dyn DenseStep,
        near: &Near,
        (end, fires, is_last): (f64, bool, bool),
        touches: &mut SmallVec<[Touch; 1]>,
    ) {
        let (i, guard) = (near.guard, step.guards()[near.guard]);
        self.dips.retain(|(id, _)| *id != guard);
        for (number, dip) in near.dips.iter().enumerate().filter(|(_, dip)| dip.from <= end) {
            let begun = near.stage.filter(|_| number == 0);
            let Stage { is_known, length } = begun.unwrap_or(Stage { is_known: false, length: 0.0 });
            let goes_on = dip.is_open || dip.to >= end;
            if goes_on && fires {
                continue;
            }
            let is_touch = !is_known && (!goes_on || is_last);
            if is_touch {
                touches.push(Touch::of(step, i, [dip.from, dip.to.min(end)], length));
            }
            if goes_on {
                let length = length + step.time(end) - step.time(dip.from);
                self.dips.push((guard, Stage { is_known: is_known || is_touch, length }));
            }
        }
    }

    /// The first zero of guard `i` on a step in a root clock, where a contact ends together with the clock, and time stands still.
    fn in_root_clock(
        &mut self,
        step: &dyn DenseStep,
        (i, series): (usize, &Deflated<'_>),
        (starts, closed_end): (bool, bool),
        (limit, first): (f64, Option<(f64, usize)>),
        touches: &mut SmallVec<[Touch; 1]>,
    ) -> Option<f64> {
        let mut found = poly::first_root(series.p, limit, series.error);
        self.splits += u64::from(found.splits);
        if found.touch.is_some() && step.left_out(i) > 0.0 {
            let dip = poly::first_root(series.p, limit, series.error - step.left_out(i));
            found = if dip.touch.is_none() && dip.root != FirstRoot::None { dip } else { found };
        }
        self.dips.retain(|(id, _)| *id != step.guards()[i]);
        if let Some(theta) = found.touch
            && !(starts && series.largest(theta) <= 2.0 * series.error)
            && let Some(lowest) = lowest(step.guard(i), theta).filter(|x| *x > 0.0 && *x <= limit)
            && is_tangent(step, i, lowest, limit)
        {
            touches.push(Touch::at(step, i, lowest));
        }
        if let FirstRoot::At(theta) = found.root {
            return Some(theta);
        }
        let (value, slope) = poly::eval_with_slope(series.p, 1.0);
        let ends = closed_end && first.is_none() && value <= series.error - step.left_out(i) && slope < 0.0;
        ends.then_some(1.0)
    }

    /// All guards that fire at `theta` together with guard `lead`: some of `doubtful`.
    fn batch(
        &self,
        step: &dyn DenseStep,
        starts: bool,
        theta: f64,
        lead: usize,
        (doubtful, all): (GuardSet, &[Near]),
    ) -> Located {
        let series = deflated(step, lead);
        let [value, deflated_slope, curvature] = poly::eval_with_derivatives(series.p, theta);
        let (residual, slope) = match series.order as i32 {
            0 => (value, deflated_slope),
            m => (value * theta.powi(m), theta.powi(m - 1) * (f64::from(m) * value + theta * deflated_slope)),
        };
        let (curvature, own_error) = (curvature.abs(), series.error_at(theta));
        // To first order the error over the slope; where the slope vanishes, the curvature takes over.
        let width = |gathered: f64| {
            // A guard that is exactly zero at the start and leaves does so at once: no uncertainty.
            if theta == 0.0 && series.order > 0 {
                return 0.0;
            }
            let error = own_error + gathered / theta.powi(series.order as i32);
            (error / deflated_slope.abs()).min((2.0 * error / curvature).sqrt()).min(1.0)
        };
        let reach = if theta == 0.0 { 0.0 } else { width(0.0) };
        let standstill = stands_still(step, theta, theta);
        let (mut fired, mut zero, mut near) = (GuardSet::default(), GuardSet::default(), GuardSet::default());
        let mut depth = 0.0_f64;
        for (i, guard) in step.guards().iter().enumerate().filter(|(_, guard)| doubtful.contains(**guard)) {
            let (tail, rounding) = step.guard_error(i);
            let series = Deflated::new(step.guard(i), tail - step.left_out(i), rounding);
            let dips = all.iter().find(|near| near.guard == i);
            let fires = if i == lead {
                true
            } else if dips.is_some_and(|near| near.crossing().is_none()) {
                // It comes back.
                false
            } else if theta == 0.0 {
                // At the start of an arc: outside already, or on the surface and going out.
                dips.is_some_and(|near| near.crossing() == Some(0.0))
                    || dips.is_none() && poly::first_root(series.p, 1.0, series.error).root == FirstRoot::At(0.0)
            } else {
                let (value, slope) = poly::eval_with_slope(series.p, theta);
                // Where the lead comes slowly its time says little: the other must be within the rounding of its own state too.
                let falls = slope < 0.0 && value <= series.error + (slope.abs() * reach).min(step.guard_rounding(i));
                // Where a root clock stands still slopes mean nothing, and nothing but an end can be at zero.
                falls || standstill && value.abs() <= series.error
            };
            if fires {
                if dips.is_some() {
                    depth = depth.max(-series.value(theta));
                }
                fired.insert(*guard);
                // At the start of a later step it fell through zero in between.
                // One that was in a dip before may be further outside than rounding explains.
                let is_zero = dips.is_none() || -series.value(theta) <= series.error;
                if theta > 0.0 || series.order > 0 || !starts && is_zero {
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
        Located { theta, fired, zero, near, depth, conditioning }
    }
}
