//! The check by series: the next event once more, with other steps and another order.

use std::ops::ControlFlow;

use super::{Seen, Verdict, sizes::Sizes};
use crate::{
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    hybrid::{GuardSet, HybridSystem, Instant, Mode},
    integrate::{DenseStep, Taylor},
};

/// Steps an arc may take.
const STEPS: u64 = 1_000_000;
/// Time of a touch as a part of the time unit: the root of the relative error of a guard.
const TOUCH: f64 = 1e-7;

/// Takes down what a replay finds.
struct Found {
    records: Vec<EventRecord>,
    touches: Vec<(Instant, GuardSet)>,
    steps: u64,
    most: usize,
}

impl Observer for Found {
    fn step(&mut self, _: Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.steps += 1;
        if self.steps > STEPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.graze {
            self.touches.push((record.at, record.fired));
        } else if !(record.start && record.fired.is_empty()) {
            self.records.push(record.clone());
        }
        if self.records.len() > self.most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// The check by series.
#[derive(Default)]
pub(super) struct Series {
    pub steps: u64,
}

impl Series {
    /// As [`Points::check`](super::points::Points::check). `touches` are those of the run on the arc.
    pub fn check(
        &mut self,
        system: &dyn HybridSystem,
        sizes: &mut Sizes,
        from: &State,
        pending: &[EventRecord],
        touches: &[(Instant, GuardSet)],
        (end, unit): (f64, f64),
    ) -> Verdict {
        let clock = system.clock();
        let last = pending.last().map_or_else(|| clock.advance(from.at, end), |record| record.at);
        let until = if pending.is_empty() { last } else { clock.advance(last, super::TOLERANCE * unit) };
        let mut engine = Engine::new(system, Box::new(Taylor::varied()), Options::default(), from.clone());
        let mut found = Found { records: Vec::new(), touches: Vec::new(), steps: 0, most: pending.len() };
        let result = engine.run(until, &mut found);
        self.steps += found.steps;
        if found.steps > STEPS || result.is_err() && found.records.is_empty() {
            return Verdict::NotJudged;
        }
        // The run's last step and the replay's have errors of their own; the steps before left the rounding of the state.
        let first = found.records.first();
        let terms = sizes.of(system, from, unit);
        let mut rate = vec![0.0; from.x.len()];
        let mut allowed = |record: &EventRecord| {
            super::sizes::field(system).eval(from.jump.mode, record.at, 0.0, &record.x_minus, &mut rate);
            let ids = terms.guards.iter().enumerate().filter(|(_, guard)| record.fired.contains(guard.id));
            let size = ids.fold(0.0, |m: f64, (g, _)| m.max(terms.size(g, &record.x_minus, &rate, end)));
            let moved = 2.0 * f64::EPSILON * found.steps as f64;
            // Where the guard is tangent, half its curvature times unit² is of the size of its terms.
            let by_slope = if size > 0.0 { moved * size / record.conditioning.slope.abs() } else { 0.0 };
            let rounding = if by_slope.is_nan() { 0.0 } else { by_slope.min(2.0 * moved.sqrt() * unit) };
            record.conditioning.time + rounding + 2.0 * f64::EPSILON * end
        };
        let margin = pending.first().map_or(0.0, &mut allowed) + first.map_or(0.0, &mut allowed);
        let upto = found.records.iter().take_while(|record| clock.between(last, record.at) <= margin);
        let upto: Vec<&EventRecord> = upto.collect();
        let all = |records: &mut dyn Iterator<Item = &EventRecord>| records.fold(0, |set, record| set | record.fired.0);
        let sets = [all(&mut pending.iter()), all(&mut upto.iter().copied())];
        let (ours, theirs) = (pending.first().map(|r| r.at), first.map(|r| r.at));
        let apart = theirs.map(|at| clock.between(at, ours.unwrap_or(last)));
        let same = match (pending.last(), upto.last()) {
            (None, _) => apart.is_none_or(|apart| apart <= margin),
            (Some(a), Some(b)) => {
                sets[0] == sets[1] && a.to == b.to && apart.is_some_and(|apart| apart.abs() <= margin)
            }
            (Some(_), None) => false,
        };
        if same {
            return Verdict::Same;
        }
        let fired = if sets[0] == sets[1] { sets[0] } else { sets[0] ^ sets[1] };
        let near = |at: Instant| {
            [ours, theirs].into_iter().flatten().any(|other| clock.between(at, other).abs() <= TOUCH * unit)
        };
        let touched = touches.iter().chain(&found.touches).any(|(at, set)| set.0 & fired != 0 && near(*at));
        if touched || result.is_err() {
            return Verdict::NotJudged;
        }
        let seen = first.into_iter().flat_map(|r| r.fired.iter().map(|id| Seen { mode: r.from, id }));
        Verdict::Differs(seen.collect(), apart)
    }
}
