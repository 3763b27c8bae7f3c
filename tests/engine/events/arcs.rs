//! Single arcs, and what is seen of them.

use std::ops::ControlFlow;

use flank::{
    engine::{Observer, Options, State},
    event::EventRecord,
    hybrid::Mode,
    integrate::DenseStep,
    system::Structure,
};

use proptest::prelude::*;

use super::support::engine;

/// The first record of a changed mode or state, after that of the start. It stops the run.
#[derive(Default)]
pub struct First(pub Option<EventRecord>);

impl Observer for First {
    fn wants_steps(&self, _: &Mode, _: flank::hybrid::Instant) -> bool {
        false
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.start || record.graze {
            return ControlFlow::Continue(());
        }
        self.0.get_or_insert_with(|| record.clone());
        ControlFlow::Break(())
    }
}

/// Keeps records, and compares the end of what it was shown with them.
#[derive(Default)]
pub struct ArcEnds {
    pub records: Vec<EventRecord>,
    pub worst: f64,
    end: Vec<f64>,
}

impl ArcEnds {
    /// Of states of this length.
    pub fn of(dim: usize) -> Self {
        Self { end: vec![0.0; dim], ..Self::default() }
    }
}

impl Observer for ArcEnds {
    fn step(&mut self, _: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        step.state(until, &mut self.end);
        ControlFlow::Continue(())
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if !record.start {
            let off = self.end.iter().zip(&record.x_minus).map(|(a, b)| (a - b).abs());
            self.worst = off.fold(self.worst, f64::max);
        }
        self.records.push(record.clone());
        ControlFlow::Continue(())
    }
}

/// One arc from `state`: its event, where the run stands behind it, and the steps it took.
pub fn arc(system: &Structure, state: &State, options: Options) -> (Option<EventRecord>, State, u64) {
    let end = system.clock().advance(state.at, 10.0 * system.clock().period().unwrap().value());
    let mut first = First::default();
    let mut engine = engine(system, state.clone(), options);
    engine.run(end, &mut first).unwrap();
    (first.0, engine.state().clone(), engine.counters().steps)
}

/// The two events, or none at all: the same guards at the same time, within the uncertainties that both state.
pub fn agreed(
    system: &Structure,
    a: Option<EventRecord>,
    b: Option<EventRecord>,
) -> Result<Option<(EventRecord, EventRecord)>, TestCaseError> {
    prop_assert_eq!(a.is_some(), b.is_some(), "{:?} {:?}", a.as_ref().map(|a| a.at), b.as_ref().map(|b| b.at));
    let Some((a, b)) = a.zip(b) else { return Ok(None) };
    prop_assert_eq!(&a.fired, &b.fired);
    prop_assert_eq!(&a.to, &b.to);
    let apart = system.clock().between(a.at, b.at).abs();
    let stated = a.conditioning.time + b.conditioning.time;
    prop_assert!(apart <= stated, "{:e} {:e} {:e}", apart, a.conditioning.time, b.conditioning.time);
    Ok(Some((a, b)))
}
