//! Arcs in closed form: no series, no search, one guard that falls alone.
//!
//! Events are decided as on any step ([`visit`](super::visit)). A leap is taken where exactly one guard falls and all others are clear of
//! zero. Steps do everything else.

use std::ops::ControlFlow;

use smallvec::SmallVec;

use super::{
    EngineError, Observer, Outcome,
    chatter::Flight,
    state::WideState,
    visit::{ArcEnd, ArcSpan, Arrival, Core},
};
use crate::{
    event::{Conditioning, Located},
    hybrid::{FULL_PRECISION, GuardId, GuardSet, Instant, JetField, JetRequest, Leap, LeapCounts, Passage, share_of},
    integrate::{Arc, EarlierSteps, Integrator, Taylor, gathered},
    poly::{FirstRoot, first_root},
};

/// Distance to the end of a leap, relative to the span of a step, below which the step ends with the leap.
const ENDED: f64 = 4.0 * f64::EPSILON;

/// Buffers and counts of the leaps of an arc.
#[derive(Default)]
pub(super) struct Leaps {
    leap: Leap,
    /// Largest size of each component on the leaps of the arc so far, `[dim]`.
    extent: Vec<f64>,
    /// Number of leaps of the arc so far.
    count: u32,
    /// Number of arcs of the run in the current mode.
    here: u64,
    /// Truncation of the leaps so far, of displacements and of velocities, as [`Jet::left_out`](crate::hybrid::Jet::left_out).
    left_out: [f64; 2],
    /// Duration of the last leap, s, if its end must agree with the start of the next step within the rounding gathered in the leap.
    last: Option<f64>,
    /// Integrator of the steps that observers see in place of a leap.
    shown: Taylor,
    end: [Vec<f64>; 2],
}

impl Leaps {
    /// Leaps from `point` up to `bound`, as far as `motion` permits. Returns the end of the arc, or `None` if steps have to continue from
    /// the new `point`. The run has made `here` arcs in the mode.
    pub fn arc(
        &mut self,
        core: &mut Core<'_>,
        (motion, here): (&dyn JetField, u64),
        point: &mut WideState,
        bound: Instant,
        arrival: Arrival,
        observer: &mut dyn Observer,
    ) -> Result<Option<ArcEnd>, EngineError> {
        (self.last, self.here) = (None, here);
        let ended = self.go(core, motion, point, bound, arrival, observer)?;
        // The next piece is no leap of this arc.
        if let Some(time) = self.last.filter(|_| matches!(ended, None | Some(ArcEnd::Bound))) {
            core.alarm.gather(|id| self.gathered(motion, id, 0, (self.count, time)));
        }
        Ok(ended)
    }

    fn go(
        &mut self,
        core: &mut Core<'_>,
        motion: &dyn JetField,
        point: &mut WideState,
        bound: Instant,
        arrival: Arrival,
        observer: &mut dyn Observer,
    ) -> Result<Option<ArcEnd>, EngineError> {
        let clock = *core.system.clock();
        (self.count, self.left_out) = (0, [0.0; 2]);
        let (truncation, mut is_again) = (core.options.truncation(), false);
        self.extent.clear();
        self.extent.resize(point.state.x.len(), 0.0);
        if arrival == Arrival::Record || !point.state.jump.still.is_empty() {
            return Ok(None);
        }
        loop {
            let WideState { state, low, carried } = &mut *point;
            let (pinned, still) = (&state.jump.pinned, &state.jump.still);
            let (at, span) = (state.at, clock.between(state.at, bound));
            let left_out = self.left_out;
            let tolerance = if is_again { FULL_PRECISION } else { share_of(truncation, self.count + 1) };
            let request = JetRequest { at, x: &state.x, low, pinned, still, carried, span, tolerance, left_out };
            let shown = observer.wants_steps(&state.jump.mode, at);
            let by_series = self.count > 0 && self.leap.is_series;
            let made = LeapCounts { leaps: self.count, arcs: core.counters.arcs, here: self.here, by_series };
            if clock.is_no_time(at, span) || !motion.leap(&request, made, shown, &mut self.leap) {
                return Ok(None);
            }
            let falls_exactly = self.leap.passage.is_some_and(|passage| core.falls_exactly(passage.guard));
            if falls_exactly && self.leap.is_series && tolerance > FULL_PRECISION {
                is_again = true;
                continue;
            }
            let end = if self.leap.is_bound { bound } else { clock.advance(at, self.leap.time) };
            // Steps that an observer begins to look at are those of the series themselves.
            if self.leap.is_series && !shown && observer.wants_steps(&state.jump.mode, end) {
                return Ok(None);
            }
            // Unlike `max`, this comparison exists as a vector instruction.
            self.extent.iter_mut().zip(&self.leap.sizes).for_each(|(e, size)| *e = if *size > *e { *size } else { *e });
            let event = self.leap.passage.map(|passage| {
                let now = (self.count + 1, self.leap.time);
                let gathered = self.gathered(motion, passage.guard, passage.zeros, now);
                (passage, gathered, located(&passage, &self.leap, gathered))
            });
            // An event that cannot be distinguished from a switch waits for it. A leap of zero duration is none.
            let waits = |located: &Located| span - self.leap.time <= located.conditioning.time;
            let is_late = arrival == Arrival::Switch && event.as_ref().is_some_and(|(.., located)| waits(located));
            if is_late || !clock.is_progress(at, self.leap.time, span) {
                return Ok(None);
            }
            core.count_step(at)?;
            core.locator.splits += self.leap.splits;
            core.counters.arcs += u64::from(self.count == 0);
            let gathered = |id| self.last.map_or(0.0, |time| self.gathered(motion, id, 0, (self.count, time)));
            core.alarm.start_leap(core.system, at, &self.leap, self.count == 0, gathered)?;
            if self.count == 0 {
                match core.pass(ArcSpan { state, bound, arrival }, observer) {
                    Ok(true) => {
                        if let Some(end) = self.rests(core, at, span) {
                            return Ok(Some(end));
                        }
                    }
                    Ok(false) => {}
                    Err(outcome) => return Ok(Some(ArcEnd::Stop(outcome))),
                }
            }
            let mut breaks = false;
            // The record shown there may have made the observer watch steps from now on.
            if observer.wants_steps(&point.state.jump.mode, end) {
                if let Some(end) = self.show(core, motion, point, end, observer)? {
                    return Ok(Some(end));
                }
            } else {
                breaks = observer.leap(&point.state.jump.mode, self.leap.time).is_break();
            }
            let mode = &point.state.jump.mode;
            let ended = match event {
                Some((passage, gathered, located)) => {
                    core.alarm.event_leap(core.system, mode, &passage, gathered, (end, &self.leap.x))?;
                    Some(ArcEnd::Event(located))
                }
                None => {
                    core.alarm.end_leap(mode, &self.leap);
                    let counts = !self.leap.is_series || self.leap.is_bound && arrival != Arrival::Switch;
                    self.last = Some(self.leap.time).filter(|_| counts);
                    self.leap.is_bound.then_some(ArcEnd::Bound)
                }
            };
            self.count += 1;
            self.left_out =
                if self.leap.is_series { self.leap.jet.left_out } else { drifted(left_out, self.leap.time) };
            let WideState { state, carried, .. } = &mut *point;
            state.at = end;
            std::mem::swap(&mut state.x, &mut self.leap.x);
            std::mem::swap(carried, &mut self.leap.carried);
            state.jump.pinned = GuardSet::default();
            if breaks {
                return Ok(Some(ArcEnd::Stop(Outcome::StoppedByObserver)));
            }
            if ended.is_some() {
                return Ok(ended);
            }
        }
    }

    /// Returns the rounding gathered by guard `id` at the end of leap number `count` of the arc, of duration `time`, s. The first `zeros`
    /// derivatives of the guard are exactly zero at the start.
    fn gathered(&self, motion: &dyn JetField, id: GuardId, zeros: usize, (count, time): (u32, f64)) -> f64 {
        // If no derivative counts, the error of the first leap is complete.
        if count == 1 && zeros > 2 {
            return 0.0;
        }
        gathered(motion.term_sizes(id, &self.leap.jet, &self.extent), count, time, zeros)
    }

    /// Returns the end of an impact sequence, if it comes within `span` seconds.
    fn rests(&self, core: &mut Core<'_>, start: Instant, span: f64) -> Option<ArcEnd> {
        let starts = &self.leap.starts;
        let guards: SmallVec<[GuardId; 8]> = starts.iter().map(|known| known.guard).collect();
        let flight = Flight {
            start,
            guards: &guards,
            derivatives: &|i| Some(starts[i].derivatives),
            rounding: &|i| starts[i].error,
            is_estimate: false,
        };
        core.rests(&flight, span)
    }

    /// Returns the data of the leaps of the last arc, for the steps that continue it.
    pub fn before(&self) -> EarlierSteps<'_> {
        let (steps, left_out) = (self.count, self.left_out);
        if steps == 0 { EarlierSteps::default() } else { EarlierSteps { steps, extent: &self.extent, left_out } }
    }

    /// Passes the motion up to `end` to the observer as steps.
    fn show(
        &mut self,
        core: &mut Core<'_>,
        motion: &dyn JetField,
        point: &mut WideState,
        end: Instant,
        observer: &mut dyn Observer,
    ) -> Result<Option<ArcEnd>, EngineError> {
        let WideState { state, low, carried } = point;
        let (jump, clock) = (&state.jump, *core.system.clock());
        // The clock of a contact stops at the end of the contact, and no step arrives there: steps run past the event, and are cut.
        let falls = self.leap.passage.map(|passage| passage.guard);
        let bound = if falls.is_some() { clock.advance(state.at, 2.0 * self.leap.time) } else { end };
        let arc = Arc {
            mode: &jump.mode,
            motion: Some(motion),
            at: state.at,
            x: &state.x,
            low: &[],
            carried,
            pinned: &jump.pinned,
            still: &jump.still,
            bound,
            tolerance: FULL_PRECISION,
            before: EarlierSteps::default(),
        };
        let [x, rest] = &mut self.end;
        x.clone_from(&state.x);
        rest.clone_from(low);
        let mut stopped = None;
        let shown = self.shown.integrate_arc(core.system, &arc, x, rest, &mut |step| {
            let left = clock.between(step.start(), end);
            let release = || {
                let row = step.guards().iter().position(|guard| Some(*guard) == falls)?;
                if let FirstRoot::At(until) = first_root(step.guard(row), 1.0, 0.0).root { Some(until) } else { None }
            };
            let until =
                step.plain_span().map_or_else(release, |h| (left <= h * (1.0 + ENDED)).then_some((left / h).min(1.0)));
            if observer.step(&jump.mode, step, until.unwrap_or(1.0)).is_continue() {
                return if until.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            }
            let until = until.unwrap_or(1.0);
            stopped = Some(core.system.clock().advance(step.start(), step.time(until)));
            step.state(until, &mut self.leap.x);
            ControlFlow::Break(())
        });
        shown.map_err(|source| EngineError::Integrate { mode: core.system.mode_in_words(&jump.mode), source })?;
        let Some(at) = stopped else { return Ok(None) };
        state.at = at;
        std::mem::swap(&mut state.x, &mut self.leap.x);
        carried.clear();
        (state.jump.pinned, state.jump.still) = Default::default();
        Ok(Some(ArcEnd::Stop(Outcome::StoppedByObserver)))
    }
}

/// Returns the truncation `time` seconds later: an error of velocity grows into an error of displacement.
fn drifted([moved, speed]: [f64; 2], time: f64) -> [f64; 2] {
    [moved + speed * time, speed]
}

/// Returns the event at the end of `leap`.
fn located(passage: &Passage, leap: &Leap, gathered: f64) -> Located {
    let error = passage.error + gathered;
    let mut guard = leap.twins.clone();
    // As for a step, the uncertainty is at most the whole leap.
    let most = if leap.is_series { leap.jet.time_at(1.0) } else { f64::INFINITY };
    let width = (error / passage.slope.abs()).min((2.0 * error / passage.curvature).sqrt());
    guard.insert(passage.guard);
    let conditioning = Conditioning {
        residual: passage.residual,
        slope: passage.slope,
        time: f64::EPSILON * leap.time + width.min(most),
        estimated: false,
    };
    Located { theta: 1.0, fired: guard.clone(), zero: guard, near: GuardSet::default(), conditioning }
}
