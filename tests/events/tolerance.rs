//! Events to a tolerance: `run.event_tolerance`.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Engine, Observer, Options, State},
    event::EventRecord,
    integrate::Taylor,
    system::Structure,
};

/// The first record of a changed mode or state, after that of the start.
#[derive(Default)]
struct First(Option<EventRecord>);

impl Observer for First {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.start || record.graze {
            return ControlFlow::Continue(());
        }
        self.0.get_or_insert_with(|| record.clone());
        ControlFlow::Break(())
    }
}

/// One arc from `state`: its event, where the run stands behind it, and the steps it took.
fn arc(system: &Structure, state: &State, event_tolerance: f64) -> (Option<EventRecord>, State, u64) {
    let end = system.clock().advance(state.at, 10.0 * system.clock().period().unwrap().value());
    let mut first = First::default();
    let options = Options { event_tolerance, ..Options::default() };
    let mut engine = Engine::new(system, Box::new(Taylor::default()), options, state.clone());
    engine.run(end, &mut first).unwrap();
    (first.0, engine.state().clone(), engine.counters().steps)
}

#[test]
fn an_arc_adds_no_more_than_the_tolerance_to_the_time_of_its_event() {
    for scene in ["W1b-ds", "W2b", "W3", "W4", "W5b-p", "reference-light"] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let (system, period) = (&simulation.structure, simulation.period().unwrap());
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let mut state = simulation.start().unwrap();
            for _ in 0..40 {
                let (exact, after, _) = arc(system, &state, 0.0);
                let (loose, ..) = arc(system, &state, tolerance);
                let (Some(exact), Some(loose)) = (exact, loose) else { panic!("{scene}: no event") };
                assert_eq!((&exact.fired, &exact.to), (&loose.fired, &loose.to), "{scene} {tolerance}");
                let apart = simulation.clock().between(exact.at, loose.at).abs();
                assert!(apart <= tolerance * period, "{scene} {tolerance}: {:e} periods", apart / period);
                let stated = exact.conditioning.time + loose.conditioning.time;
                assert!(apart <= stated, "{scene} {tolerance}: {apart:e} apart, {stated:e} stated");
                state = after;
            }
        }
    }
}

#[test]
fn a_tolerance_saves_work() {
    let simulation = Simulation::from_file("examples/scenes/reference-light.json").unwrap();
    let steps = |event_tolerance: f64| {
        let end = simulation.clock().at(20, 0.0);
        let options = Options { event_tolerance, ..Options::default() };
        let state = simulation.start().unwrap();
        let mut engine = Engine::new(&simulation.structure, Box::new(Taylor::default()), options, state);
        engine.run(end, &mut ()).unwrap();
        engine.counters().steps
    };
    // To 1e-5 sixteen terms hold for 3.3 rad, to 1e-16 twenty-four for 2.2; what is proven of a step grows with its length besides.
    let [all, few] = [steps(0.0), steps(1e-3)];
    assert!(10 * few < 9 * all, "{few} of {all}");
}
