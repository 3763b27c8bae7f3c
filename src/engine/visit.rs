//! What a visit to a step does: closes the instant before it, finds its first event, hands it on.

use std::ops::ControlFlow;

use super::{
    EngineError, Observer,
    alarm::Alarm,
    chatter::Chatter,
    state::{Counters, Options, State},
};
use crate::{
    event::{Accumulation, Conditioning, EventRecord, Located, Locator},
    hybrid::{GuardId, GuardSet, HybridSystem, Instant, Mode},
    integrate::DenseStep,
};

/// What a visit to a step needs.
pub(super) struct Core<'s> {
    pub system: &'s dyn HybridSystem,
    pub options: Options,
    pub counters: Counters,
    pub locator: Locator,
    pub chatter: Chatter,
    pub alarm: Alarm,
    /// The record of the current instant, open until no further guard fires at it.
    pub open: EventRecord,
    pub is_open: bool,
    /// The run starts with a guard at zero.
    pub starts_on_guard: bool,
    /// What fired at the last closed instant and is still to be counted as impacts.
    pub uncounted: GuardSet,
    /// Modes visited at the current instant.
    pub cascade: Vec<Mode>,
    /// Jumps at the current instant that had an impulse.
    pub strikes: usize,
    /// Their fastest approach, where all that fired rebounds, m/s.
    pub fastest: f64,
    /// Where the current arc was left.
    pub left_at: Instant,
    pub left_x: Vec<f64>,
    pub left_low: Vec<f64>,
    pub left_carried: Vec<f64>,
}

/// What ended an arc.
pub(super) enum End {
    Bound,
    Event(Located),
    Settle(GuardSet, Accumulation),
    Observer,
    Budget,
    /// Nothing more fires at the instant the run ends at.
    Closed,
    Alarm(EngineError),
}

/// What a visit needs to know about the arc.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub mode: Mode,
    /// The bound is a known switching time: it goes before a state event at the same instant.
    pub switching: bool,
    /// The run has ended: only what still fires at its last instant is wanted.
    pub closing: bool,
    pub bound: Instant,
}

impl Core<'_> {
    /// Opens the record of the instant at which `state` stands.
    pub fn begin(&mut self, state: &State) {
        let open = &mut self.open;
        // An arc too short for the clock to tell leaves the instant what it was: its jumps go on counting.
        if open.at != state.at {
            self.cascade.clear();
            (self.strikes, self.fastest) = (0, 0.0);
        }
        open.at = state.at;
        open.from = state.jump.mode;
        open.x_minus.clear();
        open.x_minus.extend_from_slice(&state.x);
        open.fired = GuardSet::EMPTY;
        open.conditioning = Conditioning::default();
        open.jumps = 0;
        open.switched = false;
        open.start = false;
        open.graze = false;
        open.accumulation = None;
        open.projected = 0.0;
        self.is_open = true;
    }

    /// Closes the open record, if any, with the state after it.
    pub fn close(&mut self, state: &State, observer: &mut dyn Observer) -> ControlFlow<()> {
        if !std::mem::take(&mut self.is_open) {
            return ControlFlow::Continue(());
        }
        let open = &mut self.open;
        // A start off all guards is no decision.
        if open.start && !self.starts_on_guard && open.fired.is_empty() && !open.switched {
            return ControlFlow::Continue(());
        }
        self.uncounted = open.fired;
        open.to = state.jump.mode;
        open.jump = state.jump;
        open.x_plus.clear();
        open.x_plus.extend_from_slice(&state.x);
        if !open.fired.is_empty() && !open.start {
            self.counters.events += 1;
            self.counters.fired += u64::from(open.fired.0.count_ones());
        }
        observer.event(open)
    }

    /// Looks at one step: closes the instant before it, finds the first event on it, hands it on.
    pub fn visit(
        &mut self,
        step: &dyn DenseStep,
        place: Place,
        first: bool,
        state: &State,
        observer: &mut dyn Observer,
    ) -> Option<End> {
        self.counters.steps += 1;
        if let Err(alarm) = self.alarm.start(self.system, step, first) {
            return Some(End::Alarm(alarm));
        }
        let closes = !place.switching
            && self.system.clock().between(step.start(), place.bound) <= step.time(1.0) * (1.0 + 4.0 * f64::EPSILON);
        let (located, touch) = self.locator.first(step, first, closes);
        if first {
            if let Some(located) = located.filter(|l| l.theta == 0.0) {
                return Some(self.fire(step, place, located));
            }
            if self.is_open {
                let flow = self.close(state, observer);
                if flow.is_break() {
                    self.leave(step, 0.0);
                    return Some(End::Observer);
                }
                if place.closing {
                    self.leave(step, 0.0);
                    return Some(End::Closed);
                }
                if self.counters.events >= self.options.max_events {
                    self.leave(step, 0.0);
                    return Some(End::Budget);
                }
            }
            // A sequence is summed only if it ends before the arc does: a switch or the run's end may not fall inside.
            let left = self.system.clock().between(step.start(), place.bound);
            let fired = std::mem::take(&mut self.uncounted);
            if let Some((ending, accumulation)) =
                self.chatter.ends(self.system, step, fired, &self.options).filter(|(_, end)| end.remaining < left)
            {
                self.leave(step, 0.0);
                return Some(End::Settle(ending, accumulation));
            }
        }
        if let Some((theta, guard)) = touch
            && self.graze(step, theta, guard, place, observer).is_break()
        {
            return Some(End::Observer);
        }
        // A state event at a switching time waits for the switch: it fires at the start of the next arc.
        let waits = |l: &Located| {
            let left = self.system.clock().between(step.start(), place.bound) - step.time(l.theta);
            place.switching && left <= l.conditioning.time
        };
        if let Some(l) = located.filter(waits) {
            self.alarm.wait(step, &l);
        }
        let located = located.filter(|l| !waits(l));
        let until = located.map_or(1.0, |l| l.theta);
        if observer.step(place.mode, step, until).is_break() {
            self.leave(step, until);
            return Some(End::Observer);
        }
        let Some(located) = located else {
            self.alarm.end(place.mode, step, closes);
            step.carry(1.0, &mut self.left_carried);
            return None;
        };
        Some(self.fire(step, place, located))
    }

    /// Leaves the step at an event, if its numbers agree there.
    pub fn fire(&mut self, step: &dyn DenseStep, place: Place, located: Located) -> End {
        self.leave(step, located.theta);
        match self.alarm.event(self.system, place.mode, step, &located, (self.left_at, &self.left_x)) {
            Ok(()) => {
                self.meet(place.mode, &located);
                End::Event(located)
            }
            Err(alarm) => End::Alarm(alarm),
        }
    }

    pub fn leave(&mut self, step: &dyn DenseStep, theta: f64) {
        self.left_at = self.system.clock().advance(step.start(), step.time_in_two(theta));
        step.state_in_two(theta, &mut self.left_x, &mut self.left_low);
        step.carry(theta, &mut self.left_carried);
    }

    /// Moves time and state where they were left onto a guard that fell through zero there: its root is a rounded number.
    pub fn meet(&mut self, mode: Mode, located: &Located) {
        if let Some(id) = located.zero.iter().next().filter(|_| located.theta > 0.0) {
            let (most, at) = (located.conditioning.time, self.left_at);
            let by = self.system.meet(mode, id, at, most, &mut self.left_x, &mut self.left_low);
            self.left_at = self.system.clock().advance(at, by);
        }
    }

    /// A touch without crossing: recorded, and nothing else.
    pub fn graze(
        &mut self,
        step: &dyn DenseStep,
        theta: f64,
        guard: GuardId,
        place: Place,
        observer: &mut dyn Observer,
    ) -> ControlFlow<()> {
        self.counters.grazes += 1;
        self.leave(step, theta);
        let mut fired = GuardSet::EMPTY;
        fired.insert(guard);
        observer.event(&EventRecord {
            at: self.left_at,
            fired,
            from: place.mode,
            to: place.mode,
            x_minus: self.left_x.clone(),
            x_plus: self.left_x.clone(),
            graze: true,
            ..EventRecord::default()
        })
    }
}
