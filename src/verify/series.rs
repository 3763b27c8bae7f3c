//! Check by series: the next event again, with other steps and another order.

use std::ops::ControlFlow;

use super::{Verdict, arc::Arc, fired};
use crate::{
    engine::{Engine, Observer, Options},
    event::EventRecord,
    hybrid::{GuardSet, Mode},
    integrate::{DenseStep, Taylor},
};

/// Maximum number of steps of an arc.
const STEPS: u64 = 1_000_000;

/// Observer that records the events of a replay.
struct ReplayLog {
    records: Vec<EventRecord>,
    touches: Vec<EventRecord>,
    steps: u64,
    most: usize,
}

impl Observer for ReplayLog {
    fn step(&mut self, _: &Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.steps += 1;
        if self.steps > STEPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.graze {
            self.touches.push(record.clone());
        } else if !(record.start && record.fired.is_empty()) {
            self.records.push(record.clone());
        }
        if self.records.len() > self.most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Compares an arc with the end that the run reports. Returns the number of steps too.
pub(super) fn check(arc: &Arc<'_>) -> (Verdict, u64) {
    let (clock, pending) = (arc.system.clock(), &arc.lane.pending);
    let end = clock.advance(arc.lane.last.at, arc.length);
    let last = pending.last().map_or(end, |record| record.at);
    let until = if pending.is_empty() { last } else { clock.advance(last, arc.tolerance()) };
    let mut engine = Engine::new(arc.system, Box::new(Taylor::varied()), Options::default(), arc.lane.last.clone());
    // One instant of the run may be several in the replay, at most one for each fired guard.
    let most = pending.len().max(arc.fired().len());
    let mut found = ReplayLog { records: Vec::new(), touches: Vec::new(), steps: 0, most };
    let failed = engine.run(until, &mut found).is_err();
    let first = found.records.first();
    if found.steps > STEPS || failed && first.is_none() {
        return (Verdict::NotJudged, found.steps);
    }
    let uncertainty = |record| arc.uncertainty(record, found.steps);
    let margin = pending.iter().map(uncertainty).fold(0.0, f64::max) + first.map_or(0.0, uncertainty);
    let (ours, theirs) = (pending.first().map(|r| r.at), first.map(|r| r.at));
    let apart = theirs.map(|at| clock.between(at, ours.unwrap_or(last)));
    let in_time = apart.is_some_and(|apart| apart.abs() <= margin);
    // The replay cannot decide the boundaries of instants within the margin.
    let (set, to) = (arc.fired(), pending.last().map(|record| &record.to));
    let (mut met, mut same, mut guards) = (GuardSet::default(), false, false);
    for record in found.records.iter().take_while(|record| clock.between(last, record.at) <= margin) {
        met |= &record.fired;
        guards |= met == set;
        same |= met == set && to == Some(&record.to);
    }
    if pending.is_empty() && apart.is_none_or(|apart| apart <= margin) || same && in_time {
        return (Verdict::Same, found.steps);
    }
    // Within the margin, one instant cannot be distinguished from two.
    let odd = &(&set - &met) | &(&met - &set);
    if in_time && !odd.is_empty() && pending.last().is_some_and(|record| arc.is_close(&odd, record, 2.0 * margin)) {
        return (Verdict::NotJudged, found.steps);
    }
    let unlike = if guards { set } else { odd };
    let touches = || arc.lane.touches.iter().chain(&found.touches);
    let mut times = [ours, theirs].into_iter().flatten();
    if times.any(|at| arc.is_touched(touches(), &unlike, at)) || failed {
        return (Verdict::NotJudged, found.steps);
    }
    (Verdict::Differs(first.into_iter().flat_map(fired).collect(), apart.filter(|_| !(guards && in_time))), found.steps)
}
