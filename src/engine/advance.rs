//! One run: arcs between instants at which something happens.

use std::{collections::BTreeMap, ops::ControlFlow};

use super::{
    EngineError, Observer, Outcome, lane,
    leap::Leaps,
    state::{Counters, Options, State, WideState},
    visit::{ArcEnd, ArcSpan, Arrival, Core, StepsBeforeRepeat},
};
use crate::{
    hybrid::{FULL_PRECISION, GuardSet, HybridSystem, Instant, JetField, Lane, MOST_MODES, Mode},
    integrate::{Arc, EarlierSteps, Integrator},
};

/// Maximum number of consecutive arcs of zero duration: more than an instant has jumps.
const MAX_STILL: u32 = 10_000;

/// Record of a mode that the run has visited.
#[derive(Default)]
pub(super) struct VisitedMode<'s> {
    known: Option<ModeMotion<'s>>,
    /// Number of arcs of the run in the mode, counted even after its motion is dropped.
    pub arcs: u64,
}

impl VisitedMode<'_> {
    /// Returns the record of a mode in which a lane has made `arcs`.
    pub fn with(arcs: u64) -> Self {
        Self { known: None, arcs }
    }
}

/// Motion of a mode, and the flag that permits leaps in it.
struct ModeMotion<'s> {
    motion: Option<Box<dyn JetField + 's>>,
    leaps: bool,
}

/// Drives a hybrid system from event to event.
pub struct Engine<'s> {
    integrator: Box<dyn Integrator + 's>,
    point: WideState,
    /// Modes visited; `kept` is the number of those whose motion is kept.
    motions: BTreeMap<Mode, VisitedMode<'s>>,
    kept: usize,
    leaps: Leaps,
    /// Lane for motions that need no call to an observer, if the system has one.
    lane: Option<Box<dyn Lane + 's>>,
    /// Scratch for the state at the end of an arc, and for its low part.
    end: [Vec<f64>; 2],
    core: Core<'s>,
}

impl<'s> Engine<'s> {
    /// Returns an engine at `state`.
    #[must_use]
    pub fn new(
        system: &'s dyn HybridSystem,
        integrator: Box<dyn Integrator + 's>,
        options: Options,
        state: State,
    ) -> Self {
        let end = [state.x.clone(), state.x.clone()];
        let (core, point) = (Core::new(system, options, &state), WideState::new(state));
        let lane = system.lane();
        Self { integrator, point, motions: BTreeMap::new(), kept: 0, leaps: Leaps::default(), lane, end, core }
    }

    /// Begins another run at `state`: as a new engine, but periodic systems keep the motions of visited modes.
    pub fn restart(&mut self, state: State) {
        if self.core.system.clock().period().is_none() {
            // Without a period, the length of a mode's first arc takes part in the choice of its integrator.
            self.motions.clear();
            self.kept = 0;
        }
        self.motions.values_mut().for_each(|met| met.arcs = 0);
        self.integrator.restart();
        self.core = Core::new(self.core.system, self.core.options, &state);
        self.point = WideState::new(state);
    }

    /// Returns the current state of the run.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.point.state
    }

    /// Returns the integrator, which may report the method that it chose.
    #[must_use]
    pub fn integrator(&self) -> &(dyn Integrator + 's) {
        &*self.integrator
    }

    /// Returns the counts of the work done so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        Counters { splits: self.core.locator.splits, ..self.core.counters }
    }

    /// Advances to `end`. Events at `end` belong to the run.
    ///
    /// # Errors
    /// [`EngineError`]; the state is then that at the start of the last arc.
    pub fn run(&mut self, end: Instant, observer: &mut dyn Observer) -> Result<Outcome, EngineError> {
        let clock = *self.core.system.clock();
        let start = self.state().at;
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
            if let Some(lane) = self.lane.as_deref_mut().filter(|_| self.core.summed.is_none()) {
                match lane::go_on(
                    lane,
                    &mut self.core,
                    (&mut *self.integrator, &mut self.motions),
                    &mut self.point,
                    end,
                    observer,
                ) {
                    Some(ArcEnd::Bound) => break,
                    Some(ArcEnd::Rest(guards, accumulation)) => {
                        self.core.rest(&mut self.point, guards, accumulation)?;
                        continue;
                    }
                    Some(ArcEnd::Stop(outcome)) => return Ok(outcome),
                    _ => {}
                }
            }
            let switch = self.core.next_switch.filter(|switch| *switch <= end);
            let ended = match switch {
                Some(switch) if switch <= self.state().at => ArcEnd::Bound,
                Some(switch) => self.arc(switch, Arrival::Switch, observer)?,
                None => self.arc(end, Arrival::End, observer)?,
            };
            match ended {
                ArcEnd::Bound if switch.is_some() => self.core.switch(&mut self.point),
                ArcEnd::Bound | ArcEnd::Again => {}
                ArcEnd::Event(located) => self.core.fire(&mut self.point, &located, observer)?,
                ArcEnd::Rest(guards, accumulation) => {
                    self.core.rest(&mut self.point, guards, accumulation)?;
                    continue;
                }
                ArcEnd::Resume(until) => self.point = self.core.resume(until).unwrap_or_else(|| self.point.clone()),
                ArcEnd::Stop(outcome) => return Ok(outcome),
            }
            // An arc too short for a step does not refute a sum.
            if let Some(outcome) = self.core.confirm(&self.point.state, observer) {
                return Ok(outcome);
            }
        }
        self.core.alarm.finish(self.core.system, self.point.state.at, &self.point.state.x)?;
        // An instant exactly at the end is still open. The instant and all its jumps belong to this run.
        while self.core.iteration.is_open() && start < end {
            let bound = clock.advance(self.state().at, clock.between(start, end));
            match self.arc(bound, Arrival::Record, observer)? {
                ArcEnd::Event(located) => self.core.fire(&mut self.point, &located, observer)?,
                ArcEnd::Stop(outcome) => return Ok(outcome),
                ArcEnd::Again => {}
                ArcEnd::Bound | ArcEnd::Rest(..) | ArcEnd::Resume(_) => return Ok(Outcome::ReachedEnd),
            }
        }
        Ok(self.core.close(&self.point.state, observer).unwrap_or(Outcome::ReachedEnd))
    }

    /// Integrates one smooth arc up to `bound`; leaves the state at the end of the arc, in the mode of the arc.
    fn arc(&mut self, bound: Instant, arrival: Arrival, observer: &mut dyn Observer) -> Result<ArcEnd, EngineError> {
        let Self { integrator, point, motions, kept, leaps, end: [end, end_low], core, .. } = self;
        let mode = &point.state.jump.mode;
        if *kept >= MOST_MODES && motions.get(mode).is_none_or(|met| met.known.is_none()) {
            motions.values_mut().for_each(|met| met.known = None);
            *kept = 0;
        }
        let met = motions.entry(mode.clone()).or_default();
        met.arcs += 1;
        let known = met.known.get_or_insert_with(|| {
            let arc = core.system.clock().between(point.state.at, bound);
            let leaps = integrator.is_exact(core.system, mode, arc);
            *kept += 1;
            ModeMotion { motion: core.system.motion(mode), leaps }
        });
        let motion = &known.motion;
        let again = core.again.take();
        core.is_again = again.is_some();
        let mut before = again.as_ref().map_or_else(EarlierSteps::default, |again| {
            let StepsBeforeRepeat { steps, extent, left_out } = again;
            EarlierSteps { steps: *steps, extent, left_out: *left_out }
        });
        if let Some(motion) = motion.as_deref().filter(|_| known.leaps && !core.is_again && core.summed.is_none()) {
            if let Some(end) = leaps.arc(core, (motion, met.arcs), point, bound, arrival, observer)? {
                return Ok(end);
            }
            before = leaps.before();
        }
        let WideState { state, low, carried } = point;
        let mode = &state.jump.mode;
        core.counters.arcs += u64::from(before.steps == 0 && !core.is_again);
        // Valid if the arc ends before its first step.
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
        let place = ArcSpan { state, bound, arrival };
        // If leaps precede these steps, the leaps began the arc.
        let (mut ended, mut first) = (Ok(None), before.steps == 0);
        integrator
            .integrate_arc(core.system, &arc, end, end_low, &mut |step| {
                ended = core.visit(step, place, std::mem::take(&mut first), observer);
                if matches!(ended, Ok(None)) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
            .map_err(|source| EngineError::Integrate { mode: core.system.mode_in_words(mode), source })?;
        let (ended, left) = (ended?.unwrap_or(ArcEnd::Bound), &mut core.left);
        if let ArcEnd::Bound = ended {
            left.state.at = bound;
            std::mem::swap(&mut left.state.x, end);
            std::mem::swap(&mut left.low, end_low);
        }
        // If no time has passed, the exact zeros remain valid: within a cascade, and for a run that is continued later.
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
