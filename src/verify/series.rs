//! The check by series: the next event once more, with other steps and another order.

use std::ops::ControlFlow;

use super::{
    Seen, Verdict,
    sizes::{Sizes, field},
};
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

/// Rounding of a guard in units of its terms, in ε: a value below it counts as zero. Each step before adds two.
const ROUNDING: f64 = 32.0;

/// How well the time of `record` is known, s, at the end of an arc from `from` of `steps` steps.
///
/// The error of its own step is on record. The steps before it leave the rounding of the state, the terms of the guard and
/// what their rates make of it until the end of the arc, over the slope of the guard; where that vanishes, half the
/// curvature times unit² stands for the size of the terms.
pub(super) fn uncertainty(
    system: &dyn HybridSystem,
    sizes: &mut Sizes,
    from: &State,
    record: &EventRecord,
    (end, unit): (f64, f64),
    steps: u64,
) -> f64 {
    let mut rate = vec![0.0; from.x.len()];
    field(system).eval(from.jump.mode, record.at, 0.0, &record.x_minus, &mut rate);
    let terms = sizes.of(system, from, unit);
    let fired = terms.guards.iter().enumerate().filter(|(_, guard)| record.fired.contains(guard.id));
    let size = fired.fold(0.0, |m: f64, (g, _)| m.max(terms.size(g, &record.x_minus, &rate, end)));
    let relative = (ROUNDING + 2.0 * steps as f64) * f64::EPSILON;
    let by_slope = if size > 0.0 { relative * size / record.conditioning.slope.abs() } else { 0.0 };
    record.conditioning.time
        + by_slope.min(2.0 * relative.sqrt() * unit)
        + 2.0 * f64::EPSILON * end
        + super::resolution(system, from.at)
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
        let first = found.records.first();
        let mut certain = |record| uncertainty(system, sizes, from, record, (end, unit), found.steps);
        let margin = pending.first().map_or(0.0, &mut certain) + first.map_or(0.0, &mut certain);
        let upto = found.records.iter().take_while(|record| clock.between(last, record.at) <= margin);
        let upto: Vec<&EventRecord> = upto.collect();
        let set = pending.iter().fold(0, |set, record| set | record.fired.0);
        let (ours, theirs) = (pending.first().map(|r| r.at), first.map(|r| r.at));
        let apart = theirs.map(|at| clock.between(at, ours.unwrap_or(last)));
        let in_time = apart.is_some_and(|apart| apart.abs() <= margin);
        // Where one instant ends and the next begins, within the margin, is not for the replay to say.
        let (mut same, mut met, mut guards) = (false, 0, false);
        for record in &upto {
            met |= record.fired.0;
            guards |= met == set;
            same |= met == set && pending.last().is_some_and(|ours| ours.to == record.to);
        }
        if pending.is_empty() && apart.is_none_or(|apart| apart <= margin) || same && in_time {
            return Verdict::Same;
        }
        let fired = if guards { set } else { set ^ met };
        let near = |at: Instant| {
            [ours, theirs].into_iter().flatten().any(|other| clock.between(at, other).abs() <= TOUCH * unit)
        };
        let touched = touches.iter().chain(&found.touches).any(|(at, set)| set.0 & fired != 0 && near(*at));
        if touched || result.is_err() {
            return Verdict::NotJudged;
        }
        let seen = first.into_iter().flat_map(|r| r.fired.iter().map(|id| Seen { mode: r.from, id }));
        Verdict::Differs(seen.collect(), apart.filter(|_| !(guards && in_time)))
    }
}
