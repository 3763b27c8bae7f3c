//! One run: arcs between instants at which something happens.

use std::{collections::BTreeMap, ops::ControlFlow};

use super::{
    EngineError, Observer, Outcome, lane,
    leap::Leaps,
    state::{Counters, Options, Point, State},
    visit::{Again, Arrival, Core, End, Place},
};
use crate::{
    hybrid::{FULL_PRECISION, GuardSet, HybridSystem, Instant, JetField, Lane, Mode},
    integrate::{Arc, Before, Integrator},
};

/// Motions that are kept: some kilobytes each, and more modes than most trains come back to.
const MAX_MOTIONS: usize = 1024;

/// Arcs in a row that take no time, at most: more than an instant has jumps.
const MAX_STILL: u32 = 10_000;

/// A mode that was met.
#[derive(Default)]
struct Met<'s> {
    known: Option<Known<'s>>,
    /// Arcs of the run in it: a count of the run, whatever is kept of the motions.
    arcs: u64,
}

/// Its motion, and whether that may tell its way at once.
struct Known<'s> {
    motion: Option<Box<dyn JetField + 's>>,
    leaps: bool,
}

/// Drives a hybrid system from event to event.
pub struct Engine<'s> {
    integrator: Box<dyn Integrator + 's>,
    point: Point,
    /// The modes met, and of how many the motion is kept.
    motions: BTreeMap<Mode, Met<'s>>,
    kept: usize,
    leaps: Leaps,
    /// The way of what nobody looks at.
    lane: Option<Box<dyn Lane + 's>>,
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
        let end = [state.x.clone(), state.x.clone()];
        let (core, point) = (Core::new(system, options, &state), Point::new(state));
        let lane = system.lane().filter(|_| !crate::old_steps());
        Self { integrator, point, motions: BTreeMap::new(), kept: 0, leaps: Leaps::default(), lane, end, core }
    }

    /// Begins another run at `state`, with an `integrator` that has seen none: as a new engine, but for the motions that were met.
    pub fn restart(&mut self, integrator: Box<dyn Integrator + 's>, state: State) {
        if self.core.system.clock().period().is_none() {
            // Without a period the first arc of a mode has a part in which integrator suits it.
            self.motions.clear();
            self.kept = 0;
        }
        self.motions.values_mut().for_each(|met| met.arcs = 0);
        self.integrator = integrator;
        self.core = Core::new(self.core.system, self.core.options, &state);
        self.point = Point::new(state);
    }

    /// Where the run stands.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.point.state
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
        let span = clock.between(self.state().at, end);
        self.core.iteration.is_silent = !observer.wants_events();
        let (mut last, mut still) = (None, 0);
        while self.state().at < end {
            still = if last == Some(self.state().at) { still + 1 } else { 0 };
            last = Some(self.state().at);
            if still > MAX_STILL {
                return Err(EngineError::Still { t: clock.time(self.state().at).value(), arcs: still });
            }
            if self.core.counters.events >= self.core.options.max_events {
                return Ok(Outcome::EventBudgetSpent);
            }
            if let Some(lane) =
                self.lane.as_deref_mut().filter(|_| !observer.wants_anything() && self.core.summed.is_none())
            {
                match lane::go_on(lane, &mut self.core, &mut *self.integrator, &mut self.point, end) {
                    Some(End::Bound) => break,
                    Some(End::Rest(guards, accumulation)) => {
                        self.core.rest(&mut self.point, guards, accumulation)?;
                        continue;
                    }
                    _ => {}
                }
            }
            let switch = self.core.next_switch.filter(|switch| *switch <= end);
            let ended = match switch {
                Some(switch) if switch <= self.state().at => End::Bound,
                Some(switch) => self.arc(switch, Arrival::Switch, observer)?,
                None => self.arc(end, Arrival::End, observer)?,
            };
            match ended {
                End::Bound if switch.is_some() => self.core.switch(&mut self.point),
                End::Bound | End::Again => {}
                End::Event(located) => self.core.fire(&mut self.point, &located, observer)?,
                End::Rest(guards, accumulation) => {
                    self.core.rest(&mut self.point, guards, accumulation)?;
                    continue;
                }
                End::Resume(until) => self.point = self.core.resume(until).unwrap_or_else(|| self.point.clone()),
                End::Stop(outcome) => return Ok(outcome),
            }
            // An arc too short for a step says nothing against a sum.
            if let Some(outcome) = self.core.confirm(&self.point.state, observer) {
                return Ok(outcome);
            }
        }
        self.core.alarm.finish(self.core.system, self.point.state.at, &self.point.state.x)?;
        // An instant exactly at the end is still open. It belongs to this run, and so does what follows from it at once.
        while self.core.iteration.is_open() && span > 0.0 {
            match self.arc(clock.advance(self.state().at, span), Arrival::Record, observer)? {
                End::Event(located) => self.core.fire(&mut self.point, &located, observer)?,
                End::Stop(outcome) => return Ok(outcome),
                End::Again => {}
                End::Bound | End::Rest(..) | End::Resume(_) => return Ok(Outcome::ReachedEnd),
            }
        }
        Ok(self.core.close(&self.point.state, observer).unwrap_or(Outcome::ReachedEnd))
    }

    /// One smooth arc up to `bound`; leaves the state where it ended, in the mode it ran in.
    fn arc(&mut self, bound: Instant, arrival: Arrival, observer: &mut dyn Observer) -> Result<End, EngineError> {
        let Self { integrator, point, motions, kept, leaps, end: [end, end_low], core, .. } = self;
        let mode = &point.state.jump.mode;
        if *kept >= MAX_MOTIONS && motions.get(mode).is_none_or(|met| met.known.is_none()) {
            motions.values_mut().for_each(|met| met.known = None);
            *kept = 0;
        }
        let met = motions.entry(mode.clone()).or_default();
        met.arcs += 1;
        let known = met.known.get_or_insert_with(|| {
            let arc = core.system.clock().between(point.state.at, bound);
            let leaps = integrator.is_exact(core.system, mode, arc) && !crate::old_steps();
            *kept += 1;
            Known { motion: core.system.motion(mode), leaps }
        });
        let motion = &known.motion;
        let again = core.again.take();
        core.is_again = again.is_some();
        let mut before = again.as_ref().map_or_else(Before::default, |again| {
            let Again { steps, extent, left_out } = again;
            Before { steps: *steps, extent, left_out: *left_out }
        });
        if let Some(motion) = motion.as_deref().filter(|_| known.leaps && !core.is_again && core.summed.is_none()) {
            if let Some(end) = leaps.arc(core, (motion, met.arcs), point, bound, arrival, observer)? {
                return Ok(end);
            }
            before = leaps.before();
        }
        let Point { state, low, carried } = point;
        let mode = &state.jump.mode;
        core.counters.arcs += u64::from(before.steps == 0 && !core.is_again);
        // Stands if the arc ends before its first step.
        core.left.carried.clone_from(carried);
        let arc = Arc {
            mode,
            motion: motion.as_deref(),
            at: state.at,
            x: &state.x,
            low,
            carried,
            pinned: &state.jump.pinned,
            still: &state.jump.still,
            bound,
            tolerance: if core.is_again { FULL_PRECISION } else { core.options.truncation() },
            before,
        };
        let place = Place { state, bound, arrival };
        // Where leaps have led here, they began the arc.
        let (mut ended, mut first) = (Ok(None), before.steps == 0);
        integrator
            .integrate_arc(core.system, &arc, end, end_low, &mut |step| {
                ended = core.visit(step, place, std::mem::take(&mut first), observer);
                if matches!(ended, Ok(None)) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
            .map_err(|source| EngineError::Integrate { mode: core.system.mode_in_words(mode), source })?;
        let (ended, left) = (ended?.unwrap_or(End::Bound), &mut core.left);
        if let End::Bound = ended {
            left.state.at = bound;
            std::mem::swap(&mut left.state.x, end);
            std::mem::swap(&mut left.low, end_low);
        }
        // Where no time has passed the exact zeros still stand: through a cascade, and for a run that goes on later.
        if left.state.at != state.at {
            state.jump.pinned = GuardSet::default();
            state.jump.still = GuardSet::default();
        }
        state.at = left.state.at;
        std::mem::swap(&mut state.x, &mut left.state.x);
        std::mem::swap(low, &mut left.low);
        std::mem::swap(carried, &mut left.carried);
        Ok(ended)
    }
}
