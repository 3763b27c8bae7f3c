//! Visits of steps: resolve the instant before a step, find its first event, pass it on.

use std::ops::ControlFlow;

use super::{
    EngineError, Observer, Outcome,
    alarm::Alarm,
    chatter::Chatter,
    instant::EventIteration,
    state::{Counters, Options, State, WideState},
};
use crate::{
    event::{Accumulation, EventRecord, Located, Locator, Touch},
    hybrid::{GuardId, GuardSet, HybridSystem, Instant, Wide},
    integrate::{DenseStep, EarlierSteps},
};

/// Common state of the engine during visits.
pub(super) struct Core<'s> {
    pub system: &'s dyn HybridSystem,
    pub options: Options,
    /// Largest permitted error of the time of an event, s; 0 at full precision.
    pub tolerance: f64,
    pub counters: Counters,
    pub locator: Locator,
    pub chatter: Chatter,
    pub alarm: Alarm,
    pub iteration: EventIteration,
    /// Next known switching time, kept until it is passed.
    pub next_switch: Option<Instant>,
    /// Point at which the current arc was left; its mode has no meaning.
    pub left: WideState,
    /// Data of the arc before a step that has to be repeated.
    pub again: Option<StepsBeforeRepeat>,
    /// True if the current arc continues from such a step.
    pub is_again: bool,
    /// Sum of an impact sequence that the first step of the motion at rest has to confirm.
    pub summed: Option<SequenceSum>,
}

/// Impact sequence that is summed, before anything of it is recorded.
pub(super) struct SequenceSum {
    /// Point after its last resolved impact.
    pub before: WideState,
    /// Guards of the sequence.
    pub guards: GuardSet,
    /// Time from that point to the end of the sequence, s.
    pub remaining: f64,
}

/// Steps of an arc before a step that is repeated: see [`EarlierSteps`].
pub(super) struct StepsBeforeRepeat {
    pub steps: u32,
    pub extent: Vec<f64>,
    pub left_out: [f64; 2],
}

/// Cause of the end of an arc.
pub(super) enum ArcEnd {
    /// A step has to be repeated at full precision, from its start.
    Again,
    /// The bound of the arc.
    Bound,
    /// Guards that fire.
    Event(Located),
    /// An impact sequence is summed: the contacts of its guards come to rest.
    Rest(GuardSet, Accumulation),
    /// The sum of an impact sequence is revoked: its impacts go on one by one, at least up to this instant.
    Resume(Instant),
    /// The end of the run.
    Stop(Outcome),
}

/// Kind of the bound of an arc.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Arrival {
    /// A known switching time.
    Switch,
    /// The end of the run.
    End,
    /// The record of the instant at the start of the arc: the run has ended.
    Record,
}

/// Start and bound of the arc of a step.
#[derive(Clone, Copy)]
pub(super) struct ArcSpan<'a> {
    /// State at the start of the arc.
    pub state: &'a State,
    pub bound: Instant,
    pub arrival: Arrival,
}

impl<'s> Core<'s> {
    /// Returns the core of a run that starts at `state`.
    pub fn new(system: &'s dyn HybridSystem, options: Options, state: &State) -> Self {
        let period = options.period.or_else(|| system.clock().period().map(Wide::value)).unwrap_or(0.0);
        Self {
            system,
            options,
            tolerance: if options.left_out() > 0.0 { options.event_tolerance * period } else { 0.0 },
            counters: Counters::default(),
            locator: Locator::default(),
            chatter: Chatter::default(),
            alarm: Alarm::default(),
            iteration: EventIteration::new(state),
            // A state handed over at a switching time that its mode has not passed passes the switch first.
            next_switch: system.next_switch(&state.jump.mode, state.at),
            left: WideState::new(state.clone()),
            again: None,
            is_again: false,
            summed: None,
        }
    }
}

impl Core<'_> {
    /// Visits one step, the `first` of its arc or a later one. Returns the end of the arc if the arc ends on the step.
    pub fn visit(
        &mut self,
        step: &dyn DenseStep,
        place: ArcSpan<'_>,
        first: bool,
        observer: &mut dyn Observer,
    ) -> Result<Option<ArcEnd>, EngineError> {
        self.count_step(step.start())?;
        self.alarm.start(self.system, step, first)?;
        let left = self.system.clock().between(step.start(), place.bound);
        let closes = place.arrival != Arrival::Switch && left <= step.time(1.0) * (1.0 + 4.0 * f64::EPSILON);
        let (mut located, touch) = self.locator.first(step, first, closes);
        if let Some(SequenceSum { remaining, .. }) = self.summed {
            let event = located.as_ref().map_or(1.0, |located| located.theta);
            let quiet = step.time(touch.as_ref().map_or(event, |touch| touch.theta.min(event)));
            if quiet < remaining {
                self.leave(step, 0.0);
                return Ok(Some(ArcEnd::Resume(self.system.clock().advance(step.start(), quiet))));
            }
            if let Some(outcome) = self.confirm(place.state, observer) {
                return self.end_at(step, place, 0.0, ArcEnd::Stop(outcome));
            }
        }
        if first && let Some(end) = self.resolve(step, place, &mut located, left, observer) {
            return self.end_at(step, place, 0.0, end);
        }
        if located.as_ref().is_some_and(|located| self.is_loose(step, located)) {
            let EarlierSteps { steps, extent, left_out } = step.before();
            self.again = Some(StepsBeforeRepeat { steps, extent: extent.to_vec(), left_out });
            self.leave(step, 0.0);
            return Ok(Some(ArcEnd::Again));
        }
        if let Some(touch) = touch
            && self.graze(step, touch, place, observer).is_break()
        {
            return Ok(Some(ArcEnd::Stop(Outcome::StoppedByObserver)));
        }
        if let Some(located) = located.take_if(|l| place.waits(step, l, left)) {
            self.alarm.wait(step, &located);
        }
        let until = located.as_ref().map_or(1.0, |l| l.theta);
        if observer.step(&place.state.jump.mode, step, until).is_break() {
            return self.end_at(step, place, until, ArcEnd::Stop(Outcome::StoppedByObserver));
        }
        if let Some(located) = located {
            return self.end_at(step, place, until, ArcEnd::Event(located));
        }
        self.alarm.end(&place.state.jump.mode, step, closes);
        step.carry(1.0, &mut self.left.carried);
        Ok(None)
    }

    /// Counts a step from `at`, or fails if the step budget is spent.
    pub fn count_step(&mut self, at: Instant) -> Result<(), EngineError> {
        let steps = self.options.max_steps;
        if self.counters.steps >= steps {
            return Err(EngineError::Steps { t: self.system.clock().time(at).value(), steps });
        }
        self.counters.steps += 1;
        Ok(())
    }

    /// Returns whether truncation on request is forbidden before a fall of `id`. After such a fall a force is exactly zero, and the state
    /// has to agree to rounding. At a flank the state is moved instead.
    pub fn falls_exactly(&self, id: GuardId) -> bool {
        !self.system.is_continuous(id)
    }

    /// Returns whether a step with additional truncation leads to such a fall, and has to be repeated at full precision.
    fn is_loose(&self, step: &dyn DenseStep, located: &Located) -> bool {
        let falls_loosely = |(i, id): (usize, &GuardId)| {
            located.fired.contains(*id) && step.left_out(i) > 0.0 && self.falls_exactly(*id)
        };
        !self.is_again && located.theta > 0.0 && step.guards().iter().enumerate().any(falls_loosely)
    }

    /// Ends the arc at `theta`; at an event, tests that the numbers of step and state agree there.
    fn end_at(
        &mut self,
        step: &dyn DenseStep,
        place: ArcSpan<'_>,
        theta: f64,
        end: ArcEnd,
    ) -> Result<Option<ArcEnd>, EngineError> {
        self.leave(step, theta);
        if let ArcEnd::Event(located) = &end {
            let (mode, State { at, x, .. }) = (&place.state.jump.mode, &mut self.left.state);
            self.alarm.event(self.system, mode, step, located, (*at, x))?;
            // The root is a rounded number: time and state are moved onto a guard that fell through zero there.
            if let Some(id) = located.zero.iter().next().filter(|_| theta > 0.0) {
                let by = self.system.meet(mode, id, *at, located.conditioning.time, x, &mut self.left.low);
                let met = self.system.clock().advance(*at, by);
                // Times in a log do not decrease.
                *at = if met < place.state.at { place.state.at } else { met };
            }
        }
        Ok(Some(end))
    }

    fn leave(&mut self, step: &dyn DenseStep, theta: f64) {
        let WideState { state, low, carried } = &mut self.left;
        state.at = self.system.clock().advance(step.start(), step.time_in_two(theta));
        step.state_in_two(theta, &mut state.x, low);
        step.carry(theta, carried);
    }

    /// Records a touch without crossing.
    fn graze(
        &mut self,
        step: &dyn DenseStep,
        touch: Touch,
        place: ArcSpan<'_>,
        observer: &mut dyn Observer,
    ) -> ControlFlow<()> {
        self.leave(step, touch.theta);
        let (mode, State { at, x, .. }) = (&place.state.jump.mode, &self.left.state);
        let record = EventRecord {
            at: *at,
            fired: GuardSet::from_iter([touch.guard]),
            from: mode.clone(),
            to: mode.clone(),
            x_minus: x.clone(),
            x_plus: x.clone(),
            conditioning: touch.conditioning,
            graze: true,
            ..EventRecord::default()
        };
        self.counters.add(&record, self.tolerance);
        observer.event(&record)
    }
}
