//! Runs that only report their final state, in the lane of the system.
//!
//! The result equals that of arcs and instants, bit for bit. A lane advances only where nothing is ambiguous, and returns any arc that it
//! cannot decide from the start of that arc.

use std::collections::BTreeMap;

use super::{
    advance::VisitedMode,
    alarm::Alarm,
    chatter::{Chatter, Flight},
    state::{Options, WideState},
    visit::{ArcEnd, Core},
};
use crate::{
    event::Accumulation,
    hybrid::{Budget, GuardId, GuardSet, HybridSystem, Instant, Lane, LaneHost, LanePoint, Lap, LapEnd, Mode, Rebound},
    integrate::Integrator,
};

/// Host of a lane: decides exactness and the ends of impact sequences, counts arcs, and keeps roundings.
struct Host<'a, 's> {
    system: &'s dyn HybridSystem,
    integrator: &'a mut (dyn Integrator + 's),
    motions: &'a mut BTreeMap<Mode, VisitedMode<'s>>,
    chatter: &'a mut Chatter,
    alarm: &'a mut Alarm,
    options: &'a Options,
    /// Longest possible duration of an arc, s.
    longest: f64,
    ended: Option<(GuardSet, Accumulation)>,
}

impl LaneHost for Host<'_, '_> {
    fn is_exact(&mut self, mode: &Mode) -> bool {
        self.integrator.is_exact(self.system, mode, self.longest)
    }

    fn count(&mut self, mode: &Mode, arcs: u64) -> u64 {
        match self.motions.get_mut(mode) {
            Some(visited) => {
                visited.arcs += arcs;
                visited.arcs
            }
            None if arcs == 0 => 0,
            None => {
                self.motions.insert(mode.clone(), VisitedMode::with(arcs));
                arcs
            }
        }
    }

    fn meet(&mut self, guard: GuardId, rounding: f64) {
        self.alarm.meet(self.system, guard, rounding);
    }

    fn ends(&mut self, rebound: &Rebound) -> bool {
        let Rebound { at, guard, derivatives, rounding, left } = *rebound;
        let flight = Flight {
            start: at,
            guards: &[guard],
            derivatives: &|_| Some(derivatives),
            rounding: &|_| rounding,
            is_estimate: false,
        };
        let ended = self.chatter.ends(self.system, &flight, &GuardSet::from_iter([guard]), self.options);
        self.ended = ended.filter(|(_, accumulation)| accumulation.remaining < left);
        self.ended.is_some()
    }
}

/// Advances in `lane` from `point` up to `bound`. Returns the end of the current arc if the lane has reached it.
pub(super) fn go_on<'s>(
    lane: &mut (dyn Lane + 's),
    core: &mut Core<'s>,
    (integrator, motions): (&mut (dyn Integrator + 's), &mut BTreeMap<Mode, VisitedMode<'s>>),
    point: &mut WideState,
    bound: Instant,
) -> Option<ArcEnd> {
    let Core { system, options, counters, chatter, alarm, iteration, .. } = core;
    let is_open = iteration.is_open();
    let before = counters.events + u64::from(is_open);
    // With a tolerance the uncertainty of each event is counted, and a lane does not give it.
    if before >= options.max_events || !point.state.jump.still.is_empty() || core.tolerance > 0.0 {
        return None;
    }
    let longest = system.clock().between(point.state.at, bound);
    let mut host = Host { system: *system, integrator, motions, chatter, alarm, options, longest, ended: None };
    let fired = iteration.fired();
    let impact = fired.iter().find(|id| system.restitution(*id).is_some()).filter(|_| is_open);
    // Several impacts at once are resolved by the event iteration.
    if impact.is_some() && fired.len() > 1 {
        return None;
    }
    let WideState { state, carried, .. } = &mut *point;
    let from =
        LanePoint { at: &mut state.at, x: &mut state.x, jump: &mut state.jump, carried, arcs: counters.arcs, impact };
    let budget = Budget { events: options.max_events - before, steps: options.max_steps - counters.steps };
    let lap = lane.run(from, bound, budget, &mut host);
    let ended = host.ended;
    if lap == Lap::default() {
        return None;
    }
    core.counters.steps += lap.steps;
    core.counters.arcs += lap.arcs;
    core.counters.events += lap.events;
    core.counters.fired += lap.fired;
    core.counters.switches += lap.switches;
    core.locator.splits += lap.splits;
    core.go_past(&point.state);
    match (lap.end, ended) {
        (LapEnd::Bound, _) => Some(ArcEnd::Bound),
        (LapEnd::Sequence, Some((guards, accumulation))) => Some(ArcEnd::Rest(guards, accumulation)),
        _ => None,
    }
}
