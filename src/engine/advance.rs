//! One run: arcs between events.

use std::ops::ControlFlow;

use super::{
    EngineError, Observer, Outcome,
    alarm::Alarm,
    chatter::Chatter,
    state::{Counters, Options, State},
    visit::{Core, End, Place},
};
use crate::{
    event::{Accumulation, EventRecord, Located, Locator},
    hybrid::{GuardSet, HybridSystem, Instant},
    integrate::{Arc, Integrator},
};

/// Jumps without an impulse allowed at one instant; more are a cycle.
const MAX_CASCADE: usize = 64;
/// Jumps with an impulse allowed at one instant. A factor of 0.992 a round reaches [`LOST`] in as many.
const MAX_STRIKES: usize = 4096;
/// Approach speed, relative to the fastest at the same instant, below which contacts come to rest instead of bouncing: the rounding of
/// the speeds that it is a difference of.
const LOST: f64 = 256.0 * f64::EPSILON;

/// Drives a hybrid system from event to event.
pub struct Engine<'s> {
    integrator: Box<dyn Integrator + 's>,
    state: State,
    /// The next known switching time, kept until it is passed.
    next_switch: Option<Instant>,
    /// What the state is beyond the rounding of its `x`, `[dim]`.
    low: Vec<f64>,
    /// What the last step kept for the next arc.
    carried: Vec<f64>,
    /// Scratch for the state at the end of an arc, and for its low part.
    end: [Vec<f64>; 2],
    core: Core<'s>,
}

impl<'s> Engine<'s> {
    /// An engine at `state`.
    #[must_use]
    pub fn new(
        system: &'s dyn HybridSystem,
        integrator: Box<dyn Integrator + 's>,
        options: Options,
        state: State,
    ) -> Self {
        let dim = system.dim();
        let open = EventRecord {
            at: state.at,
            from: state.jump.mode,
            to: state.jump.mode,
            x_minus: state.x.clone(),
            x_plus: state.x.clone(),
            start: true,
            ..EventRecord::default()
        };
        let core = Core {
            system,
            options,
            counters: Counters::default(),
            locator: Locator::default(),
            chatter: Chatter::default(),
            alarm: Alarm::default(),
            // What holds at the start is one record, if there is anything to say.
            is_open: true,
            starts_on_guard: !state.jump.pinned.is_empty(),
            open,
            uncounted: GuardSet::EMPTY,
            cascade: Vec::with_capacity(MAX_CASCADE),
            strikes: 0,
            fastest: 0.0,
            left_at: state.at,
            left_x: vec![0.0; dim],
            left_low: vec![0.0; dim],
            left_carried: Vec::new(),
        };
        // A state handed over at a switching time that its mode has not passed yet passes it first.
        let is_due = system.switched(state.jump.mode, state.at) != state.jump.mode;
        let next_switch = if is_due { Some(state.at) } else { system.next_switch(state.at) };
        let zero = || vec![0.0; dim];
        Self { integrator, next_switch, low: zero(), carried: Vec::new(), end: [zero(), zero()], core, state }
    }

    /// Where the run stands.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The integrator, which may tell what it chose.
    #[must_use]
    pub fn integrator(&self) -> &(dyn Integrator + 's) {
        &*self.integrator
    }

    /// Work done so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        Counters { splits: self.core.locator.splits, ..self.core.counters }
    }

    /// Advances to `end`. Events at `end` belong to the run.
    ///
    /// # Errors
    /// [`EngineError`]; the state is then where the last arc started.
    pub fn run(&mut self, end: Instant, observer: &mut dyn Observer) -> Result<Outcome, EngineError> {
        let clock = *self.core.system.clock();
        let span = clock.between(self.state.at, end);
        while clock.between(self.state.at, end) > 0.0 {
            if self.core.counters.events >= self.core.options.max_events {
                return Ok(Outcome::EventBudgetSpent);
            }
            let switch = self.next_switch.filter(|s| clock.between(*s, end) >= 0.0);
            if switch.is_some_and(|s| clock.between(self.state.at, s) <= 0.0) {
                self.switch();
                continue;
            }
            match self.arc(switch.unwrap_or(end), switch.is_some(), false, observer)? {
                End::Observer => return Ok(Outcome::StoppedByObserver),
                End::Budget => return Ok(Outcome::EventBudgetSpent),
                End::Event(located) => self.jump(located)?,
                End::Settle(fired, accumulation) => {
                    if self.settle(fired, accumulation, observer)?.is_break() {
                        return Ok(Outcome::StoppedByObserver);
                    }
                }
                End::Bound if switch.is_some() => self.switch(),
                End::Bound | End::Closed | End::Alarm(_) => {}
            }
        }
        self.core.alarm.finish(self.core.system, self.state.at, &self.state.x)?;
        // An instant exactly at the end is still open. It belongs to this run, and so does what follows from it at once.
        while self.core.is_open && span > 0.0 {
            match self.arc(clock.advance(self.state.at, span), false, true, observer)? {
                End::Event(located) => self.jump(located)?,
                End::Observer => return Ok(Outcome::StoppedByObserver),
                _ => return Ok(Outcome::ReachedEnd),
            }
        }
        if self.core.close(&self.state, observer).is_break() {
            return Ok(Outcome::StoppedByObserver);
        }
        Ok(Outcome::ReachedEnd)
    }

    /// One smooth arc up to `bound`; leaves the state where it ended, in the mode it ran in.
    fn arc(
        &mut self,
        bound: Instant,
        switching: bool,
        closing: bool,
        observer: &mut dyn Observer,
    ) -> Result<End, EngineError> {
        let Self { integrator, state, low, carried, end: [end, end_low], core, .. } = self;
        core.counters.arcs += 1;
        // Stands if the arc ends before its first step.
        core.left_carried.clone_from(carried);
        let place = Place { mode: state.jump.mode, switching, closing, bound };
        let arc = Arc {
            mode: place.mode,
            at: state.at,
            x: &state.x,
            low,
            carried,
            pinned: state.jump.pinned,
            still: state.jump.still,
            bound,
        };
        let (mut ended, mut first) = (End::Bound, true);
        integrator
            .integrate_arc(core.system, &arc, end, end_low, &mut |step| {
                let flow = core.visit(step, place, first, state, observer);
                first = false;
                match flow {
                    None => ControlFlow::Continue(()),
                    Some(e) => {
                        ended = e;
                        ControlFlow::Break(())
                    }
                }
            })
            .map_err(|source| EngineError::Integrate { mode: core.system.mode_in_words(place.mode), source })?;
        if let End::Alarm(alarm) = ended {
            return Err(alarm);
        }
        let start = state.at;
        std::mem::swap(carried, &mut core.left_carried);
        if let End::Bound = ended {
            state.at = bound;
            std::mem::swap(&mut state.x, end);
            std::mem::swap(low, end_low);
        } else {
            state.at = core.left_at;
            std::mem::swap(&mut state.x, &mut core.left_x);
            std::mem::swap(low, &mut core.left_low);
        }
        // Where no time has passed the exact zeros still stand: through a cascade, and for a run that goes on later.
        if state.at != start {
            state.jump.pinned = GuardSet::EMPTY;
            state.jump.still = GuardSet::EMPTY;
        }
        Ok(ended)
    }

    /// The guards of `located` fire: one jump, kept in the open record.
    fn jump(&mut self, located: Located) -> Result<(), EngineError> {
        let Self { state, low, core, .. } = self;
        let model = |source| EngineError::Model { t: core.system.clock().time(state.at).value(), source };
        if !core.is_open {
            core.begin(state);
        }
        let open = &mut core.open;
        open.fired.0 |= located.fired.0;
        if located.conditioning.time >= open.conditioning.time {
            open.conditioning = located.conditioning;
        }
        core.cascade.push(state.jump.mode);
        let rounds = core.cascade.len() - 1;
        if rounds >= MAX_CASCADE + core.strikes || core.strikes >= MAX_STRIKES {
            let (last, before) = (core.cascade[rounds], &core.cascade[..rounds]);
            let since = before.iter().rposition(|m| *m == last).unwrap_or(0);
            let cycle = before[since..].iter().map(|m| core.system.mode_in_words(*m)).collect();
            return Err(EngineError::Cycle { t: core.system.clock().time(state.at).value(), rounds, cycle });
        }
        let before = state.jump.pinned;
        core.alarm.jumped();
        state.jump.pinned.0 |= located.zero.0;
        // Events closer together than their uncertainties are one instant: a rigid flank that does not give back touches.
        let touches = located.near.iter().filter(|id| core.system.restitution(*id) == Some(0.0));
        touches.for_each(|id| state.jump.pinned.insert(id));
        // One that is known to touch carries an impulse without an impact.
        let near = located.near.0 & !before.0;
        let rebounds = |id| core.system.restitution(id).is_some_and(|e| e > 0.0);
        let speed = if located.fired.iter().all(rebounds) { located.conditioning.slope.abs() } else { 0.0 };
        state.jump = if speed > 0.0 && speed < LOST * core.fastest {
            low.fill(0.0);
            core.system.settle(&state.jump, located.fired, state.at, &mut state.x)
        } else {
            core.system.jump(&state.jump, located.fired, state.at, &mut state.x, low)
        }
        .map_err(model)?;
        core.alarm.moved(core.system, state.at, located.fired, state.jump.projected)?;
        if !state.jump.struck.is_empty() {
            core.strikes += 1;
            core.fastest = core.fastest.max(speed);
        }
        open.fired.0 |= near & state.jump.struck.0;
        open.projected = open.projected.max(state.jump.projected);
        open.jumps += 1;
        Ok(())
    }

    /// A known switching time: the mode's schedule moves on.
    fn switch(&mut self) {
        let Self { state, core, .. } = self;
        core.counters.switches += 1;
        if !core.is_open {
            core.begin(state);
        }
        core.open.switched = true;
        state.jump.mode = core.system.switched(state.jump.mode, state.at);
        self.next_switch = core.system.next_switch(state.at);
    }

    /// An impact sequence ends: the contacts come to rest, `accumulation.remaining` later.
    fn settle(
        &mut self,
        fired: GuardSet,
        accumulation: Accumulation,
        observer: &mut dyn Observer,
    ) -> Result<ControlFlow<()>, EngineError> {
        let Self { state, low, core, .. } = self;
        low.fill(0.0);
        self.carried.clear();
        core.alarm.jumped();
        core.begin(state);
        let at = core.system.clock().advance(state.at, accumulation.remaining);
        core.open.at = at;
        core.open.fired = fired;
        core.open.accumulation = Some(accumulation);
        core.open.jumps = 1;
        state.jump = core
            .system
            .settle(&state.jump, fired, state.at, &mut state.x)
            .map_err(|source| EngineError::Model { t: core.system.clock().time(at).value(), source })?;
        core.counters.accumulations += 1;
        core.chatter.clear();
        Ok(core.close(state, observer))
    }
}
