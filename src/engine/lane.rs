//! Motions that need no call to an observer, in the lane of the system.
//!
//! The result equals that of arcs and instants, bit for bit. A lane advances only where nothing is ambiguous, and returns any arc that it
//! cannot decide from the start of that arc.

use std::{collections::BTreeMap, ops::ControlFlow};

use super::{
    Observer, Outcome,
    advance::VisitedMode,
    alarm::Alarm,
    chatter::{Chatter, Flight},
    state::{Options, WideState},
    visit::{ArcEnd, Core},
};
use crate::{
    event::Accumulation,
    hybrid::{
        GuardId, GuardSet, HybridSystem, Instant, Lane, LaneHost, LaneLimits, LanePoint, LaneRecords, Lap, LapEnd,
        Mode, RECORDED, Rebound,
    },
    integrate::Integrator,
};

/// Host of a lane: decides exactness and the ends of impact sequences, counts arcs, keeps roundings, and passes instants to the observer.
struct Host<'a, 's> {
    system: &'s dyn HybridSystem,
    integrator: &'a mut (dyn Integrator + 's),
    motions: &'a mut BTreeMap<Mode, VisitedMode<'s>>,
    chatter: &'a mut Chatter,
    alarm: &'a mut Alarm,
    options: &'a Options,
    observer: &'a mut dyn Observer,
    /// Start and end of the longest possible arc.
    longest: [Instant; 2],
    ended: Option<(GuardSet, Accumulation)>,
    /// True if the observer stops the run.
    stops: bool,
}

impl LaneHost for Host<'_, '_> {
    fn pass(&mut self, at: Instant) -> ControlFlow<()> {
        let flow = self.observer.skip(at);
        self.stops = flow.is_break();
        flow
    }

    fn is_exact(&mut self, mode: &Mode) -> bool {
        let [start, end] = self.longest;
        self.integrator.is_exact(self.system, mode, self.system.clock().between(start, end))
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
        let Rebound { at, guard, derivatives, rounding, until } = *rebound;
        let flight = Flight {
            start: at,
            guards: &[guard],
            derivatives: &|_| Some(derivatives),
            rounding: &|_| rounding,
            is_estimate: false,
        };
        let ended = self.chatter.ends(self.system, &flight, &GuardSet::from_iter([guard]), self.options);
        let left = || self.system.clock().between(at, until);
        self.ended = ended.filter(|(_, accumulation)| accumulation.remaining < left());
        self.ended.is_some()
    }
}

/// Advances in `lane` from `point` up to `bound`, or up to what `observer` looks at. Returns the end of the current arc if the lane has
/// reached it.
pub(super) fn go_on<'s>(
    lane: &mut (dyn Lane + 's),
    core: &mut Core<'s>,
    (integrator, motions): (&mut (dyn Integrator + 's), &mut BTreeMap<Mode, VisitedMode<'s>>),
    point: &mut WideState,
    bound: Instant,
    observer: &mut dyn Observer,
) -> Option<ArcEnd> {
    let Core { system, options, counters, chatter, alarm, iteration, .. } = core;
    let is_open = iteration.is_open();
    let before = counters.events + u64::from(is_open);
    // Where records suffice, the observer is not called. Then the lane stops after some steps, so that the observer may end the run.
    let suffices = |records: LaneRecords<'_>| !records.is_empty() && lane.makes(&records);
    let records_suffice = observer.records().is_some_and(suffices);
    let observed = if records_suffice { Instant::LAST } else { observer.observed_from() };
    // With a tolerance the uncertainty of each event is counted, and a lane does not give it.
    if observed <= point.state.at
        || before >= options.max_events
        || !point.state.jump.still.is_empty()
        || core.tolerance > 0.0
    {
        return None;
    }
    let (events, mut steps) = (options.max_events - before, options.max_steps - counters.steps);
    if records_suffice {
        steps = steps.min(RECORDED);
    }
    let mut nobody = ();
    let (records, watcher): (LaneRecords<'_>, &mut dyn Observer) = match records_suffice {
        true => (observer.records().unwrap_or_default(), &mut nobody),
        false => (LaneRecords::default(), &mut *observer),
    };
    let mut host = Host {
        system: *system,
        integrator,
        motions,
        chatter,
        alarm,
        options,
        observer: watcher,
        longest: [point.state.at, bound],
        ended: None,
        stops: false,
    };
    let fired = iteration.fired();
    let impact = fired.iter().find(|id| system.restitution(*id).is_some()).filter(|_| is_open);
    // Several impacts at once are resolved by the event iteration.
    if impact.is_some() && fired.len() > 1 {
        return None;
    }
    // The record of an open instant has the state after it.
    let opened = (is_open && !iteration.is_silent).then(|| point.state.clone());
    let WideState { state, carried, .. } = &mut *point;
    let from =
        LanePoint { at: &mut state.at, x: &mut state.x, jump: &mut state.jump, carried, arcs: counters.arcs, impact };
    let lap = lane.run(from, LaneLimits { bound, observed, events, steps }, records, &mut host);
    let (ended, stops) = (host.ended, host.stops);
    let stop = Some(ArcEnd::Stop(Outcome::StoppedByObserver));
    if lap == Lap::default() {
        return stop.filter(|_| stops);
    }
    core.counters.steps += lap.steps;
    core.counters.arcs += lap.arcs;
    core.counters.events += lap.events;
    core.counters.fired += lap.fired;
    core.counters.switches += lap.switches;
    core.locator.splits += lap.splits;
    let closed = opened.and_then(|opened| core.close(&opened, observer));
    core.go_past(&point.state);
    if let Some(outcome) = closed {
        return Some(ArcEnd::Stop(outcome));
    }
    if stops || observer.skip(point.state.at).is_break() {
        return stop;
    }
    match (lap.end, ended) {
        (LapEnd::Bound, _) => Some(ArcEnd::Bound),
        (LapEnd::Sequence, Some((guards, accumulation))) => Some(ArcEnd::Rest(guards, accumulation)),
        _ => None,
    }
}
