//! A run that nobody looks at: the state, the mode and the counters of one that is looked at, bit for bit.

use std::ops::ControlFlow;

use flank::{
    Simulation,
    engine::{Counters, Engine, JumpRecord, Observer, Options, Outcome, State},
    event::EventRecord,
    hybrid::{
        ContactMode, ContactView, GuardId, HybridSystem, Instant, LaneEvent, LaneHost, LaneLimits, LanePoint,
        LaneRecords, LapEnd, Mode, Rebound,
    },
    integrate::DenseStep,
    orbit::Tangent,
    scene::Scene,
    system::Structure,
};
use serde_json::json;

/// Looks at events and at nothing else.
#[derive(Default)]
struct EventCounter(u64);

impl Observer for EventCounter {
    fn wants_steps(&self, _: &Mode, _: flank::hybrid::Instant) -> bool {
        false
    }

    fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
        self.0 += 1;
        ControlFlow::Continue(())
    }
}

fn scene(name: &str) -> Scene {
    Scene::from_file(format!("{}/examples/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn engine(simulation: &Simulation, state: State, options: Options) -> Engine<'_> {
    Engine::new(&simulation.structure, simulation.integrator().unwrap(), options, state)
}

/// State, counters and outcome at the end of each piece of the run.
fn pieces(
    simulation: &Simulation,
    start: &State,
    (ends, options): (&[f64], Options),
    observer: &mut dyn Observer,
) -> Vec<(State, Counters, Outcome)> {
    let clock = simulation.clock();
    let mut engine = engine(simulation, start.clone(), options);
    let run = |end: &f64| {
        let outcome = engine.run(clock.advance(start.at, end * clock.period().unwrap().hi), observer).unwrap();
        (engine.state().clone(), engine.counters(), outcome)
    };
    ends.iter().map(run).collect()
}

/// Runs in pieces, watched and not, and compares. The number of events.
fn compare(name: &str, simulation: &Simulation, start: &State, ends: &[f64], options: Options) -> u64 {
    let mut watching = EventCounter::default();
    let watched = pieces(simulation, start, (ends, options), &mut watching);
    let silent = pieces(simulation, start, (ends, options), &mut ());
    for (i, (watched, silent)) in watched.iter().zip(&silent).enumerate() {
        assert_eq!(watched, silent, "{name}, piece {i}");
    }
    watched.last().unwrap().1.events
}

fn start(simulation: &Simulation, share: f64) -> State {
    let (mut q, mut v) = (simulation.q0.clone(), simulation.v0.clone());
    q[0] -= 0.3 * share * simulation.structure.spec().contacts[0].half_backlash.max(0.1);
    v[0] += 0.1 * share;
    simulation.start_at(&q, &v).unwrap()
}

const ENDS: [f64; 6] = [0.3, 1.0, 1.7, 8.0, 8.000_000_1, 60.0];

/// Trains that have a lane: linear laws, steps of stiffness, rigid flanks, sequences that come to rest; and ones that have none.
#[test]
fn a_run_that_nobody_looks_at_has_the_bits_of_one_that_is_looked_at() {
    let names = [
        "W1a-0",
        "W1a-ss",
        "W1a-ds",
        "W1a-ch",
        "W1b-ds",
        "W1c-ss",
        "W1c-ds",
        "W1c-ch",
        "W2b",
        "W5b-p",
        "W5b-ch",
        "W5b-gr",
        "W5c",
        "kahraman-singh",
        "W3",
        "W3-sym",
        "W4",
        "four-planets",
        "helical-pair",
        "loose-gear",
        "reference-heavy",
        "reference-light",
        "three-gear-chain",
        "three-shaft-box",
    ];
    for name in names {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        for i in 0..6 {
            compare(name, &simulation, &start(&simulation, f64::from(i)), &ENDS, Options::default());
        }
    }
}

/// Wherever a budget of events ends a run, it ends both.
#[test]
fn a_budget_of_events_ends_both() {
    for name in ["W1a-ds", "W1c-ds", "W5b-p", "W5c", "W3", "W4"] {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        for max_events in [1, 2, 7, 20] {
            let options = Options { max_events, ..Options::default() };
            let events = compare(name, &simulation, &start(&simulation, 0.0), &ENDS, options);
            assert_eq!(events, max_events, "{name}");
        }
    }
}

/// Oscillators that strike walls, at amplitudes, frequencies and restitutions from a sequence without order: impacts in chaos, sequences
/// that come to rest, rest, loss of contact.
#[test]
fn impact_oscillators_of_all_kinds_end_alike() {
    let (mut random, mut events) = (0.37_f64, 0);
    let mut next = |low: f64, high: f64| {
        random = 3.999_999 * random * (1.0 - random);
        low + (high - low) * random
    };
    for i in 0..200 {
        let scene = scene("W5c")
            .with("/train/load_harmonics/0/frequency_rad_per_s", json!(next(0.2, 3.0)))
            .and_then(|scene| scene.with("/train/wall/position_m", json!(next(-0.1, 0.5))))
            .and_then(|scene| scene.with("/train/law/restitution", json!(next(0.2, 0.95))))
            .unwrap();
        let simulation = Simulation::from_scene(scene).unwrap();
        let name = format!("oscillator {i}");
        events += compare(&name, &simulation, &start(&simulation, 0.0), &ENDS, Options::default());
    }
    assert!(events > 3000, "{events}");
}

/// Pairs of all loads, with stiffness that is constant, follows the forcing, or steps.
#[test]
fn pairs_of_all_kinds_end_alike() {
    let mut events = 0;
    for i in 0..90 {
        let (share, name) = (f64::from(i) / 90.0, ["W1a-ch", "W1b-ch", "W1c-ch"][i as usize % 3]);
        let scene = scene(name).with("/train/mean_load", json!(0.02 + 0.3 * share)).unwrap();
        let simulation = Simulation::from_scene(scene).unwrap();
        events += compare(name, &simulation, &start(&simulation, 6.0 * share), &ENDS, Options::default());
    }
    assert!(events > 6000, "{events}");
}

/// Planetary sets of several loads and duties of their stiffness, with meshes in phase and not, from starts that are equal in all planets and not:
/// steps from event to event, several meshes at once, switches near events, leaps in modes that come again.
#[test]
fn planetary_sets_of_all_kinds_end_alike() {
    let mut events = 0;
    for i in 0..60 {
        let (share, name) = (f64::from(i) / 60.0, ["W3", "W3-sym", "W4"][i as usize % 3]);
        let scene = scene(name).with("/train/load_n/0", json!(20.0 + 800.0 * share)).unwrap();
        let scene = (0..6).fold(scene, |scene, j| {
            scene.with(&format!("/train/contacts/{j}/stiffness/duty"), json!(0.1 + 0.8 * share)).unwrap()
        });
        let simulation = Simulation::from_scene(scene).unwrap();
        let start = if i % 2 == 0 {
            simulation.start_at(&simulation.q0, &simulation.v0).unwrap()
        } else {
            start(&simulation, share)
        };
        events += compare(&format!("{name} {i}"), &simulation, &start, &ENDS, Options::default());
    }
    assert!(events > 10_000, "{events}");
}

/// Returns the limits of a lane up to `bound` that nobody observes.
fn up_to(bound: Instant) -> LaneLimits {
    LaneLimits { bound, observed: Instant::LAST, events: u64::MAX, steps: u64::MAX }
}

/// Leaves all modes to the lane, and ends no sequence.
struct FreeHost;

impl LaneHost for FreeHost {
    fn pass(&mut self, _: Instant) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn is_exact(&mut self, _: &Mode) -> bool {
        true
    }

    fn count(&mut self, _: &Mode, _: u64) -> u64 {
        0
    }

    fn meet(&mut self, _: GuardId, _: f64) {}

    fn ends(&mut self, _: &Rebound) -> bool {
        false
    }
}

/// A lane passes steady motions by itself: it goes to the end without giving an arc back, and its events are those of the run.
#[test]
fn a_lane_passes_steady_motions_by_itself() {
    for (name, has_lane) in [("W1a-ds", true), ("W1b-ds", true), ("W1c-ds", true), ("W5b-p", true), ("W2b", false)] {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        let Some(mut lane) = simulation.structure.lane() else {
            assert!(!has_lane, "{name}");
            continue;
        };
        assert!(has_lane, "{name}");
        let start = simulation.start_at(&simulation.q0, &simulation.v0).unwrap();
        let (clock, mut watching) = (simulation.clock(), EventCounter::default());
        let mut engine = engine(&simulation, start, Options::default());
        engine.run(clock.at(50, 0.0), &mut watching).unwrap();
        let (before, State { mut at, mut x, mut jump }) = (engine.counters(), engine.state().clone());
        engine.run(clock.at(100, 0.0), &mut watching).unwrap();
        let (mut carried, end) = (Vec::new(), clock.at(100, 0.0));
        let point = LanePoint {
            at: &mut at,
            x: &mut x,
            jump: &mut jump,
            carried: &mut carried,
            arcs: before.arcs,
            impact: None,
        };
        let lap = lane.run(point, up_to(end), LaneRecords::default(), &mut FreeHost);
        assert_eq!((lap.end, lap.events), (LapEnd::Bound, engine.counters().events - before.events), "{name}");
    }
}

/// A lane passes three quarters or more of the cycles of motions without order: events, several at once, and switches of the stiffness.
#[test]
fn a_lane_passes_most_cycles_of_a_chaotic_motion() {
    for name in ["W3", "W3-sym", "W4"] {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        let mut lane = simulation.structure.lane().unwrap();
        let start = simulation.start_at(&simulation.q0, &simulation.v0).unwrap();
        let (clock, mut watching) = (simulation.clock(), EventCounter::default());
        let mut engine = engine(&simulation, start, Options::default());
        let (mut passed, mut fired, mut switches) = (0, 0, 0);
        // No stiffness switches at this phase. A lane that begins at a switch leaves it to the engine.
        let phase = 0.0371 * clock.period().unwrap().hi;
        engine.run(clock.at(0, phase), &mut watching).unwrap();
        for cycle in 0..60 {
            let end = clock.at(cycle + 1, phase);
            let (before, State { mut at, mut x, mut jump }) = (engine.counters(), engine.state().clone());
            engine.run(end, &mut watching).unwrap();
            let mut carried = Vec::new();
            let (at, x, jump, carried) = (&mut at, &mut x[..], &mut jump, &mut carried);
            let point = LanePoint { at, x, jump, carried, arcs: before.arcs, impact: None };
            assert_eq!(simulation.structure.switched(&point.jump.mode, *point.at), point.jump.mode, "{name}");
            let lap = lane.run(point, up_to(end), LaneRecords::default(), &mut FreeHost);
            if lap.end == LapEnd::Bound {
                let after = engine.counters();
                let made = (after.events - before.events, after.fired - before.fired, after.switches - before.switches);
                assert_eq!((lap.events, lap.fired, lap.switches), made, "{name}, cycle {cycle}");
                (passed, fired, switches) = (passed + 1, fired + lap.fired, switches + lap.switches);
            }
        }
        assert!(passed >= 45 && fired > 300 && switches >= 15, "{name}: {passed} cycles, {fired}, {switches}");
    }
}

/// Looks at events from an instant on, and keeps the instants that it is passed before.
struct LateObserver {
    from: Instant,
    events: Vec<EventRecord>,
    /// Jumps since the last event.
    jumps: u32,
    skipped: Vec<Instant>,
    most: usize,
}

impl Observer for LateObserver {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn observed_from(&self) -> Instant {
        self.from
    }

    fn skip(&mut self, at: Instant) -> ControlFlow<()> {
        self.skipped.push(at);
        if self.skipped.len() < self.most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, _: &JumpRecord<'_>) {
        self.jumps += 1;
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        assert_eq!(self.jumps, record.jumps, "{record:?}");
        self.jumps = 0;
        self.events.push(record.clone());
        ControlFlow::Continue(())
    }
}

/// An observer that looks from an instant on receives all events from there on, as one that looks from the start does. Before, it receives
/// instants in rising order, and it may stop the run there. Every jump that it receives has its record.
#[test]
fn an_observer_may_begin_late() {
    for name in ["W1a-ds", "W1c-ds", "W5b-p", "W5b-ch", "W3", "W4"] {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        let clock = simulation.clock();
        let (from, end) = (clock.at(400, 0.3 * clock.period().unwrap().hi), clock.at(410, 0.0));
        let run = |from: Instant, most: usize| {
            let mut late = LateObserver { from, events: Vec::new(), jumps: 0, skipped: Vec::new(), most };
            let mut engine = engine(&simulation, start(&simulation, 0.0), Options::default());
            let outcome = engine.run(end, &mut late).unwrap();
            (late, engine.state().clone(), engine.counters(), outcome)
        };
        let (mut early, state, counters, outcome) = run(Instant::FIRST, usize::MAX);
        assert!(early.skipped.is_empty() && outcome == Outcome::ReachedEnd, "{name}");
        let (mut late, late_state, late_counters, _) = run(from, usize::MAX);
        assert_eq!((&state, counters), (&late_state, late_counters), "{name}");
        let all = early.events.len();
        assert!(late.events.len() < all / 2, "{name}: {} of {all}", late.events.len());
        early.events.retain(|record| record.at >= from);
        late.events.retain(|record| record.at >= from);
        assert!(late.events == early.events && !late.events.is_empty(), "{name}");
        assert!(late.skipped.is_sorted() && late.skipped.iter().all(|at| *at < from), "{name}");
        let (late, state, _, outcome) = run(from, 2);
        assert!(outcome == Outcome::StoppedByObserver && late.skipped.len() == 2, "{name}: {outcome:?}");
        assert!(state.at <= late.skipped[1], "{name}");
    }
}

/// Wherever a budget of steps ends a run, it ends both, in the same state.
#[test]
fn a_budget_of_steps_ends_both() {
    for name in ["W1a-ds", "W3", "W4"] {
        let simulation = Simulation::from_scene(scene(name)).unwrap();
        let end = simulation.clock().at(60, 0.0);
        for max_steps in [1, 7, 50, 101] {
            let run = |observer: &mut dyn Observer| {
                let mut engine =
                    engine(&simulation, start(&simulation, 0.0), Options { max_steps, ..Options::default() });
                let error = engine.run(end, observer).unwrap_err().to_string();
                (error, engine.state().clone(), engine.counters())
            };
            assert_eq!(run(&mut EventCounter::default()), run(&mut ()), "{name}, {max_steps}");
        }
    }
}

/// Keeps the events of one contact, its times in all states, the sizes of the state and the derivative: from calls, or from records of a lane.
struct Notes<'s> {
    structure: &'s Structure,
    tangent: Tangent<'s>,
    times: Vec<[f64; 5]>,
    events: Vec<LaneEvent>,
    sizes: Vec<f64>,
    /// True if records of a lane suffice.
    is_recorded: bool,
    /// Number of jumps that were passed by calls.
    calls: u64,
}

impl<'s> Notes<'s> {
    fn new(structure: &'s Structure, is_recorded: bool) -> Self {
        let (times, sizes) = (vec![[0.0; 5]], vec![0.0; HybridSystem::dim(structure)]);
        Self { structure, tangent: Tangent::new(structure), times, events: Vec::new(), sizes, is_recorded, calls: 0 }
    }

    fn state(&self, mode: &Mode) -> ContactMode {
        ContactView::contact_mode(self.structure, 0, mode)
    }
}

impl Observer for Notes<'_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.wants_steps(mode, until)
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        let own = LaneRecords {
            times: Some(&mut self.times),
            events: Some(&mut self.events),
            sizes: Some(&mut self.sizes),
            ..LaneRecords::default()
        };
        self.tangent.records()?.and(own).filter(|_| self.is_recorded)
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        let state = self.state(mode);
        self.times[0][state as usize] += time;
        self.tangent.leap(mode, time)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let state = self.state(mode);
        self.times[0][state as usize] += step.time(until);
        self.tangent.step(mode, step, until)
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        let (was, is) = (self.state(&jumped.from.mode), self.state(&jumped.to.mode));
        let (at, rate) = (jumped.at, self.structure.deflection(0, jumped.at, jumped.x_minus).1);
        self.calls += 1;
        self.events.push(LaneEvent { at, contact: 0, was, is, rate });
        for x in [jumped.x_minus, jumped.x_plus] {
            self.sizes.iter_mut().zip(x).for_each(|(size, x)| *size = size.max(x.abs()));
        }
        self.tangent.jump(jumped);
    }
}

/// A lane records what an observer receives by calls: instants and states to the bit; times, rates and derivatives to the rounding of
/// their sums. The derivative of one way comes from the columns of propagators, that of the other from exponentials and collocation.
#[test]
fn records_of_a_lane_are_those_of_calls() {
    let (mut recorded, mut called) = (0, 0);
    for i in 0..90 {
        let (share, name) = (f64::from(i) / 90.0, ["W1a-ch", "W1b-ch", "W1c-ch"][i as usize % 3]);
        let scene = scene(name).with("/train/mean_load", json!(0.02 + 0.3 * share)).unwrap();
        // The damper acts everywhere, or in contact alone; the contact then ends as its deflection or its force is zero.
        let scene = match i % 9 {
            0..3 => scene,
            3..6 => scene.with("/train/damping_in_gap", json!(false)).unwrap(),
            _ => {
                let scene = scene.with("/train/damping_in_gap", json!(false)).unwrap();
                scene.with("/train/release", json!("force")).unwrap()
            }
        };
        let simulation = Simulation::from_scene(scene).unwrap();
        let run = |is_recorded: bool| {
            let mut notes = Notes::new(&simulation.structure, is_recorded);
            let mut engine = engine(&simulation, start(&simulation, 6.0 * share), Options::default());
            // A mode that follows the forcing has its propagator after some hundred arcs.
            engine.run(simulation.clock().at(60, 0.3), &mut ()).unwrap();
            for cycle in 61..=64 {
                engine.run(simulation.clock().at(cycle, 0.3), &mut notes).unwrap();
            }
            (notes, engine.state().clone(), engine.counters())
        };
        let ((notes, state, counters), (own, own_state, own_counters)) = (run(true), run(false));
        assert_eq!((state, counters), (own_state, own_counters), "{name} {share}");
        let near = |a: f64, b: f64, size: f64| (a - b).abs() <= size;
        let total: f64 = own.times[0].iter().sum();
        assert!(notes.times[0].iter().zip(own.times[0]).all(|(a, b)| near(*a, b, 1e-14 * total)), "{name} {share}");
        assert_eq!(notes.events.len(), own.events.len(), "{name} {share}");
        for (a, b) in notes.events.iter().zip(&own.events) {
            assert_eq!((a.at, a.was, a.is), (b.at, b.was, b.is), "{name} {share}");
            assert!(near(a.rate, b.rate, 1e-14), "{name} {share}: {} {}", a.rate, b.rate);
        }
        assert_eq!(notes.sizes, own.sizes, "{name} {share}");
        let largest = own.tangent.columns.values.iter().fold(0.0, |m: f64, value| m.max(value.abs()));
        for (a, b) in notes.tangent.columns.values.iter().zip(&own.tangent.columns.values) {
            assert!(near(*a, *b, 1e-11 * largest), "{name} {share}: {a} {b}");
        }
        assert!(near(notes.tangent.volume, own.tangent.volume, 1e-12), "{name} {share}");
        (recorded, called) = (recorded + own.calls - notes.calls, called + notes.calls);
    }
    assert!(recorded > 800 && called < recorded / 20 && called > 0, "{recorded} events recorded, {called} by calls");
}
