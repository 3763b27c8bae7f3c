//! Everything that happens at one instant, from its first cause to its record.
//!
//! The first cause opens the instant: guards that fire, a known switching time or the sum of an impact sequence. Each cause makes a jump.
//! The first step of the motion after it decides whether guards fire at the same instant again, which is the next cause. If none does, the
//! instant is closed and recorded (`docs/EVENTS.md`, 2, 11 to 15 and 20).

use super::{
    EngineError, JumpRecord, Observer, Outcome,
    chatter::Flight,
    state::{State, WideState},
    visit::{ArcEnd, ArcSpan, Arrival, Core, SequenceSum},
};
use crate::{
    event::{Accumulation, Conditioning, EventRecord, Located},
    hybrid::{GuardSet, Instant, Mode},
    integrate::DenseStep,
};

/// Maximum number of jumps without an impulse at one instant; more are a cycle.
const MAX_CASCADE: usize = 64;
/// Maximum number of jumps with an impulse at one instant. A factor of 0.992 per round reaches [`LOST`] in as many.
const MAX_STRIKES: usize = 4096;
/// Approach speed, relative to the fastest at the same instant, below which contacts come to rest. It is the rounding of the speeds whose
/// difference is the approach speed.
const LOST: f64 = 256.0 * f64::EPSILON;

/// Factor on the error of a guard at a switch that its event waits for: twice each for the values at the switch and at the event.
const WAITING: f64 = 4.0;

/// Progress of the resolution of an instant.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    /// Guards may still fire.
    Open,
    /// The record is complete; its impacts are not yet part of a sequence.
    Closed,
    /// The motion has continued past the instant.
    Past,
}

/// The event iteration of the last instant at which something happened.
pub(super) struct EventIteration {
    stage: Stage,
    record: EventRecord,
    /// True if no observer reads the record; its modes and states may then be omitted.
    pub is_silent: bool,
    /// Modes before the jumps of the instant, one for each jump.
    cascade: Vec<Mode>,
    /// Number of jumps with an impulse.
    strikes: usize,
    /// Fastest approach speed of jumps whose guards all rebound, m/s.
    fastest: f64,
}

impl EventIteration {
    /// Opens the instant at the start of a run: all jumps there make one record.
    pub fn new(state: &State) -> Self {
        let mode = || state.jump.mode.clone();
        let (x_minus, jump) = (state.x.clone(), state.jump.clone());
        let record =
            EventRecord { at: state.at, from: mode(), to: mode(), x_minus, jump, start: true, ..Default::default() };
        let cascade = Vec::with_capacity(MAX_CASCADE);
        Self { stage: Stage::Open, record, is_silent: false, cascade, strikes: 0, fastest: 0.0 }
    }

    pub fn is_open(&self) -> bool {
        self.stage == Stage::Open
    }

    /// Returns the guards that have fired at the instant.
    pub fn fired(&self) -> &GuardSet {
        &self.record.fired
    }

    /// Opens the instant of `state`, unless an instant is open.
    fn open(&mut self, state: &State) {
        if self.is_open() {
            return;
        }
        // An arc too short for the clock leaves the instant the same: its jumps are counted on.
        if self.record.at != state.at {
            self.cascade.clear();
            (self.strikes, self.fastest) = (0, 0.0);
        }
        let record = &mut self.record;
        record.at = state.at;
        if !self.is_silent {
            record.from = state.jump.mode.clone();
            record.x_minus.clone_from(&state.x);
        }
        // All fields except those that `close` sets.
        (record.fired, record.conditioning, record.accumulation) = Default::default();
        (record.jumps, record.projected, record.switched, record.start) = Default::default();
        self.stage = Stage::Open;
    }

    /// Closes the instant with the state after it. Returns its record if anything happened.
    pub fn close(&mut self, state: &State) -> Option<&EventRecord> {
        if !self.is_open() {
            return None;
        }
        self.stage = Stage::Closed;
        let record = &mut self.record;
        // A start off all guards is no decision. The record has the exact zeros of the start until it is closed.
        if record.start && record.jump.pinned.is_empty() && record.fired.is_empty() && !record.switched {
            return None;
        }
        if !self.is_silent {
            record.to = state.jump.mode.clone();
            record.jump = state.jump.clone();
            record.x_plus.clone_from(&state.x);
        }
        Some(record)
    }
}

impl Core<'_> {
    /// Makes the jump of the guards of `located` at `point`.
    pub fn fire(
        &mut self,
        point: &mut WideState,
        located: &Located,
        observer: &mut dyn Observer,
    ) -> Result<(), EngineError> {
        let Self { system, alarm, iteration, tolerance, .. } = self;
        iteration.open(&point.state);
        let EventIteration { record, cascade, strikes, fastest, .. } = iteration;
        let WideState { state: State { at, x, jump }, low, carried } = point;
        record.fired |= &located.fired;
        if located.conditioning.time >= record.conditioning.time {
            record.conditioning = located.conditioning;
        }
        let rounds = cascade.len();
        if rounds >= MAX_CASCADE + *strikes || *strikes >= MAX_STRIKES {
            let since = cascade.iter().rposition(|mode| *mode == jump.mode).unwrap_or(0);
            let cycle = cascade[since..].iter().map(|mode| system.mode_in_words(mode)).collect();
            return Err(EngineError::Cycle { t: system.clock().time(*at).value(), rounds, cycle });
        }
        cascade.push(jump.mode.clone());
        alarm.jumped();
        // A guard known to touch carries an impulse without an impact.
        let near = &located.near - &jump.pinned;
        jump.pinned |= &located.zero;
        // Events closer together than their uncertainties are one instant: a rigid flank with e = 0 counts as touched.
        let touches = located.near.iter().filter(|id| system.restitution(*id) == Some(0.0));
        touches.for_each(|id| jump.pinned.insert(id));
        let before = observer.wants_jumps().then(|| (jump.clone(), x.clone()));
        let rebounds = |id| system.restitution(id).is_some_and(|e| e > 0.0);
        let speed = if located.fired.iter().all(rebounds) { located.conditioning.slope.abs() } else { 0.0 };
        let settles = speed > 0.0 && speed < LOST * *fastest;
        let after = if settles {
            low.fill(0.0);
            system.settle(jump, &located.fired, *at, x)
        } else {
            system.jump(jump, &located.fired, *at, x, low)
        };
        *jump = after.map_err(|source| EngineError::Model { t: system.clock().time(*at).value(), source })?;
        alarm.moved(*system, *at, &located.fired, jump.projected)?;
        if *tolerance > 0.0 && jump.projected > 0.0 {
            // The move is then more than rounding, and the carried values belong to the state before it.
            carried.clear();
        }
        if let Some((from, x_minus)) = &before {
            let (x_plus, fired) = (x.as_slice(), &located.fired);
            observer.jump(&JumpRecord { at: *at, from, to: jump, fired, x_minus, x_plus, settles });
        }
        if !jump.struck.is_empty() {
            *strikes += 1;
            *fastest = fastest.max(speed);
        }
        record.fired |= &(&near & &jump.struck);
        record.projected = record.projected.max(jump.projected);
        record.jumps += 1;
        self.next_switch = system.next_switch(&jump.mode, *at);
        Ok(())
    }

    /// Advances the schedule of the mode at a known switching time, at which `point` is.
    pub fn switch(&mut self, point: &mut WideState) {
        self.counters.switches += 1;
        self.iteration.open(&point.state);
        self.iteration.record.switched = true;
        let State { at, jump, .. } = &mut point.state;
        jump.mode = self.system.switched(&jump.mode, *at);
        self.next_switch = self.system.next_switch(&jump.mode, *at);
    }

    /// Ends an impact sequence: the contacts of `guards` come to rest. The time of the record is that of the sum, which is ahead of the
    /// state. The first step of the motion at rest confirms the sum if nothing else happens before.
    pub fn rest(
        &mut self,
        point: &mut WideState,
        guards: GuardSet,
        accumulation: Accumulation,
    ) -> Result<(), EngineError> {
        let (clock, before) = (self.system.clock(), point.clone());
        let WideState { state, low, carried } = point;
        low.fill(0.0);
        carried.clear();
        self.alarm.jumped();
        self.iteration.open(state);
        let (at, remaining) = (clock.advance(state.at, accumulation.remaining), accumulation.remaining);
        let settled = self.system.settle(&state.jump, &guards, state.at, &mut state.x);
        state.jump = settled.map_err(|source| EngineError::Model { t: clock.time(at).value(), source })?;
        let record = &mut self.iteration.record;
        (record.at, record.fired, record.accumulation, record.jumps) = (at, guards.clone(), Some(accumulation), 1);
        record.conditioning =
            Conditioning { time: accumulation.uncertainty, estimated: true, ..Conditioning::default() };
        self.summed = Some(SequenceSum { before, guards, remaining });
        Ok(())
    }

    /// Confirms the sum of an impact sequence that has led to `state`, if any, and closes its instant. Returns the outcome if the run ends.
    pub fn confirm(&mut self, state: &State, observer: &mut dyn Observer) -> Option<Outcome> {
        let SequenceSum { before, guards, .. } = self.summed.take()?;
        self.chatter.clear();
        if observer.wants_jumps() {
            let State { at, x, jump } = &before.state;
            let (x_plus, fired) = (state.x.as_slice(), &guards);
            observer.jump(&JumpRecord {
                at: *at,
                from: jump,
                to: &state.jump,
                fired,
                x_minus: x,
                x_plus,
                settles: true,
            });
        }
        let is_spent = |core: &Self| core.counters.events >= core.options.max_events;
        self.close(state, observer).or_else(|| is_spent(self).then_some(Outcome::EventBudgetSpent))
    }

    /// Revokes the sum of an impact sequence: impacts go on one by one up to `until`. Returns the point after the last resolved impact.
    pub fn resume(&mut self, until: Instant) -> Option<WideState> {
        let SequenceSum { before, .. } = self.summed.take()?;
        self.chatter.block(until);
        self.iteration.stage = Stage::Past;
        self.iteration.record.at = before.state.at;
        Some(before)
    }

    /// Closes the open instant, if any, and passes on its record. Returns the outcome if the observer stops the run.
    pub fn close(&mut self, state: &State, observer: &mut dyn Observer) -> Option<Outcome> {
        let is_silent = self.iteration.is_silent;
        let record = self.iteration.close(state)?;
        self.counters.add(record, self.tolerance);
        (!is_silent && observer.event(record).is_break()).then_some(Outcome::StoppedByObserver)
    }

    /// Closes the open instant, if any, with the `state` that a lane has reached, and forgets the last step.
    pub fn go_past(&mut self, state: &State) {
        if let Some(record) = self.iteration.close(state) {
            self.counters.add(record, self.tolerance);
        }
        self.iteration.stage = Stage::Past;
        self.alarm.go_past();
        self.next_switch = self.system.next_switch(&state.jump.mode, state.at);
    }

    /// Resolves the instant at the first step of an arc with the time `left`, s. Returns guards that fire there again. Otherwise it closes
    /// the instant and returns an end only if the run stops or a sequence is summed.
    pub fn resolve(
        &mut self,
        step: &dyn DenseStep,
        place: ArcSpan<'_>,
        located: &mut Option<Located>,
        left: f64,
        observer: &mut dyn Observer,
    ) -> Option<ArcEnd> {
        if let Some(located) = located.take_if(|l| l.theta == 0.0) {
            return Some(ArcEnd::Event(located));
        }
        match self.pass(place, observer) {
            Ok(true) => {}
            Ok(false) => return None,
            Err(outcome) => return Some(ArcEnd::Stop(outcome)),
        }
        let flight = Flight {
            start: step.start(),
            guards: step.guards(),
            derivatives: &|i| step.guard_derivatives_in_time(i),
            rounding: &|i| step.guard_rounding(i),
            is_estimate: step.is_estimate(),
        };
        self.rests(&flight, left)
    }

    /// Returns the end of an impact sequence whose last impacts have just been recorded. The end must come before that of the arc, `left`
    /// later, s.
    pub fn rests(&mut self, flight: &Flight<'_>, left: f64) -> Option<ArcEnd> {
        let impacts = &self.iteration.record.fired;
        let (guards, accumulation) = self.chatter.ends(self.system, flight, impacts, &self.options)?;
        (accumulation.remaining < left).then_some(ArcEnd::Rest(guards, accumulation))
    }

    /// Closes the open instant, if any: no guard fires there again. Returns whether its record has just been closed and contains impacts,
    /// or the outcome if the run ends.
    pub fn pass(&mut self, place: ArcSpan<'_>, observer: &mut dyn Observer) -> Result<bool, Outcome> {
        if self.iteration.is_open() {
            let outcome = self.close(place.state, observer);
            let outcome = outcome.or((place.arrival == Arrival::Record).then_some(Outcome::ReachedEnd));
            let is_spent = self.counters.events >= self.options.max_events;
            if let Some(outcome) = outcome.or(is_spent.then_some(Outcome::EventBudgetSpent)) {
                return Err(outcome);
            }
        }
        let stage = std::mem::replace(&mut self.iteration.stage, Stage::Past);
        let is_impact = |id| self.system.restitution(id).is_some();
        Ok(stage == Stage::Closed && self.iteration.record.fired.iter().any(is_impact))
    }
}

impl ArcSpan<'_> {
    /// Returns whether a state event on `step` waits for the switch at the end of the arc, `left` seconds after the start of the step. Such
    /// an event fires at the start of the next arc. Its guards must be zero within their error at the switch, so that a slow guard that
    /// crosses clearly does not wait.
    pub fn waits(&self, step: &dyn DenseStep, located: &Located, left: f64) -> bool {
        let is_zero = |i: usize| {
            let ((tail, rounding), left_out) = (step.guard_error(i), step.left_out(i));
            let error = tail - left_out + rounding + step.gathered(i, 1.0, 0);
            step.plain_span().is_none() && left_out == 0.0 || step.guard(i).iter().sum::<f64>().abs() <= WAITING * error
        };
        let fired = |i: &usize| located.fired.contains(step.guards()[*i]);
        self.arrival == Arrival::Switch
            && left - step.time(located.theta) <= located.conditioning.time
            && (0..step.guards().len()).filter(fired).all(is_zero)
    }
}
